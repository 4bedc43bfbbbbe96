// tree_density_paper.frag - the density texture as paper 2 draws it, section 3.5, steps (1) to (4).
// TWIN: sv_density_paper_look (core/tree/density_twin.c).
#include "tree_cloud.glsl"

layout(binding = 0) uniform sampler2DArray density; // R, G: periods; B, A: normal x, y (core/tree/density.h, PAPER)
layout(binding = 1) uniform sampler2D leaf;
layout(binding = 2) uniform sampler2DArray light;   // openness; occlusion params[1].x layers further on

const float UV_SIDE = 1024.0; // SV_DENSITY_UV_SIDE

// Twin of sv_density_period.
vec2 periods(vec2 codes)
{
    return mix(params[1].zz, params[1].ww, clamp((codes * 255.0 - 1.0) / 253.0, 0.0, 1.0));
}

void main()
{
    vec4 code = texture(density, st); // (1)
    bool wood = min(code.x, code.y) > 254.5 / 255.0;
    if (min(code.x, code.y) < 1.0 / 255.0)
        discard; // no leaf
    vec2 at = st.xy * UV_SIDE, w = periods(code.xy);
    vec2 uv = at / w - floor(at / w); // (2): eq. 1 of the billboard's own coordinate
    vec2 dx = dFdx(at) / w, dy = dFdy(at) / w; // of the sawtooth, not across its jumps
    vec4 rgba = textureGrad(leaf, uv, dx, dy); // (3)
    if (wood)
        rgba = vec4(params[2].rgb, 1.0);
    if (rgba.a < 0.5)
        discard;
    vec2 n = code.zw * 2.0 - 1.0; // (4)
    vec3 m = n.x * axis_u + n.y * axis_v + sqrt(max(0.0, 1.0 - dot(n, n))) * cross(axis_u, axis_v);
    vec4 o = textureLod(light, st, 0.0);
    float occlusion = textureLod(light, vec3(st.xy, st.z + params[1].x), 0.0).r;
    float translucency = wood ? 0.0 : clamp(dot(rgba.rgb, params[0].xyz) + params[0].w, 0.0, 1.0);
    cloud_light(rgba.rgb, normalize(m), occlusion, dot(o.xyz * 2.0 - 1.0, model_sun) + o.a, translucency, 1.0);
}
