// tree_billboard.frag - classical billboards: a colour texture a plane, its normals and light (core/tree/billboard.h).
#include "tree_cloud.glsl"

layout(binding = 0) uniform sampler2DArray color;
layout(binding = 1) uniform sampler2DArray normals;
layout(binding = 2) uniform sampler2DArray light;

// Coverage that a pixel must have, by level: params[1 ..] hold struct sv_billboards.bar.
float bar_of()
{
#ifdef HARD
    int level = clamp(int(textureQueryLod(color, st.xy).y + SHARPER + 0.5), 0, 11);
    return params[1 + level / 4][level % 4];
#else
    return 0.5;
#endif
}

void main()
{
    vec4 rgba = texture(color, st, SHARPER);
    cloud_test(rgba.a, bar_of());
    vec4 g = texture(normals, st, SHARPER), o = textureLod(light, st, 0.0);
    float translucency = clamp(dot(rgba.rgb, params[0].xyz) + params[0].w, 0.0, 1.0);
    cloud_light(rgba.rgb, g.xyz * 2.0 - 1.0, g.a, dot(o.xyz * 2.0 - 1.0, model_sun) + o.a, translucency, rgba.a);
}
