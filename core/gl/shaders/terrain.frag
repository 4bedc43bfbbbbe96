// terrain.frag - the ground: albedo, detail, light. CPU twin: core/truth/terrain_shade.c with core/scene/light.c.
#include "light.glsl"
#include "detail.glsl"

layout(binding = 0) uniform sampler2D albedo_map;
layout(binding = 1) uniform sampler2D normal_map; // (x, y) * 127 + 128 at samples
layout(binding = 2) uniform sampler2D detail_map;
layout(location = 0) uniform vec4 albedo_uv; // scale, offset from local x, y
layout(location = 1) uniform vec4 normal_uv;
layout(location = 2) uniform float texel_m;
layout(location = 3) uniform uint id_terrain;
layout(location = 4) uniform vec2 detail_eye[3]; // the eye's place in the detail's tile at its scales
#ifdef SHADOWS
layout(binding = 3) uniform sampler2DArray shadow_map; // share of sunlight, core/terrain/draw_shadow.h
// local x, y -> -0.5 .. 0.5: offset, scale; layer; coarsest first, what there is less of is never inside
layout(location = 7) uniform vec4 shadow_window[SHADOW_WINDOWS];

// Share of sunlight at the local place q, from the finest window that holds it with texels of 0.4 pixels or more:
// coarser windows are the mip levels of finer ones. The loop is of known length, so that llvmpipe unrolls it (an index
// that it does not know costs it a gather a pixel).
float shadow_light(vec2 q, float pixel)
{
    vec4 at = shadow_window[0];
    float finest = 1.0 / (0.4 * SHADOW_SIDE * pixel);
    for (int k = 1; k < SHADOW_WINDOWS; k++) {
        vec4 w = shadow_window[k];
        vec2 away = abs(q * w.z + w.xy);
        at = max(max(away.x, away.y) - 0.498, w.z - finest) < 0.0 ? w : at;
    }
    return textureLod(shadow_map, vec3(q * at.z + at.xy + 0.5, at.w), 0.0).r;
}
#endif

in vec3 p;
layout(location = 0) out vec4 color;
layout(location = 1) out uint id;
layout(location = 2) out vec4 normal;

void main()
{
    vec2 xy = texture(normal_map, p.xy * normal_uv.xy + normal_uv.zw).rg * (255.0 / 127.0) - 128.0 / 127.0;
    vec3 n = normalize(vec3(xy, sqrt(max(0.0, 1.0 - dot(xy, xy)))));
    vec3 albedo = texture(albedo_map, p.xy * albedo_uv.xy + albedo_uv.zw).rgb;
    float depth = dot(p, camera_forward.xyz);
    float pixel_m = (frame_is_orthographic() ? 1.0 : depth) / projection.y;
    float n_dot_v = dot(n, frame_to_viewer(p));
    albedo = detail_apply(detail_map, detail_at(p.xy, detail_eye), pixel_m, n_dot_v, texel_m, albedo);
#ifdef SHADOWS
    float visible = shadow_light(p.xy, pixel_m * inversesqrt(clamp(n_dot_v, 0.04, 1.0)));
#else
    float visible = 1.0;
#endif
    color = vec4(light_air(frame_distance(p), light_surface(n, albedo, 1.0, visible)), 1.0);
    id = id_terrain;
    normal = vec4(n, 0.0);
}
