// tree_mesh.frag - a tree's polygons. Level 0, alpha test and light as the ray-cast truth has them (core/truth/truth.c, shade).
// Wood is a leaf without translucency: light.glsl gives the same numbers once the normal is turned to the viewer.
#include "light.glsl"

layout(location = 0) uniform vec4 base_color;
layout(location = 1) uniform vec2 leaf; // alpha cutoff, translucency
layout(binding = 0) uniform sampler2D albedo;

in vec3 local;
in vec3 normal;
in vec3 uv_occlusion;
in float sun_open;
flat in uint id;

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;

void main()
{
    vec4 rgba = textureLod(albedo, uv_occlusion.xy, 0.0) * base_color;
#ifdef MASKED
    if (rgba.a < leaf.x)
        discard;
#endif
    vec3 to_viewer = frame_to_viewer(local);
    vec3 n = normalize(normal);
    n = dot(n, to_viewer) < 0.0 ? -n : n;
    vec3 lit = light_leaf(n, to_viewer, rgba.rgb, uv_occlusion.z, leaf.y, sun_open);
    out_color = vec4(light_air(frame_distance(local), lit), 1.0);
    out_id = id;
    out_normal = vec4(n, 0.0);
}
