// Rods: the performer's bones and joints, and the marks on puppets.

#include "light.glsl"
#include "shadow.glsl"

// 0 solid; 1 hollow, a shell of which only the edge shows; 2 a mark drawn over the puppet
uniform int manner;

in vec3 position;
in vec3 normal;
flat in vec4 tint;

out vec4 color;

void main() {
    vec3 n = normalize(normal);
    vec3 to_eye = normalize(eye.xyz - position);
    float up = 0.5 + 0.5 * n.y;
    float edge = 1.0 - max(dot(n, to_eye), 0.0);
    vec3 ambient = mix(bounce_color.rgb, sky_color.rgb, up);
    if (manner == 0) {
        float diffuse = clamp((dot(n, key_direction.xyz) + 0.2) / 1.2, 0.0, 1.0);
        vec3 halfway = normalize(key_direction.xyz + to_eye);
        float shine = max(dot(n, halfway), 0.0);
        shine *= shine; shine *= shine; shine *= shine; shine *= shine; shine *= shine;
        float lit = key_light(position, n);
        vec3 light = tint.rgb * (key_color.rgb * diffuse * lit + ambient + glow_on(position, n));
        light += key_color.rgb * (0.09 * shine * lit);
        light += sky_color.rgb * tint.rgb * (0.8 * edge * edge * up);
        color = vec4(developed(light), 1.0);
    } else if (manner == 1) {
        float shell = 0.10 + 0.85 * edge * edge;
        color = vec4(developed(tint.rgb * (ambient + 1.1)), shell * tint.a);
    } else {
        color = vec4(developed(tint.rgb * (0.75 + 0.45 * up)), tint.a);
    }
}
