/* forest_kit.h - the forest that the papers' forest tables are measured on: 1 km x 1 km, the five demo species
 * at random, fixed seeds, eyes of two kinds; and what an experiment needs around it: scenes, drawing, truths
 * that are kept on disk, one row of errors. Exits with a message on any failure. */
#ifndef SV_TESTS_FOREST_KIT_H
#define SV_TESTS_FOREST_KIT_H

#include "core/base/store.h"
#include "core/view/compare.h"
#include "core/view/renderer.h"
#include "server/cells_memory.h"

enum forest_eye { FOREST_OVERVIEW, FOREST_WALK };
enum { FOREST_SIDE_M = 1000, FOREST_SPECIES = 5 };

struct forest {
    struct sv_store *store; /* folder SILVISTA_CACHE_DIR, or none */
    struct sv_scene *scene;
    struct sv_renderer *renderer;
    struct sv_cells_memory cells; /* panels; cells.cache is NULL where there are none (forest_use_cells) */
};

/* Forests opened from now on draw from cells where a request has relief=on, with a cache of that many bytes (shared
 * with what is forked later); 0: they do not. */
void forest_use_cells(size_t bytes);

/* count trees; truth: the ray-cast structures are built, too. */
void forest_open(uint32_t count, bool truth, struct forest *forest);
/* Another scene, of a file (scene_file.h), in place of that forest. */
void forest_open_file(const char *path, bool truth, struct forest *forest);
void forest_close(struct forest *forest);

/* Eye number k of a kind, as a request of the wire contract's defaults (color, 512 x 512 unless changed):
 * overview 30 to 60 m above the ground, looking over the forest (paper 2, figure 6); walk 1.7 m above it,
 * among the trees, never inside of a stem. Same eyes for every count. */
struct sv_view_request forest_request(const struct forest *forest, enum forest_eye kind, int k);

/* Draws into fresh images; encoding left out; ms and cpu_ms (may be NULL): by the
 * wall's clock and by the processor's, which others on the machine disturb less. */
void forest_draw(const struct forest *forest, const struct sv_view_request *request, struct sv_picture *picture,
                 struct sv_draw_stats *stats, double *ms, double *cpu_ms);
/* Draws the panels that the request (relief=on, drawn before) is drawn from again from the truth
 * (cells_refine.h); how many; cpu_ms may be NULL. */
uint32_t forest_refine(const struct forest *forest, const struct sv_view_request *request, int samples,
                       int scale, bool shadows_alone, double *cpu_ms);
/* Of the last forest_draw, ms; negative: the stage did not run. */
double forest_stage_ms(enum sv_stage stage);
/* The colour of 64 samples a pixel, ray cast; kept in the store by scene, camera and sun. */
void forest_truth(const struct forest *forest, const struct sv_view_request *request, struct sv_image *color);
/* The same of 1, 4, 16 or 64 samples: each count has positions of its own (camera.h). */
void forest_truth_of(const struct forest *forest, const struct sv_view_request *request, int samples,
                     struct sv_image *color);
/* Errors of a colour picture against a truth. */
struct sv_compare_result forest_compare(const struct sv_image *picture, const struct sv_image *truth);
/* Whether an eye at (x, y) is farther than clear_m from every stem. */
bool forest_is_free(const struct forest *forest, double x, double y, double clear_m);
/* Writes a colour picture as a PNG. */
void forest_save(const struct sv_image *image, const char *path);

double forest_now_ms(void);
/* Sorts; the middle one (of 0: NaN). */
double forest_median(double *values, int count);

#endif
