// detail.glsl - fine structure of the ground; TWIN of sv_terrain_detail_apply in core/terrain/detail.c.

float detail_step(float lo, float hi, float v)
{
    float t = clamp((v - lo) / (hi - lo), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// tile: SV_TERRAIN_DETAIL_SIDE^2 RGBA, repeat, trilinear; 128 means 1. uv: coarse and fine coordinates, in periods.
vec3 detail_apply(sampler2D tile, vec4 uv, float pixel_m, float n_dot_v, float texel_m, vec3 albedo)
{
    float strength = detail_step(1.0, 6.0, texel_m / pixel_m);
    strength *= 1.0 - detail_step(0.0, 0.02, albedo.b - albedo.g);
    strength *= 1.0 - 0.75 * detail_step(0.35, 0.6, dot(vec3(0.3, 0.6, 0.1), albedo));
    if (strength <= 0.0)
        return albedo;
    float footprint = pixel_m * inversesqrt(clamp(n_dot_v, 0.04, 1.0));
    float veg = detail_step(0.0, 0.03, albedo.g - albedo.r);
    float coarse = strength * min(1.0, texel_m * (10.0 / 29.0));
    float fine = strength * min(1.0, texel_m * (10.0 / 3.1));
    vec4 c = textureLod(tile, uv.xy, log2(footprint * (512.0 / 29.0))) * (255.0 / 128.0) - 1.0;
    vec4 f = textureLod(tile, uv.zw, log2(footprint * (512.0 / 3.1))) * (255.0 / 128.0) - 1.0;
    float level = (1.0 + coarse * c.g) * (1.0 + fine * mix(f.a, f.r, veg));
    float hue = 0.35 * coarse * c.b;
    return albedo * level * vec3(1.0 + hue, 1.0, 1.0 - hue);
}
