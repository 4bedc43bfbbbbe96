// tree_quad_hard.frag - depth, id and normal of a far tree, where it covers at least half of the pixel.
#include "tree_quad.glsl"

layout(binding = 0) uniform sampler2DArray albedo;
layout(binding = 1) uniform sampler2DArray normals;

in vec2 st;
flat in vec4 frame_at;
flat in float texels;
flat in float coverage;
flat in vec3 right;
flat in vec3 top;
flat in uint id;

layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;

void main()
{
    vec3 at = vec3(quad_uv(frame_at.xy, st, texels), frame_at.z);
    if (textureLod(albedo, at, frame_at.w).a * quad_border(st, texels) * coverage < 0.5)
        discard;
    vec3 m = textureLod(normals, at, frame_at.w).xyz * 2.0 - 1.0;
    vec3 n = m.x * right + m.y * top + m.z * cross(right, top);
    out_id = id;
    out_normal = vec4(n * inversesqrt(max(dot(n, n), 1e-12)), 0.0);
}
