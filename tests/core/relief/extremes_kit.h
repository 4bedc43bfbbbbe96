/* extremes_kit.h - extreme inputs of reliefs, buffers between pages that may not be touched, and tables of
 * the error towards a singular place. A fault names what was being done and with which case, and ends the
 * test. */
#ifndef SV_TESTS_RELIEF_EXTREMES_KIT_H
#define SV_TESTS_RELIEF_EXTREMES_KIT_H

#include "core/base/rng.h"
#include "core/relief/relief.h"

enum { EXTREMES_SEED = 97 };
enum {
    EXTREMES_SLOT_DISPL,
    EXTREMES_SLOT_COLOR,
    EXTREMES_SLOT_NORMAL,
    EXTREMES_SLOT_IN,
    EXTREMES_SLOT_IN2,
    EXTREMES_SLOT_OUT,
    EXTREMES_SLOT_OUT2,
    EXTREMES_SLOT_OUT3,
    EXTREMES_SLOTS
};
extern const char *volatile extremes_doing; /* for the handler of a fault */
extern volatile long extremes_case;

int extremes_set_up(void **state); /* cmocka's: of a group of tests */
/* At most 8,192 bytes that end (or begin) at a page that may not be touched; the slot's last are gone. */
void *extremes_guarded(struct sv_rng *rng, int slot, size_t bytes);

uint32_t extremes_pick(struct sv_rng *rng, uint32_t n); /* 0 .. n - 1 */
double extremes_length(struct sv_rng *rng);             /* 1e-6 .. 1e6 m */
float extremes_displ(struct sv_rng *rng, double scale); /* 0, 1e9, 3e38, NaN, infinite, denormal, tame */
struct sv_vec3 extremes_unit(struct sv_rng *rng);       /* often along an axis */
struct sv_relief_frame extremes_frame(struct sv_rng *rng);
struct sv_relief_frame extremes_square_frame(struct sv_rng *rng); /* texels of 1 x 1.5 m */
int extremes_side(struct sv_rng *rng);                            /* texels, 1 .. 16 */
struct sv_relief extremes_relief(struct sv_rng *rng);             /* arrays are guarded; nothing to free */
/* On the plane, on a texel, a hair beside it, under it, far away, anywhere, NaN. */
struct sv_vec3 extremes_eye(struct sv_rng *rng, const struct sv_relief *r);

struct extremes_row {
    double at;    /* the parameter that goes to its singular value */
    double error; /* the largest seen */
};

/* Prints a table; between neighbours the error may grow by `factor` at most (errors below `floor_error` count
 * as that), and stays below `bound` everywhere. */
void extremes_judge(const char *what, const char *unit, const struct extremes_row *rows, int count,
                    double factor, double floor_error, double bound);

#endif
