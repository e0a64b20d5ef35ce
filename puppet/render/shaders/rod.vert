// A capsule that runs from one point to another, many in one call; a sphere where they are the same.

#include "light.glsl"
#include "fill.glsl"

in vec3 in_normal;  // of a unit capsule along +Y
in float in_along;  // 0 at its start, 1 at its end

in vec4 in_start;   // xyz, radius
in vec4 in_end;
in vec4 in_color;   // linear; alpha counts only where it is drawn with blending

#ifndef INTO_SHADOW_MAP
out vec3 normal;
out vec3 to_eye;
out vec3 place;     // in the shadow map
out vec3 fill;
flat out vec4 tint;
#endif

void main() {
    vec3 along = in_end.xyz - in_start.xyz;
    float span = length(along);
    vec3 y = span > 1e-6 ? along / span : vec3(0.0, 1.0, 0.0);
    vec3 x = normalize(abs(y.x) < 0.7 ? vec3(0.0, -y.z, y.y) : vec3(y.z, 0.0, -y.x));
    vec3 turned = mat3(x, y, cross(x, y)) * in_normal;
    vec3 position = mix(in_start.xyz, in_end.xyz, in_along)
        + turned * mix(in_start.w, in_end.w, in_along);
#ifdef INTO_SHADOW_MAP
    gl_Position = vec4((shadow_from_world * vec4(position, 1.0)).xyz * 2.0 - 1.0, 1.0);
#else
    normal = turned;
    to_eye = normalize(eye.xyz - position);
    place = shadow_place(position, normal);
    fill = fill_on(position, normal, to_eye);
    tint = in_color;
    gl_Position = clip_from_world * vec4(position, 1.0);
#endif
}
