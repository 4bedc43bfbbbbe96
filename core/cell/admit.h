/* admit.h - which rings of panels a picture is drawn from, and whether panels that are not there are worth
 * building: pure logic, no clock, no memory of its own.
 *
 * Rings nest, and trees that no ring shows are drawn directly: so a picture can be drawn from the k outermost
 * rings alone. That is level k; level 0 is drawn directly. The ground belongs to the ring that its panels are
 * as near as. The nearer a ring, the sooner an eye that moves leaves its cell: from far rings a fast flight
 * has something when near ones are not worth building, a walk has all of them.
 *
 * What a picture of some size takes from each level is measured, as exponential means; so are the costs of
 * panels, a mean for each ring. Of levels whose panels are there the one is taken that takes least. A deeper
 * one is built when the cell of its nearest ring is wanted again within window_s, and as often as what it
 * would have saved since comes up to patience times what building costs now: then it has cost at most 1 + 1 /
 * patience times what knowing the future would (ski rental; Karlin, Manasse, Rudolph, Sleator 1988), and a
 * pose that is never seen again costs nothing. An eye that leaves each cell soon after it was built would pay
 * that much again and again: so what each ring has cost and has saved is kept, too, and one that did not pay
 * so far is asked for as much more patience, up to SV_CELL_ADMIT_WARY times. Own derivation.
 *
 * The state has no pointers, so that it may lie in shared memory; whoever is killed while it changes it
 * leaves each number old or new, which misleads one decision and no more. One caller at a time. */
#ifndef SV_CELL_ADMIT_H
#define SV_CELL_ADMIT_H

#include <stdbool.h>
#include <stdint.h>

#include "core/cell/lattice.h"

enum { SV_CELL_ADMIT_SIZES = 32, SV_CELL_ADMIT_SETS = 512, SV_CELL_ADMIT_WAYS = 4, SV_CELL_ADMIT_WARY = 4 };

struct sv_cell_admit_options {
    double window_s; /* a cell that was not wanted for that long is forgotten; > 0 */
    double patience; /* >= 0; 0: the second request always builds what saves anything */
    /* Believed before anything was measured: what a panel of 1024 x 1024 costs, and the share of the time of
     * direct drawing that a picture from all rings saves (from the k outermost of n: k / n of that). */
    double build_s, share;
    uint32_t direct; /* pictures that must have been drawn directly before anything is built */
};
/* 10 s: longer than a walker (1.4 m/s) or a client that asks once a second needs to come back to a cell. What
 * is believed is good for building (full panels take 0.02 to 0.2 s): what is never tried is never known. */
#define SV_CELL_ADMIT_OPTIONS_DEFAULT ((struct sv_cell_admit_options){10, 1, 0.01, 0.8, 4})

struct sv_cell_admit_mean {
    double value;
    uint32_t count; /* measured, as far as it is counted; 0: nothing */
};
struct sv_cell_admit {
    struct sv_cell_admit_options options;
    struct sv_cell_admit_mean picture_s[SV_CELL_ADMIT_SIZES]
                                       [SV_CELL_RINGS_MAX + 1]; /* of 2^n pixels, from level k */
    struct sv_cell_admit_mean
        crowns_s[SV_CELL_RINGS_MAX]; /* [k - 1]: a panel of the k-th ring, outermost first */
    struct sv_cell_admit_mean ground_s[SV_CELL_RINGS_MAX];
    double paid_s[SV_CELL_RINGS_MAX],
        earned_s[SV_CELL_RINGS_MAX]; /* by the k-th ring; older ones count less */
    struct {
        uint64_t key; /* 0: empty */
        double last_s;
        uint32_t times;
    } wanted[SV_CELL_ADMIT_SETS][SV_CELL_ADMIT_WAYS];
};

/* A picture. Rings outermost first. */
struct sv_cell_admit_request {
    double now_s;
    int64_t pixels;
    int rings; /* 0 .. SV_CELL_RINGS_MAX */
    struct {
        uint64_t key; /* of its cell, not 0 */
        /* What is missing of its panels, in panels of 1024 x 1024. */
        double crowns, ground;
    } ring[SV_CELL_RINGS_MAX];
};
struct sv_cell_admit_answer {
    int level;  /* to draw from; 0: directly */
    bool build; /* what is missing of it is to be built; else nothing is */
};

void sv_cell_admit_init(struct sv_cell_admit *admit, const struct sv_cell_admit_options *options);
/* Notes what is wanted and not there, and decides. Each refusal to a cell that is wanted again, or to draw
 * from panels that are there, moves what the level takes, costs and has cost 1/256 of the way back to what
 * was believed first; each picture from a level moves that of direct drawing as much towards its own: one bad
 * measurement, or a change of load, is not for ever. */
struct sv_cell_admit_answer sv_cell_admit(struct sv_cell_admit *admit,
                                          const struct sv_cell_admit_request *request);

/* Measurements; those that are not positive and finite are ignored. The first four make the least of them the
 * mean (the first pictures of a process, and from new panels, wait for memory), and are believed then; from
 * then on each moves it by 1/8. A picture from that level, 0: directly; without the time of building. */
void sv_cell_admit_drawn(struct sv_cell_admit *admit, int64_t pixels, int level, double seconds);
/* `panels` (in panels of 1024 x 1024) of ring k, outermost: 1, that were built. */
void sv_cell_admit_built(struct sv_cell_admit *admit, int k, bool ground, double panels, double seconds);

#endif
