// tree_cloud.glsl - what fragment shaders of billboard clouds share: inputs of tree_cloud.vert, light, all layers.
#include "light.glsl"
#include "tree_leaf.glsl"
#ifdef SHADE
#include "tree_light.glsl"
#endif

layout(location = 5) uniform float leaf_translucency; // mean of the leaves'
layout(location = 8) uniform vec4 params[5]; // struct sv_cloud_textures

in vec3 st;
in vec4 to_viewer;
in vec2 rectangle_at;
flat in vec2 half_size;
flat in vec3 model_sun;
flat in vec2 turn_of;
flat in uint id;
flat in vec3 shift; // core/tree/cloud_light.h: factors on the sun's and the sky's light, lift of the normal
#ifdef PLANE_AXES
flat in vec3 axis_u, axis_v;
#endif
#ifdef SHADE
in vec3 light_at;
flat in vec4 first_light, second_light;
#endif

// SOFT: colour alone, premultiplied, to be blended farthest first. HARD: id and normal (and depth), where a pixel is covered by
// enough. Neither: all of it, by an alpha test.
#ifndef HARD
layout(location = 0) out vec4 out_color;
#endif
#ifndef SOFT
layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;
#endif

// Added to the level of detail: planes stand askew, and a level that is fine enough for their narrow side has the gradient energy
// of the truth; 0 has half of it, -1.2 a third more (tests/experiments/forest_fig4, oak and spruce of 25 to 400 px).
const float SHARPER = -0.7;

// Ends fragments that show nothing in this pass; bar: least coverage of what an alpha test takes.
void cloud_test(float coverage, float bar)
{
#ifdef SOFT
    if (coverage < 1.0 / 128.0)
        discard;
#else
    if (coverage < bar)
        discard;
#endif
}

// m: mean of the unit normals of what a texel shows, model axes, either side of it; open: share of sunlight that the crown lets
// through. light.h's leaf rule (tree_mesh.frag), on the mean where m is shorter than 1.
void cloud_light(vec3 albedo_rgb, vec3 m, float occlusion, float open, float translucency, float coverage)
{
    m = dot(m, to_viewer.xyz) < 0.0 ? -m : m;
#ifndef HARD
    float sun_open = clamp(open, 0.0, 1.0);
#ifdef SHADE
    sun_open = min(sun_open * light_at.z, 1.0) * tree_light(light_at.xy, first_light, second_light);
#endif
    float leaf = leaf_translucency > 0.0 ? clamp(translucency / leaf_translucency, 0.0, 1.0) : 1.0;
    float sun = leaf_sun(m, model_sun, translucency, 1.0) * mix(1.0, shift.x, leaf) * sun_open;
    vec3 lit = light_shade(clamp(m.z + shift.z * leaf, -1.0, 1.0), sun, albedo_rgb,
                           min(occlusion * mix(1.0, shift.y, leaf), 1.0));
    out_color = vec4(light_air(to_viewer.w, lit), 1.0);
#endif
#ifdef SOFT
    out_color *= coverage;
#else
    out_id = id;
    vec3 n = m * inversesqrt(max(dot(m, m), 1e-12));
    out_normal = vec4(turn_of.x * n.x + turn_of.y * n.y, turn_of.x * n.y - turn_of.y * n.x, n.z, 0.0);
#endif
}
