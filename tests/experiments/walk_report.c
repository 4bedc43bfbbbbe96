/* walk_report.c - what walkthrough.c tells, in words, rows and plots. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/experiments/forest_kit.h"
#include "tests/experiments/plot.h"
#include "tests/experiments/walkthrough.h"

const char *const WALK_FORM_NAMES[FORMS] = {"on", "auto", "paper", "off", "raycast", "four"};

static double percentile(enum form form, int count, bool cpu, double share)
{
    double sorted[FRAMES_MAX];
    for (int k = 0; k < count; k++)
        sorted[k] = cpu ? records[form][k].cpu_ms : records[form][k].ms;
    forest_median(sorted, count);
    return share == 0.5 ? forest_median(sorted, count) : sorted[(int)fmin(share * count, count - 1)];
}

double walk_frames_per_s(const struct setup *setup, enum form form)
{
    return setup->workers * 1000 / percentile(form, setup->frames, false, 0.5);
}

static void tell_cells(const struct setup *setup, enum form form)
{
    double holes = 0, worst = 0, left = 0;
    uint32_t drawn = 0, built = 0, frames_built = 0;
    for (int k = 0; k < setup->frames; k++) {
        const struct record *r = &records[form][k];
        drawn += r->cells;
        built += r->cell.built;
        frames_built += r->cell.built > 0;
        holes += r->holes;
        worst = fmax(worst, r->holes);
        left = fmax(left, r->holes_left);
    }
    if (drawn > 0)
        printf("       %u of %d frames from cells; %u panels built in %u frames; holes before filling %.4f "
               "%% of the "
               "picture (worst %.4f %%), after %.4f %%\n",
               drawn, setup->frames, built, frames_built, 100 * holes / drawn, 100 * worst, 100 * left);
}

struct walk_turn walk_worst_turn(const struct setup *setup, enum form form)
{
    struct walk_turn worst = {0};
    for (int k = 0; k < setup->frames; k++)
        walk_turn_join(&worst, &records[form][k].turn);
    return worst;
}

static void tell_turn(const struct setup *setup, enum form form)
{
    struct walk_turn worst = walk_worst_turn(setup, form);
    if (worst.tiles > 0)
        printf("       turned by %g degrees, tiles of %d px: tone off by %.2f in the mean, %.2f at most "
               "(frame %d, x %d y "
               "%d); change at most %.2f\n",
               WALK_TURN_DEG * setup->workers, WALK_TURN_TILE, worst.tones / worst.tiles, worst.tone,
               worst.frame, worst.x, worst.y, worst.change);
}

void walk_tell(const struct setup *setup, enum form form)
{
    double sum[3] = {0};
    int compared = 0;
    for (int k = 0; k < setup->frames; k++) {
        const struct record *r = &records[form][k];
        compared += r->compared;
        sum[0] += r->mean_abs;
        sum[1] += r->ssim;
        sum[2] += r->gradient;
    }
    printf("%6u %-6s %-7s ms: median %8.2f  99 %% %8.2f (%.1f frames/s)   processor ms: median %8.2f  99 %% "
           "%8.2f",
           setup->trees, WALK_PATH_NAMES[setup->path], WALK_FORM_NAMES[form],
           percentile(form, setup->frames, false, 0.5), percentile(form, setup->frames, false, 0.99),
           walk_frames_per_s(setup, form), percentile(form, setup->frames, true, 0.5),
           percentile(form, setup->frames, true, 0.99));
    if (compared > 0)
        printf("   mean abs %.3f  SSIM %.4f  gradient %.3f", sum[0] / compared, sum[1] / compared,
               sum[2] / compared);
    printf("\n");
    tell_cells(setup, form);
    tell_turn(setup, form);
    for (int w = 1; w < setup->workers; w++)
        walk_parts_join(sums[0][form], sums[w][form]);
    walk_parts_tell(WALK_FORM_NAMES[form], sums[0][form]);
}

void walk_write_rows(const struct setup *setup, FILE *csv)
{
    for (int k = 0; k < setup->frames; k++)
        for (int form = 0; form < FORMS; form++) {
            const struct record *r = &records[form][k];
            if (!setup->forms[form])
                continue;
            fprintf(csv, "%u,%s,%d,%s,%.3f,%.3f,%ld,%ld,%.3f,%.3f,%.3f,%.3f,%u,%u,%.6f,%.6f,%.4f,%.5f,%.4f\n",
                    setup->trees, WALK_PATH_NAMES[setup->path], k, WALK_FORM_NAMES[form], r->ms, r->cpu_ms,
                    r->faults, r->preempted, r->stage_ms[SV_STAGE_CELL], r->stage_ms[SV_STAGE_WARP],
                    r->stage_ms[SV_STAGE_NEAR], r->stage_ms[SV_STAGE_COMPOSITE], r->cell.hits, r->cell.built,
                    r->holes, r->holes_left, r->mean_abs, r->ssim, r->gradient);
        }
}

/* Milliseconds over frames, of the count at hand. */
void walk_plot_frames(const struct setup *setup)
{
    static double x[FRAMES_MAX], y[FORMS][FRAMES_MAX];
    struct plot_line lines[FORMS];
    char path[512], title[128];
    int n = 0;
    for (int k = 0; k < setup->frames; k++)
        x[k] = k;
    for (int form = 0; form < FORMS; form++) {
        for (int k = 0; k < setup->frames; k++)
            y[form][k] = records[form][k].ms;
        if (setup->forms[form])
            lines[n++] = (struct plot_line){WALK_FORM_NAMES[form], x, y[form], setup->frames, false};
    }
    snprintf(title, sizeof title, "%s, %u trees, %d x %d, %d workers", WALK_PATH_NAMES[setup->path],
             setup->trees, setup->width, setup->height, setup->workers);
    snprintf(path, sizeof path, "%s/%u-%s.svg", setup->folder, setup->trees, WALK_PATH_NAMES[setup->path]);
    if (!plot_write(path, &(struct plot_axes){title, "frame", "ms", false, true}, lines, n))
        perror(path);
}

void walk_plot_counts(const struct setup *setup, double rate[FORMS][COUNTS_MAX])
{
    struct plot_line lines[FORMS];
    double x[COUNTS_MAX];
    char path[512];
    int n = 0;
    for (int k = 0; k < setup->count_count; k++)
        x[k] = setup->counts[k];
    for (int form = 0; form < FORMS; form++)
        if (setup->forms[form])
            lines[n++] = (struct plot_line){WALK_FORM_NAMES[form], x, rate[form], setup->count_count, false};
    snprintf(path, sizeof path, "%s/%s.svg", setup->folder, WALK_PATH_NAMES[setup->path]);
    if (!plot_write(
            path, &(struct plot_axes){"Frames a second by number of trees", "trees", "frames/s", true, true},
            lines, n))
        perror(path);
}
