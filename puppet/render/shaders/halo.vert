// The veil of light around a lamp, as an eye sees it: a square that faces the camera.

#include "light.glsl"

uniform vec4 halo;  // xyz: centre, w: radius

in vec2 in_corner;

out vec2 corner;

void main() {
    corner = in_corner;
    vec3 back = normalize(eye.xyz - halo.xyz);
    vec3 right = normalize(vec3(back.z, 0.0, -back.x));
    vec3 up = cross(back, right);
    vec3 position = halo.xyz + (right * in_corner.x + up * in_corner.y) * halo.w;
    gl_Position = clip_from_world * vec4(position, 1.0);
}
