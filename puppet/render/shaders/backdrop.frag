// The dark room behind everything.

#include "light.glsl"

out vec4 color;

void main() {
    color = vec4(developed(backdrop(gl_FragCoord.xy)), 1.0);
}
