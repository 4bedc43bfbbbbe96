/* admit.h - whether a panel that is not there is worth building: pure logic, no clock, no memory of its own.
 *
 * A frame that finds its panel saves `saving_s` over drawing directly; building costs `build_s`. Both are
 * measured, as exponential means per kind (a ring and layer, say). Known frames to come (a path, a batch)
 * decide at once: build where they save more than it costs. Otherwise a cell must be wanted again within
 * window_s, and as often as the savings missed so far come up to patience times the cost: then it has cost at
 * most 1 + 1 / patience times what knowing the future would (ski rental; Karlin, Manasse, Rudolph, Sleator
 * 1988), and a pose that is never seen again costs nothing.
 *
 * The state has no pointers, so that it may lie in shared memory; whoever is killed while it changes it
 * leaves each number old or new, which misleads one decision and no more. One caller at a time. */
#ifndef SV_CELL_ADMIT_H
#define SV_CELL_ADMIT_H

#include <stdbool.h>
#include <stdint.h>

enum { SV_CELL_ADMIT_KINDS = 32, SV_CELL_ADMIT_SETS = 128, SV_CELL_ADMIT_WAYS = 4 };

struct sv_cell_admit_options {
    double window_s;          /* a cell that was not wanted for that long is forgotten; > 0 */
    double patience;          /* >= 0; 0: the second request always builds what saves anything */
    double build_s, saving_s; /* believed before anything was measured */
};
/* 10 s: longer than a walker (1.4 m/s) or a client that asks once a second needs to come back to a cell. */
#define SV_CELL_ADMIT_OPTIONS_DEFAULT ((struct sv_cell_admit_options){10, 1, 0.1, 0.02})

struct sv_cell_admit {
    struct sv_cell_admit_options options;
    struct {
        double build_s, saving_s;
        uint32_t builds, savings; /* measured, as far as they are counted; what was believed is the first */
    } mean[SV_CELL_ADMIT_KINDS];
    struct {
        uint64_t key; /* 0: empty */
        double last_s;
        uint32_t times;
    } wanted[SV_CELL_ADMIT_SETS][SV_CELL_ADMIT_WAYS];
};

struct sv_cell_admit_request {
    uint64_t key; /* not 0 */
    int kind;     /* 0 .. SV_CELL_ADMIT_KINDS - 1 */
    double now_s;
    double frames; /* known to come that would use it, this one included; 0: unknown */
};

void sv_cell_admit_init(struct sv_cell_admit *admit, const struct sv_cell_admit_options *options);
/* Notes the request and decides. Where nothing is saved it does not build. Each refusal to a cell that is
 * wanted again moves the means 1/256 of the way back to what was believed first: one bad measurement, or a
 * change of load, is not for ever. */
bool sv_cell_admit(struct sv_cell_admit *admit, const struct sv_cell_admit_request *request);
/* One measurement; NaN: that of the two was not measured. A saving may be negative; a cost may not: ignored.
 * The n-th moves its mean by 1 / (n + 1), from the seventh on by 1/8. */
void sv_cell_admit_measured(struct sv_cell_admit *admit, int kind, double build_s, double saving_s);

#endif
