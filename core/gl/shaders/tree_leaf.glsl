// tree_leaf.glsl - sunlight on leaves that a texel holds the mean normal of.

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
