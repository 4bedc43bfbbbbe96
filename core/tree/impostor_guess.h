/* impostor_guess.h - what the shading of impostors guesses of mean |n.l|, averaged over the directions of
 * light, so that a frame's guess can be held to its truth (sv_impostor_gain). Private to core/tree. */
#ifndef SV_TREE_IMPOSTOR_GUESS_H
#define SV_TREE_IMPOSTOR_GUESS_H

enum { SV_GUESS_LENGTHS = 64 };

/* The guess by c, the cosine between mean normal and light, as even + square c^2, for each length. */
struct sv_guess_table {
    float even[SV_GUESS_LENGTHS + 1], square[SV_GUESS_LENGTHS + 1];
};

void sv_guess_table_make(struct sv_guess_table *table);
/* Twin of tree_leaf.glsl's leaf_sun (gain 1): sunlight on leaves of mean normal m, turned to the viewer, of
 * translucency t; l unit. */
float sv_guess_leaf_sun(const float m[3], const float l[3], float t);
/* Adds weight times the guess for a mean normal m to the form sum: xx, yy, zz, xy, xz, yz. */
void sv_guess_add(const struct sv_guess_table *table, float weight, const float m[3], float sum[6]);

#endif
