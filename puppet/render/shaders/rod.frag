// Rods: the performer's bones and joints, and the marks on puppets.

#include "light.glsl"
#include "shadow.glsl"

// 0 solid; 1 hollow, a shell of which only the edge shows; 2 a mark drawn over the puppet
uniform int manner;

in vec3 normal;
in vec3 halfway;
in vec3 place;
in vec3 fill;
flat in vec4 tint;

out vec4 color;

void main() {
    vec3 n = normalize(normal);
    if (manner == 0) {
        vec3 key = key_color.rgb * key_light(place);
        float diffuse = clamp((dot(n, key_direction.xyz) + 0.2) / 1.2, 0.0, 1.0);
        float shine = max(dot(n, normalize(halfway)), 0.0);
        shine *= shine; shine *= shine; shine *= shine; shine *= shine; shine *= shine;
        color = vec4(developed(tint.rgb * (key * diffuse + fill) + key * (0.09 * shine)), 1.0);
    } else if (manner == 1) {
        float edge = 1.0 - max(dot(n, to_eye), 0.0);
        color = vec4(developed(tint.rgb * (fill + 1.1)), tint.a * (0.10 + 0.85 * edge * edge));
    } else {
        color = vec4(developed(tint.rgb * (0.98 + 0.22 * n.y)), tint.a);
    }
}
