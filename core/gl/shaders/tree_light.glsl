// tree_light.glsl - sunlight that arrives at a tree, on its grid of 2 columns (in depth) and 4 rows. TWIN: sv_tree_light_at (core/tree/shade.c).

// at: column and row coordinate (struct sv_tree_light_axes); first, second: the columns' shares, from the lowest row up.
float tree_light(vec2 at, vec4 first, vec4 second)
{
    vec4 near = max(1.0 - abs(clamp(at.y, 0.0, 3.0) - vec4(0.0, 1.0, 2.0, 3.0)), 0.0);
    return mix(dot(near, first), dot(near, second), clamp(at.x, 0.0, 1.0));
}

// What a crown's mean openness (sv_tree_vertex.open) is multiplied by where shadows are cast. TWIN: sv_tree_crown_light (shade.c).
float tree_crown(vec3 to_viewer)
{
    float z2 = to_sun.z * to_sun.z, facing = dot(to_viewer, to_sun.xyz);
    return (0.97 - 0.28 * z2 * z2 * z2) * (1.0 + 0.32 * exp((facing - 1.0) * 12.5));
}
