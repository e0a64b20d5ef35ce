// The stage floor, at height 0.

#include "light.glsl"

in vec2 in_place;  // x, z

out vec2 place;

void main() {
    place = in_place;
    gl_Position = clip_from_world * vec4(in_place.x, 0.0, in_place.y, 1.0);
}
