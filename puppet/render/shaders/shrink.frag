// The average of a square of pixels, for pictures that were drawn larger than they are.

uniform sampler2D picture;
uniform int steps;

out vec4 color;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * steps;
    vec4 sum = vec4(0.0);
    for (int y = 0; y < steps; ++y) {
        for (int x = 0; x < steps; ++x) {
            sum += texelFetch(picture, corner + ivec2(x, y), 0);
        }
    }
    color = sum / float(steps * steps);
}
