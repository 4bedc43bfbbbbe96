// tree_density.frag - coverage, colour and mean normal of a plane, prefiltered (core/tree/density.h, PLAIN).
// TWIN: sv_density_plain_look (core/tree/density_twin.c).
#include "tree_cloud.glsl"

layout(binding = 0) uniform sampler2DArray albedo;  // premultiplied, coverage
layout(binding = 1) uniform sampler2DArray normals; // plane's axes; occlusion
layout(binding = 2) uniform sampler2DArray light;   // openness

const float TILE = 128.0; // SV_DENSITY_TILE

// TWIN: sv_density_finer; scales of levels -1 .. 4 in params[1].zw and [4].
float finer(float lod)
{
    float at = clamp(lod + 1.0, 0.0, 5.0);
    return dot(params[1].zw, max(1.0 - abs(at - vec2(0.0, 1.0)), 0.0)) + dot(params[4], max(1.0 - abs(at - vec4(2.0, 3.0, 4.0, 5.0)), 0.0));
}

// Coverage where a texel takes up more than a pixel: edges as sharp as pixels allow, no more and no less area.
float sharpened(float coverage, float lod)
{
    float steep = exp2(max(-lod, 0.0));
    float scaled = coverage * mix(params[1].y, 1.0, 1.0 / steep);
    return clamp((scaled - 0.5) * steep + 0.5, 0.0, 1.0);
}

// Coverage that depth and ids ask for: sv_density_bars, in params[2] and [3].
float bar_of(float lod)
{
#ifdef HARD
    int level = clamp(int(lod + 0.5), 0, 7);
    return lod < 0.0 ? 0.5 : params[2 + level / 4][level % 4];
#else
    return 0.5;
#endif
}

void main()
{
    vec2 dx = dFdx(st.xy) * TILE, dy = dFdy(st.xy) * TILE;
    float lod = 0.5 * log2(max(abs(dx.x * dy.y - dx.y * dy.x), 1e-12));
    lod += finer(lod);
    vec4 rgba = textureLod(albedo, st, lod);
    float alpha = sharpened(rgba.a, lod);
    cloud_test(alpha, bar_of(lod));
    vec3 rgb = rgba.rgb / max(rgba.a, 1e-4);
    vec4 g = textureLod(normals, st, lod), o = textureLod(light, st, 0.0);
    vec3 n = g.xyz * 2.0 - 1.0;
    float translucency = clamp(dot(rgb, params[0].xyz) + params[0].w, 0.0, 1.0);
    cloud_light(rgb, n.x * axis_u + n.y * axis_v + n.z * cross(axis_u, axis_v), g.a,
                dot(o.xyz * 2.0 - 1.0, model_sun) + o.a, translucency, alpha);
}
