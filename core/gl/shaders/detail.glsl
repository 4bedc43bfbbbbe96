// detail.glsl - fine structure of the ground; TWIN of sv_terrain_detail_apply in core/terrain/detail.c.
// Where pixels (or texels) are known to be too large for a scale, its define is 0, since llvmpipe pays for what is not taken:
// DETAIL_SCALES 3 (all), 2 (no fine), 1 (broad only), 0; DETAIL_BROAD 0: texels below 6 m.

#ifndef DETAIL_SCALES
#define DETAIL_SCALES 3
#endif
#ifndef DETAIL_BROAD
#define DETAIL_BROAD 1
#endif

float detail_step(float lo, float hi, float v)
{
    float t = clamp((v - lo) / (hi - lo), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// One scale: the tile about 0, faded out between two mip levels.
vec4 detail_scale(sampler2D tile, vec2 uv, float lod, float fade_from, float fade_to)
{
    return (textureLod(tile, uv, lod) * (255.0 / 128.0) - 1.0) * (1.0 - detail_step(fade_from, fade_to, lod));
}

// Coordinates of the tile at the scales, in periods: eye: those of the eye (broad, coarse, fine); p: local.
struct detail_place {
    vec2 broad, coarse, fine;
};

detail_place detail_at(vec2 p, vec2 eye[3])
{
    return detail_place(mat2(0.28, 0.96, -0.96, 0.28) * p / 233.0 + eye[0], p / 29.0 + eye[1],
                        mat2(0.8, 0.6, -0.6, 0.8) * p / 3.1 + eye[2]);
}

// tile: SV_TERRAIN_DETAIL_SIDE^2 RGBA, repeat, trilinear; 128 means 1.
vec3 detail_apply(sampler2D tile, detail_place at, float pixel_m, float n_dot_v, float texel_m, vec3 albedo)
{
#if DETAIL_SCALES > 0
    float strength = detail_step(1.0, 6.0, texel_m / pixel_m);
    strength *= 1.0 - detail_step(0.0, 0.02, albedo.b - albedo.g);
    strength *= 1.0 - 0.75 * detail_step(0.35, 0.6, dot(vec3(0.3, 0.6, 0.1), albedo));
    float lod = log2(pixel_m * inversesqrt(clamp(n_dot_v, 0.04, 1.0)) * 512.0);
    float level = 1.0, hue = 0.0;
#if DETAIL_BROAD > 0
    vec4 b = detail_scale(tile, at.broad, lod - log2(233.0), 3.5, 5.5) * (strength * detail_step(6.0, 25.0, texel_m));
    level *= 1.0 + b.g;
    hue += b.b;
#endif
#if DETAIL_SCALES > 1
    vec4 c = detail_scale(tile, at.coarse, lod - log2(29.0), 3.5, 5.5) * (strength * min(1.0, texel_m * (10.0 / 29.0)));
    level *= 1.0 + c.g;
    hue += c.b;
#endif
#if DETAIL_SCALES > 2
    float veg = detail_step(0.0, 0.03, albedo.g - albedo.r);
    vec4 f = detail_scale(tile, at.fine, lod - log2(3.1), 4.0, 5.5) * (strength * min(1.0, texel_m * (10.0 / 3.1)));
    level *= 1.0 + mix(f.a, f.r, veg);
#endif
    albedo *= level * vec3(1.0 + 0.12 * hue, 1.0, 1.0 - 0.12 * hue);
#endif
    return albedo;
}
