// relief_object.frag - what core/relief/draw_object_relief.c has warped, laid over the picture by depth. Colours are lit, toned
// and sRGB-coded there; the air between is put in here.
#include "light.glsl"

layout(binding = 0) uniform sampler2D warped_color;
layout(binding = 1) uniform sampler2D warped_depth; // as GL would write it; 0: nothing
#ifdef LAYERS
layout(binding = 2) uniform usampler2D warped_id;
layout(binding = 3) uniform sampler2D warped_normal;
#endif

layout(location = 0) out vec4 out_color;
#ifdef LAYERS
layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;
#endif

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(warped_depth, at, 0).r;
    if (depth <= 0.0)
        discard;
    vec3 ray = frame_ray(gl_FragCoord.xy);
    // depth = near / Z in perspective, (far - Z) / far in orthographic views
    float distance_m = frame_is_orthographic() ? projection.w * (1.0 - depth) : projection.z / depth * length(ray);
    gl_FragDepth = depth;
    out_color = vec4(light_air(distance_m, texelFetch(warped_color, at, 0).rgb), 1.0);
#ifdef LAYERS
    out_id = texelFetch(warped_id, at, 0).r;
    out_normal = vec4(texelFetch(warped_normal, at, 0).xyz, 0.0);
#endif
}
