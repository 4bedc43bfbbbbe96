// tree_indirect.frag - indirect textures (core/tree/indirect.h): which leaf is here, then the leaf's own texture.
#include "tree_cloud.glsl"

layout(binding = 0) uniform sampler2DArray codes;  // offset of the leaf's middle, turn, kind
layout(binding = 1) uniform sampler2DArray leaves; // a layer a material
layout(binding = 2) uniform sampler2D kinds;       // two texels a kind: half sizes, reach, layer; box of the texture
layout(binding = 3) uniform sampler2DArray base;   // small classical textures: what is left where leaves are smaller than pixels
layout(binding = 4) uniform sampler2DArray normals;
layout(binding = 5) uniform sampler2DArray light;

const float LEAF_SIDE = 256.0; // SV_INDIRECT_LEAF_SIDE

// Colour and coverage of the leaf at a point of the plane, a pixel being that many model units; w: 0 outside. TWIN:
// sv_indirect_leaf_at (core/tree/indirect.c).
vec4 leaf_at(vec2 point, float pixel)
{
    float side = params[1].x;
    vec2 cell = clamp(floor(st.xy * side), 0.0, side - 1.0);
    vec4 code = floor(texelFetch(codes, ivec3(cell, int(st.z + 0.5)), 0) * 255.0 + 0.5);
    vec4 kind = texelFetch(kinds, ivec2(0, int(code.a)), 0), box = texelFetch(kinds, ivec2(1, int(code.a)), 0);
    vec2 texel = half_size * vec2(2.0 * (cell.x + 0.5) / side - 1.0, 1.0 - 2.0 * (cell.y + 0.5) / side);
    vec2 d = point - texel - (code.xy - 128.0) / 127.0 * kind.z;
    float a = code.z * (6.28318531 / 256.0), c = cos(a), n = sin(a);
    vec2 along = vec2(c * d.x + n * d.y, c * d.y - n * d.x) / kind.xy;
    float mirror = fract(kind.w) > 0.25 ? -1.0 : 1.0;
    vec2 uv = mix(box.xy, box.zw, 0.5 + 0.5 * vec2(along.x, -mirror * along.y));
    vec2 texels = (box.zw - box.xy) * LEAF_SIDE * pixel / (2.0 * kind.xy); // of the leaf's texture in a pixel
    vec4 rgba = textureLod(leaves, vec3(uv, floor(kind.w)), log2(max(max(abs(texels.x), abs(texels.y)), 1e-6)) + SHARPER);
    bool inside = code.a > 0.5 && all(lessThanEqual(abs(along), vec2(1.0)));
    rgba.a = inside ? rgba.a : 0.0;
    return rgba;
}

void main()
{
    float pixel = max(length(dFdx(rectangle_at)), length(dFdy(rectangle_at)));
    vec4 leaf = leaf_at(rectangle_at, pixel), soft = texture(base, st, SHARPER);
    float near = smoothstep(params[1].y, params[1].z, params[1].w / pixel); // by the leaves' size in pixels
    vec4 rgba = mix(soft, leaf, near);
    cloud_test(rgba.a, 0.5);
    vec3 rgb = mix(soft.rgb * soft.a, leaf.rgb * leaf.a, near) / max(rgba.a, 1e-4);
    vec4 g = texture(normals, st, SHARPER), o = textureLod(light, st, 0.0);
    float translucency = clamp(dot(rgb, params[0].xyz) + params[0].w, 0.0, 1.0);
    cloud_light(rgb, g.xyz * 2.0 - 1.0, g.a, dot(o.xyz * 2.0 - 1.0, model_sun) + o.a, translucency, rgba.a);
}
