// object_mesh.frag - an object's polygons: alpha test and light as the ray-cast truth has them, in the shadow that the
// object throws on itself and below the height that the terrain shades.
#include "light.glsl"

layout(location = 8) uniform vec4 base_color;
layout(location = 9) uniform float alpha_cutoff;
layout(location = 10) uniform uint object_id;
layout(location = 11) uniform float shade_z; // no sun below it; eye-relative, m
layout(location = 12) uniform float bias;    // heights
layout(location = 13) uniform float left;    // share of sunlight that trees leave
layout(binding = 0) uniform sampler2D albedo;
layout(binding = 1) uniform sampler2D sun_first; // depth along the light at which the object begins; infinity: nothing

in vec3 local;
in vec3 normal;
in vec3 uv_occlusion;
in vec3 in_sun_map;

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;

float lit(ivec2 at, ivec2 size, float depth)
{
    return any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size)) || texelFetch(sun_first, at, 0).r >= depth ? 1.0 : 0.0;
}

// TWIN of sv_object_sun_seen: four comparisons, bilinear between.
float sun_seen(vec3 p, float back)
{
    ivec2 size = textureSize(sun_first, 0);
    vec2 at = p.xy - 0.5, low = floor(at), t = at - low;
    ivec2 i = ivec2(low);
    float depth = p.z - back;
    float top = mix(lit(i, size, depth), lit(i + ivec2(1, 0), size, depth), t.x);
    float bottom = mix(lit(i + ivec2(0, 1), size, depth), lit(i + ivec2(1, 1), size, depth), t.x);
    return mix(top, bottom, t.y);
}

void main()
{
#ifdef MASKED
    vec4 rgba = textureLod(albedo, uv_occlusion.xy, 0.0) * base_color;
    if (rgba.a < alpha_cutoff)
        discard;
#else
    vec4 rgba = texture(albedo, uv_occlusion.xy, -1.0) * base_color; // a level sharper: levels blur what is seen at a slant, and atlases run together
#endif
    vec3 to_viewer = frame_to_viewer(local);
    vec3 n = normalize(normal);
    n = dot(n, to_viewer) < 0.0 ? -n : n;
    float visible = 0.0, cosine = dot(n, to_sun.xyz);
    if (cosine > 0.0) { // the surface's own slope, in the map, over the texels that the lookup spans
        float slope = min(sqrt(1.0 - cosine * cosine) / cosine, 8.0);
        visible = sun_seen(in_sun_map, bias * (1.0 + 1.5 * slope));
        visible *= local.z < shade_z ? 0.0 : left;
    }
    vec3 lit_rgb = light_surface(n, rgba.rgb, uv_occlusion.z, visible);
    out_color = vec4(light_air(frame_distance(local), lit_rgb), 1.0);
    out_id = object_id;
    out_normal = vec4(n, 0.0);
}
