// What every program knows of the stage, and how light falls on it. World space, linear colour.

layout(std140) uniform Stage {
    mat4 clip_from_world;
    mat4 shadow_from_world;  // texture and depth coordinates, 0..1
    vec4 eye;                // xyz; w: metres that a texel of the shadow map covers
    vec4 key_direction;      // towards the light
    vec4 key_color;
    vec4 sky_color;
    vec4 bounce_color;
    vec4 pool;               // xy: centre (x, z); z: 1 / radius²
    vec4 glow_position[2];   // xyz; w: 1 / reach²
    vec4 glow_color[2];
    vec4 viewport;           // 1 / width, 1 / height, aspect, how many lamps glow
};

// A film-like curve that ends in sRGB by itself (after Hejl and Burgess-Dawson): no power function.
vec3 developed(vec3 color) {
    vec3 x = max(color - 0.004, 0.0);
    return (x * (6.2 * x + 0.5)) / (x * (6.2 * x + 1.7) + 0.06);
}

// Where a point lies in the shadow map. Stepping off the surface instead of a large depth bias keeps
// shadows attached to feet.
vec3 shadow_place(vec3 position, vec3 normal) {
    return (shadow_from_world * vec4(position + normal * (1.5 * eye.w), 1.0)).xyz;
}

// The dark room behind everything: a little lighter around the middle of the picture.
vec3 backdrop(vec2 pixel) {
    vec2 p = pixel * viewport.xy - vec2(0.5, 0.56);
    p.x *= 0.75 * viewport.z;
    float distance2 = dot(p, p);
    float light = 1.0 / (1.0 + 3.4 * distance2);
    // A grain of one 8-bit step, so that the slow gradient shows no bands.
    float grain = fract(52.98 * fract(dot(pixel, vec2(0.06711056, 0.00583715)))) - 0.5;
    return vec3(0.0405, 0.0380, 0.0375) * light * light + 0.0062 + grain * 0.0011;
}
