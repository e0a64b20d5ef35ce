// The stage floor, at height 0.

#include "light.glsl"

in vec2 in_place;  // x, z

out vec2 place;
#ifdef SHADOW_SIZE
out vec3 shadow;  // the place in the shadow map
#endif

void main() {
    place = in_place;
#ifdef SHADOW_SIZE
    shadow = shadow_place(vec3(in_place.x, 0.0, in_place.y), vec3(0.0, 1.0, 0.0));
#endif
    gl_Position = clip_from_world * vec4(in_place.x, 0.0, in_place.y, 1.0);
}
