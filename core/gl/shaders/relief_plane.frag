// relief_plane.frag - a pre-warped relief texture on its plane: colour as seen, the texel's own depth. Of the four samples
// about a place, the nearest one that holds a surface says which surface it is; those of the same one are mixed.
#include "frame.glsl"

layout(location = 3) uniform vec3 facing;   // world normal when no normals are given
layout(location = 4) uniform vec4 depth_of; // 1 / (c.f), or 1 / (forward.f); cut; 1: normals given
layout(location = 5) uniform uint number;
layout(binding = 0) uniform sampler2D color;
layout(binding = 1) uniform sampler2D displ; // EMPTY: nothing landed
layout(binding = 2) uniform sampler2D normal;

in vec2 st;
layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_id;
layout(location = 2) out vec4 out_normal;

const float EMPTY = 3e38;

vec4 mixed(sampler2D image, ivec2 lo, ivec2 hi, vec4 w)
{
    return texelFetch(image, lo, 0) * w.x + texelFetch(image, ivec2(hi.x, lo.y), 0) * w.y +
           texelFetch(image, ivec2(lo.x, hi.y), 0) * w.z + texelFetch(image, hi, 0) * w.w;
}

void main()
{
    ivec2 last = textureSize(displ, 0) - 1;
    vec2 at = st * vec2(last + 1) - 0.5, f = fract(at);
    ivec2 lo = clamp(ivec2(floor(at)), ivec2(0), last), hi = clamp(ivec2(floor(at)) + 1, ivec2(0), last);
    vec4 d = vec4(texelFetch(displ, lo, 0).r, texelFetch(displ, ivec2(hi.x, lo.y), 0).r,
                  texelFetch(displ, ivec2(lo.x, hi.y), 0).r, texelFetch(displ, hi, 0).r);
    vec4 w = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    w = mix(w, vec4(0.0), greaterThan(abs(d), vec4(0.9 * EMPTY)));
    if (w.x + w.y + w.z + w.w < 0.5)
        discard;
    float most = max(max(w.x, w.y), max(w.z, w.w));
    float own = w.x == most ? d.x : w.y == most ? d.y : w.z == most ? d.z : d.w;
    vec4 off = mix(d - own, vec4(0.0), equal(w, vec4(0.0)));
    bvec4 other = greaterThan(abs(off), vec4(depth_of.y));
    off = mix(off, vec4(0.0), other);
    w = mix(w, vec4(0.0), other);
    w /= w.x + w.y + w.z + w.w;

    float away = (own + dot(w, off)) * depth_of.x;
    // gl_FragCoord.w is 1 / Z of the plane's point; the texel is 1 + away times as far
    float depth = frame_is_orthographic() ? gl_FragCoord.z - away / projection.w
                                          : projection.z * gl_FragCoord.w / (1.0 + away);
    if (!(depth > 0.0 && depth <= 1.0))
        discard;
    gl_FragDepth = depth;
    out_color = vec4(mixed(color, lo, hi, w).rgb, 1.0);
    out_id = number;
    out_normal = vec4(depth_of.z > 0.5 ? mixed(normal, lo, hi, w).xyz : facing, 0.0);
}
