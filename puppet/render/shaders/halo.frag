uniform vec3 shine;

in vec2 corner;

out vec4 color;

void main() {
    float fade = clamp(1.0 - dot(corner, corner), 0.0, 1.0);
    color = vec4(shine * (fade * fade * fade), 1.0);
}
