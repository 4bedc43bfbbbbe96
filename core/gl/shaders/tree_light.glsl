// tree_light.glsl - sunlight that arrives at a tree, on its grid of 2 columns and 4 rows. TWIN: sv_tree_light_at (core/tree/shade.c).

// at: column and row coordinate (struct sv_tree_light_axes); first, second: the columns' shares, from the lowest row up.
float tree_light(vec2 at, vec4 first, vec4 second)
{
    vec4 near = max(1.0 - abs(clamp(at.y, 0.0, 3.0) - vec4(0.0, 1.0, 2.0, 3.0)), 0.0);
    return mix(dot(near, first), dot(near, second), clamp(at.x, 0.0, 1.0));
}
