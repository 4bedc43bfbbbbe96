// relief_bake.frag - what a relief texture keeps of a surface: albedo, sky, normal; no light. Level 0 and alpha test as in
// tree_mesh.frag.
layout(location = 2) uniform vec4 base_color;
layout(location = 3) uniform float cutoff;
layout(binding = 0) uniform sampler2D albedo;

in vec3 normal;
in vec3 uv_occlusion;

layout(location = 0) out vec4 out_color;  // albedo; sky occlusion
layout(location = 2) out vec4 out_normal; // in (a^, b^, f), to the front

void main()
{
    vec4 rgba = textureLod(albedo, uv_occlusion.xy, 0.0) * base_color;
#ifdef MASKED
    if (rgba.a < cutoff)
        discard;
#endif
    float size = length(normal);
    vec3 n = size > 0.0 ? normal / size : vec3(0.0, 0.0, 1.0);
    out_color = vec4(rgba.rgb, uv_occlusion.z);
    out_normal = vec4(n.z < 0.0 ? -n : n, 0.0);
}
