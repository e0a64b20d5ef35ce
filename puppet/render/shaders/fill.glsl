// Light without direction or shadow. It changes so slowly over a surface that vertices are enough.

// The light of the lamps that puppets carry, as it arrives at a surface.
vec3 glow_on(vec3 position, vec3 normal) {
    vec3 light = vec3(0.0);
    for (int i = 0; i < int(viewport.w); ++i) {
        vec3 way = glow_position[i].xyz - position;
        float square = dot(way, way);
        float falloff = clamp(1.0 - square * glow_position[i].w, 0.0, 1.0);
        float facing = max(dot(normal, way) * inversesqrt(square + 1e-4), 0.0);
        light += glow_color[i].rgb * (facing * falloff * falloff / (0.15 + square));
    }
    return light;
}

// What the room sends back: more from above, and along the edge against the dark.
vec3 fill_on(vec3 position, vec3 normal, vec3 to_eye) {
    float up = 0.5 + 0.5 * normal.y;
    float edge = 1.0 - max(dot(normal, to_eye), 0.0);
    vec3 room = mix(bounce_color.rgb, sky_color.rgb, up);
    return room + sky_color.rgb * (0.9 * edge * edge * edge * up) + glow_on(position, normal);
}
