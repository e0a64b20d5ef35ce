// The shadows that fall on the floor: a veil that is thick where the key light does not arrive.

#include "light.glsl"
#include "shadow.glsl"

in vec2 place;
in vec3 shadow;

out vec4 color;

void main() {
    vec2 off = place - pool.xy;
    float fade = clamp(1.0 - dot(off, off) * pool.z, 0.0, 1.0);
    float dark = 1.0 - key_light(shadow);
    color = vec4(0.035, 0.03, 0.035, 0.66 * dark * min(2.0 * fade, 1.0));
}
