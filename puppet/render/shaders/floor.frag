// A pool of light on the floor that fades into the dark room, with faint rings a metre apart.

#include "light.glsl"

in vec2 place;

out vec4 color;

void main() {
    vec2 off = place - pool.xy;
    float fade = clamp(1.0 - dot(off, off) * pool.z, 0.0, 1.0);
    fade *= fade;

    float radius = length(place);
    float away = abs(fract(radius + 0.5) - 0.5) / max(fwidth(radius), 1e-5);
    float ring = 1.0 + 0.2 * clamp(1.4 - away, 0.0, 1.0) * step(0.5, radius);

    vec3 light = key_color.rgb * (0.62 * fade) + sky_color.rgb * 0.5;
    vec3 albedo = vec3(0.122, 0.109, 0.100) * ring;
    color = vec4(developed(backdrop(gl_FragCoord.xy) + fade * albedo * light), 1.0);
}
