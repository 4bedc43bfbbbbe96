// tree_quad.frag - the soft colour of a far tree: premultiplied, lit from the mean of normals that a texel holds.
#include "light.glsl"
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

// Mean over a texel's leaves of light.h's leaf term (n.l >= 0 ? n.l : t * -n.l), from m, the mean of their unit normals (own
// derivation). With A = mean |n.l| it is ((1 + t) A + (1 - t) m.l) / 2, exactly. A is guessed from m: one normal (|m| = 1) has
// A = |m.l|; leaves of all directions as they show themselves (density n.v, |m| = 2/3) have second moments of 1/2 along m
// and 1/4 across. The three numbers were fitted to random sets of 2 to 32 such leaves (2 % rms, 3.5 % at worst); leaves that prefer
// directions are met by gain, the ratio of true and guessed A over the whole frame. TWIN: guess() in core/tree/impostor.c.
float leaf_sun(vec3 m, vec3 l, float t, float gain)
{
    float rho2 = clamp(dot(m, m), 1e-6, 1.0), loose = 1.0 - sqrt(rho2), along = dot(m, l);
    float c2 = min(along * along / rho2, 1.0);
    float across = min(0.8 * loose, 0.5);
    float mean = sqrt(max(across + (1.0 - 3.0 * across) * c2, 0.0)) * (1.0 - loose * (0.56 - 0.4 * c2));
    return max(0.0, 0.5 * ((1.0 + t) * mean * gain + (1.0 - t) * along));
}

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
