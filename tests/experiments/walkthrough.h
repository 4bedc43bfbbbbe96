/* walkthrough.h - what the files of walkthrough.c share: what is to be measured, and what was. */
#ifndef SV_TESTS_WALKTHROUGH_H
#define SV_TESTS_WALKTHROUGH_H

#include <stdio.h>

#include "core/view/renderer.h"
#include "tests/experiments/walk_parts.h"
#include "tests/experiments/walk_path.h"
#include "tests/experiments/walk_turn.h"

enum form { ON, AUTO, PAPER, OFF, RAYCAST, RAYCAST4, FORMS };
extern const char *const WALK_FORM_NAMES[FORMS];
enum { FRAMES_MAX = 4096, COUNTS_MAX = 16, WORKERS_MAX = 2, WARM_FRAMES = 3, SHEET_COLUMNS = 6 };

struct setup {
    uint32_t trees; /* of the count at hand */
    uint32_t counts[COUNTS_MAX];
    int count_count;
    enum walk_path path;
    int frames, width, height, truth_stride, workers;
    int refine_samples, refine_scale; /* 0: panels stay as built */
    int panel;                        /* texels a side; 0: the scene's */
    enum sv_quality quality;
    bool forms[FORMS], warm, still, parts, apart, shadows_alone;
    const char *folder;
};

/* One frame in one form; workers write them into memory that all share. */
struct record {
    double ms, cpu_ms, stage_ms[SV_STAGE_COUNT];
    long faults, preempted; /* times that a page was mapped, that another process was let run instead */
    double mean_abs, ssim, gradient; /* 0 unless compared */
    double holes, holes_left;        /* shares of the picture, of the ground's warp */
    struct sv_cell_use cell;
    struct walk_turn turn;
    bool compared, cells; /* cells: drawn from them */
};
extern struct record (*records)[FRAMES_MAX];
extern struct walk_sums (*sums)[FORMS][WALK_PARTS]; /* by worker; shared as well */

/* Of the command line; false: it is told how to call. */
bool walk_options(int argc, char **argv, struct setup *setup);

/* Of the count at hand. */
double walk_frames_per_s(const struct setup *setup, enum form form);
struct walk_turn walk_worst_turn(const struct setup *setup, enum form form);
void walk_tell(const struct setup *setup, enum form form);
void walk_write_rows(const struct setup *setup, FILE *csv);
void walk_plot_frames(const struct setup *setup); /* milliseconds over frames */
/* Frames a second over counts. */
void walk_plot_counts(const struct setup *setup, double rate[FORMS][COUNTS_MAX]);

#endif
