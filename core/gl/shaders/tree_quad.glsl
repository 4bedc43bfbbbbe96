// tree_quad.glsl - where in the atlas a fragment of a far tree reads, and the empty border around its frame.

const float CELLS = 8.0; // SV_IMPOSTOR_GRID

// Atlas position of cell coordinates st in a frame; kept half a texel off the frame's edge, so that no neighbour is mixed in.
vec2 quad_uv(vec2 corner, vec2 st, float texels)
{
    return corner + clamp(st, 0.5 / texels, 1.0 - 0.5 / texels) / CELLS;
}

// What bilinear filtering leaves of coverage at the frame's edge, had the frame an empty border.
float quad_border(vec2 st, float texels)
{
    vec2 e = clamp(min(st, 1.0 - st) * texels + 0.5, 0.0, 1.0);
    return e.x * e.y;
}
