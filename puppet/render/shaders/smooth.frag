// Where the picture has an edge, mix across it along its direction (a short FXAA); elsewhere copy.

uniform sampler2D picture;
uniform vec2 pixel;

in vec2 uv;

out vec4 color;

float luma(vec3 c) {
    return dot(c, vec3(0.299, 0.587, 0.114));
}

void main() {
    vec3 middle = texture(picture, uv).rgb;
    float nw = luma(texture(picture, uv + vec2(-0.5, 0.5) * pixel).rgb);
    float ne = luma(texture(picture, uv + vec2(0.5, 0.5) * pixel).rgb);
    float sw = luma(texture(picture, uv + vec2(-0.5, -0.5) * pixel).rgb);
    float se = luma(texture(picture, uv + vec2(0.5, -0.5) * pixel).rgb);
    vec2 along = vec2(sw + se - nw - ne, nw + sw - ne - se);
    float least = max((nw + ne + sw + se) * 0.03125, 0.0078125);
    float inverse = 1.0 / (min(abs(along.x), abs(along.y)) + least);
    along = clamp(along * inverse, -6.0, 6.0) * pixel;
    vec3 close = 0.5 * (texture(picture, uv - along / 6.0).rgb + texture(picture, uv + along / 6.0).rgb);
    vec3 wide = 0.5 * close
        + 0.25 * (texture(picture, uv - along * 0.5).rgb + texture(picture, uv + along * 0.5).rgb);
    float m = luma(middle);
    float low = min(m, min(min(nw, ne), min(sw, se)));
    float high = max(m, max(max(nw, ne), max(sw, se)));
    float wide_luma = luma(wide);
    color = vec4(wide_luma < low || wide_luma > high ? close : wide, 1.0);
}
