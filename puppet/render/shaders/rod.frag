// Rods: the performer's bones and joints, and the marks on puppets.

#include "light.glsl"
#if MANNER == SOLID
#include "shadow.glsl"
#endif

in vec3 normal;
in vec3 to_eye;
in vec3 place;
in vec3 fill;
flat in vec4 tint;

out vec4 color;

void main() {
    vec3 n = normalize(normal);
#if MANNER == SOLID
    vec3 key = key_color.rgb * key_light(place);
    float diffuse = clamp((dot(n, key_direction.xyz) + 0.2) / 1.2, 0.0, 1.0);
    float shine = max(dot(n, normalize(key_direction.xyz + to_eye)), 0.0);
    shine *= shine; shine *= shine; shine *= shine; shine *= shine; shine *= shine;
    color = vec4(developed(tint.rgb * (key * diffuse + fill) + key * (0.09 * shine)), 1.0);
#elif MANNER == HOLLOW
    // A shell of which only the edge shows.
    float edge = 1.0 - max(dot(n, normalize(to_eye)), 0.0);
    color = vec4(developed(tint.rgb * (fill + 1.1)), tint.a * (0.10 + 0.85 * edge * edge));
#else
    color = vec4(developed(tint.rgb * (0.98 + 0.22 * n.y)), tint.a);
#endif
}
