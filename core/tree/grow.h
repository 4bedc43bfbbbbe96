/* grow.h - a procedural tree: five habits, deterministic on every machine from (habit, leaves, seed). */
#ifndef SV_TREE_GROW_H
#define SV_TREE_GROW_H

#include "core/tree/mesh.h"

#define SV_HABIT_LIST(X)                                                                                     \
    X(SV_HABIT_BROADLEAF, "broadleaf")                                                                       \
    X(SV_HABIT_CONIFER, "conifer")                                                                           \
    X(SV_HABIT_POPLAR, "poplar")                                                                             \
    X(SV_HABIT_SHRUB, "shrub")                                                                               \
    X(SV_HABIT_PALM, "palm")

enum sv_habit {
#define X(name, text) name,
    SV_HABIT_LIST(X)
#undef X
        SV_HABIT_COUNT
};

enum { SV_GROW_LEAVES_MAX = 1000000 };

/* Version of the builder: part of cache keys; raise it whenever the output changes. */
#define SV_GROW_VERSION 1

const char *sv_habit_name(enum sv_habit habit);
/* Grows a heap mesh with exactly `leaves` leaves (0 .. SV_GROW_LEAVES_MAX; 0 is a bare tree). SV_EINVAL, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_grow(enum sv_habit habit, uint32_t leaves, uint64_t seed, struct sv_tree_mesh *mesh,
                                          struct sv_error *error);

#endif
