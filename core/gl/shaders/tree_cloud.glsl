// tree_cloud.glsl - what fragment shaders of billboard clouds share: inputs of tree_cloud.vert, light, all layers.
#include "light.glsl"
#include "tree_leaf.glsl"
#ifdef SHADE
#include "tree_light.glsl"
#endif

layout(location = 8) uniform vec4 params[4]; // struct sv_cloud_textures

in vec3 st;
in vec4 to_viewer;
in vec2 rectangle_at;
flat in vec2 half_size;
flat in vec3 model_sun;
flat in vec2 turn_of;
flat in uint id;
#ifdef PLANE_AXES
flat in vec3 axis_u, axis_v;
#endif
#ifdef SHADE
in vec3 light_at;
flat in vec4 first_light, second_light;
#endif

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;

// m: mean of the unit normals of what a texel shows, model axes, either side of it; open: share of sunlight that the crown lets
// through. light.h's leaf rule (tree_mesh.frag), on the mean where m is shorter than 1.
void cloud_light(vec3 albedo_rgb, vec3 m, float occlusion, float open, float translucency)
{
    m = dot(m, to_viewer.xyz) < 0.0 ? -m : m;
    float sun_open = clamp(open, 0.0, 1.0);
#ifdef SHADE
    sun_open = min(sun_open * light_at.z, 1.0) * tree_light(light_at.xy, first_light, second_light);
#endif
    vec3 lit = light_shade(m.z, leaf_sun(m, model_sun, translucency, 1.0) * sun_open, albedo_rgb, occlusion);
    out_color = vec4(light_air(to_viewer.w, lit), 1.0);
    out_id = id;
    vec3 n = m * inversesqrt(max(dot(m, m), 1e-12));
    out_normal = vec4(turn_of.x * n.x + turn_of.y * n.y, turn_of.x * n.y - turn_of.y * n.x, n.z, 0.0);
}
