// tree_quad.frag - the soft colour of a far tree: premultiplied, lit from the mean of normals that a texel holds.
#include "light.glsl"
#include "tree_quad.glsl"

layout(binding = 0) uniform sampler2DArray albedo;
layout(binding = 1) uniform sampler2DArray normals;

in vec2 st;
in float distance_m;
flat in vec4 frame_at;
flat in vec4 sun_at;
flat in vec4 up_at;

layout(location = 0) out vec4 out_color;

// Mean over a texel's leaves of light.h's leaf term (n.l >= 0 ? n.l : t * -n.l), from m, the mean of their unit normals (own
// derivation). With A = mean |n.l| it is ((1 + t) A + (1 - t) m.l) / 2. A is taken from second moments that agree with m at
// both ends: |m| = 1, one normal: A = |m.l|; |m| = 2/3, leaves of all directions as they show themselves (density n.v): moments
// 1/2 along m, 1/4 across.
float leaf_sun(vec3 m, vec3 l, float t)
{
    float rho2 = clamp(dot(m, m), 1e-6, 1.0), rho = sqrt(rho2), along = dot(m, l);
    float across = 0.75 * (1.0 - rho);
    float second = across + (1.0 - 3.0 * across) * along * along / rho2;
    float mean = sqrt(max(second, 0.0)) * (1.0 - 0.36 * (1.0 - rho));
    return 0.5 * ((1.0 + t) * mean + (1.0 - t) * along);
}

void main()
{
    vec3 at = vec3(quad_uv(frame_at.xy, st, up_at.w), frame_at.z);
    vec4 rgba = textureLod(albedo, at, frame_at.w) * (quad_border(st, up_at.w) * sun_at.w);
    vec4 g = textureLod(normals, at, frame_at.w);
    vec3 m = g.xyz * 2.0 - 1.0;
    float n_z = dot(m.yz, up_at.xy);
    vec3 lit = light_shade(n_z, leaf_sun(m, sun_at.xyz, up_at.z), rgba.rgb, g.a);
    if (air_rgb.w > 0.0)
        lit = mix(lit, air_rgb.rgb * rgba.a, 1.0 - exp(-distance_m * air_rgb.w));
    out_color = vec4(lit, rgba.a);
}
