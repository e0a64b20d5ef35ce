// How much of the key light arrives: 1 in the light, 0 in the shadow.

uniform sampler2DShadow shadow_map;

// place: as `shadow_place` gives it.
float key_light(vec3 place) {
    float texel = float(SHADOW_SPREAD) / float(SHADOW_SIZE);
#if SHADOW_TAPS == 4
    vec4 lit = vec4(
        texture(shadow_map, place + vec3(-0.35, -0.90, 0.0) * texel),
        texture(shadow_map, place + vec3(0.90, -0.35, 0.0) * texel),
        texture(shadow_map, place + vec3(0.35, 0.90, 0.0) * texel),
        texture(shadow_map, place + vec3(-0.90, 0.35, 0.0) * texel)
    );
    return dot(lit, vec4(0.25));
#elif SHADOW_TAPS == 2
    return 0.5 * (texture(shadow_map, place + vec3(-0.3, -0.6, 0.0) * texel)
        + texture(shadow_map, place + vec3(0.3, 0.6, 0.0) * texel));
#else
    return texture(shadow_map, place);
#endif
}
