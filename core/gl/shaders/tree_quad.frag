// tree_quad.frag - the soft colour of a far tree: premultiplied, lit from the mean of normals that a texel holds.
#include "light.glsl"
#include "tree_leaf.glsl"
#include "tree_quad.glsl"
#ifdef SHADE
#include "tree_light.glsl"
#endif

layout(binding = 0) uniform sampler2DArray albedo;
layout(binding = 1) uniform sampler2DArray normals;
layout(binding = 2) uniform sampler2DArray open; // mean openness to the sun: slope along the model's axes, and mean

in vec2 st;
in float distance_m;
flat in vec4 frame_at;
flat in vec4 sun_at;
flat in vec4 up_at;
flat in vec4 leaf_at;
flat in vec3 model_sun;
#ifdef SHADE
in vec2 light_at;
flat in vec4 first_light;
flat in vec4 second_light;
#endif

layout(location = 0) out vec4 out_color;

void main()
{
    vec3 at = vec3(quad_uv(frame_at.xy, st, up_at.z), frame_at.z);
    vec4 rgba = textureLod(albedo, at, frame_at.w) * (quad_border(st, up_at.z) * sun_at.w);
    vec3 albedo_rgb = rgba.rgb / max(rgba.a, 1e-4); // straight: the tone curve is not linear
    vec4 g = textureLod(normals, at, frame_at.w);
    vec3 m = g.xyz * 2.0 - 1.0;
    float t = clamp(dot(albedo_rgb, leaf_at.xyz) + leaf_at.w, -0.3, 1.0);
    vec4 o = textureLod(open, at, frame_at.w);
    float visible = clamp(dot(o.xyz * 2.0 - 1.0, model_sun) + o.a, 0.0, 1.0);
#ifdef SHADE
    visible *= tree_light(light_at, first_light, second_light);
#endif
    float n_z = dot(m.yz, up_at.xy);
    vec3 lit = light_shade(n_z, leaf_sun(m, sun_at.xyz, t, up_at.w) * visible, albedo_rgb, g.a) * rgba.a;
    if (air_rgb.w > 0.0)
        lit = mix(lit, air_rgb.rgb * rgba.a, 1.0 - exp(-distance_m * air_rgb.w));
    out_color = vec4(lit, rgba.a);
}
