// The skin of a puppet: key light with shadow, hemisphere, soft highlight, rim, own light.

#include "light.glsl"
#include "shadow.glsl"

uniform sampler2D base_color;
uniform vec4 tint;
uniform vec3 emissive;
uniform vec4 finish;  // sharpness and strength of the highlight, metallic, gloss

in vec3 position;
in vec3 normal;
in vec2 uv;

out vec4 color;

void main() {
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    vec3 to_eye = normalize(eye.xyz - position);
    vec4 base = texture(base_color, uv) * tint;

    float facing_key = dot(n, key_direction.xyz);
    // Wrapped a little past the terminator, as on skin and enamel in a lit room.
    float diffuse = clamp((facing_key + 0.15) / 1.15, 0.0, 1.0);
    float lit = key_light(position, n);
    vec3 halfway = normalize(key_direction.xyz + to_eye);
    float highlight = pow(max(dot(n, halfway), 0.0), finish.x) * finish.y * step(0.0, facing_key);

    float up = 0.5 + 0.5 * n.y;
    vec3 ambient = mix(bounce_color.rgb, sky_color.rgb, up);
    float edge = 1.0 - max(dot(n, to_eye), 0.0);
    float rim = edge * edge * edge;

    vec3 diffuse_color = base.rgb * (1.0 - 0.6 * finish.z);
    vec3 specular_color = mix(vec3(1.0), base.rgb, finish.z);
    vec3 mirror = mix(bounce_color.rgb, sky_color.rgb, 0.5 - 0.5 * reflect(to_eye, n).y);
    vec3 light = diffuse_color * (key_color.rgb * diffuse * lit + ambient + glow_on(position, n));
    light += specular_color * key_color.rgb * (highlight * lit);
    light += specular_color * mirror * (0.5 * finish.z + 0.25 * finish.w * rim);
    light += sky_color.rgb * base.rgb * (0.9 * rim * up);
    color = vec4(developed(light + emissive), base.a);
}
