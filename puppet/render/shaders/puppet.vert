// The skin of a puppet, already in the world.

#include "light.glsl"
#include "fill.glsl"

in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;

out vec3 normal;
out vec3 halfway;  // between eye and key light
out vec3 place;    // in the shadow map
out vec3 fill;
out vec2 uv;

void main() {
    normal = normalize(in_normal);
    vec3 to_eye = normalize(eye.xyz - in_position);
    halfway = normalize(key_direction.xyz + to_eye);
    place = shadow_place(in_position, normal);
    fill = fill_on(in_position, normal, to_eye);
    uv = in_uv;
    gl_Position = clip_from_world * vec4(in_position, 1.0);
}
