/* least_squares.h - small normal equations, for the bakes: planes through depths, rules for colours. Private
 * to core/tree. */
#ifndef SV_TREE_LEAST_SQUARES_H
#define SV_TREE_LEAST_SQUARES_H

#include <stdbool.h>

enum { SV_UNKNOWNS_MAX = 4 };

/* Adds weight times the equation row . unknowns = value to the normal equations of n unknowns. */
void sv_least_squares_add(double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1], int n, const double *row,
                          double value, double weight);
/* Solves by elimination with pivots, in place; false when they are singular. */
bool sv_least_squares_solve(int n, double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1],
                            double out[SV_UNKNOWNS_MAX]);
/* Translucency of what shows a linear colour, from equations (r, g, b, 1) . x = translucency: bark and leaves
 * differ in colour, and a linear rule goes through all filtering unharmed. Where colour tells nothing it is
 * the mean. To be held in 0..1 by who applies it. */
void sv_translucency_rule(double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1], float rule[4]);

#endif
