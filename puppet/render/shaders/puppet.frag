// The skin of a puppet: key light with shadow, fill, soft highlight, light of its own.

#include "light.glsl"
#include "shadow.glsl"

uniform sampler2D base_color;
uniform vec4 tint;
uniform vec3 emissive;
uniform vec4 finish;  // sharpness and strength of the highlight, metallic, gloss

in vec3 normal;
in vec3 halfway;
in vec3 place;
in vec3 fill;
in vec2 uv;

out vec4 color;

void main() {
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    vec4 base = texture(base_color, uv) * tint;
    vec3 key = key_color.rgb * key_light(place);
    // Wrapped a little past the terminator, as on skin and enamel in a lit room.
    float facing = dot(n, key_direction.xyz);
    float diffuse = clamp((facing + 0.15) / 1.15, 0.0, 1.0);
    float highlight = finish.y * step(0.0, facing)
        * pow(max(dot(n, normalize(halfway)), 0.0), finish.x);
    // Metal has no colour of its own but that of what it mirrors.
    vec3 mirrored = mix(vec3(1.0), base.rgb, finish.z);
    vec3 light = base.rgb * (1.0 - 0.6 * finish.z) * (key * diffuse + fill);
    light += mirrored * (key * highlight + fill * (0.5 * finish.z));
    color = vec4(developed(light + emissive), base.a);
}
