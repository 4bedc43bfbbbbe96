// tree_billboard.frag - classical billboards: a colour texture a plane, its normals and light (core/tree/billboard.h).
#include "tree_cloud.glsl"

layout(binding = 0) uniform sampler2DArray color;
layout(binding = 1) uniform sampler2DArray normals;
layout(binding = 2) uniform sampler2DArray light;

void main()
{
    vec4 rgba = texture(color, st);
    if (rgba.a < 0.5)
        discard;
    vec4 g = texture(normals, st), o = textureLod(light, st, 0.0);
    float translucency = clamp(dot(rgba.rgb, params[0].xyz) + params[0].w, 0.0, 1.0);
    cloud_light(rgba.rgb, g.xyz * 2.0 - 1.0, g.a, dot(o.xyz * 2.0 - 1.0, model_sun) + o.a, translucency);
}
