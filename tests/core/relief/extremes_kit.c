/* extremes_kit.c - see extremes_kit.h. */
#include "tests/core/relief/extremes_kit.h"

#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/color.h"

/* ---- buffers between guard pages ---- */

enum { PAGE = 4096, SLOT_PAGES = 2 };
static char *slots[EXTREMES_SLOTS];

const char *volatile extremes_doing = "";
volatile long extremes_case;

static void on_fault(int number)
{
    char text[128];
    int n = snprintf(text, sizeof text, "signal %d in %s, seed %d, case %ld\n", number, extremes_doing,
                     EXTREMES_SEED, extremes_case);
    ssize_t written = write(STDERR_FILENO, text, (size_t)n);
    _exit(written > 0 ? 3 : 4);
}

int extremes_set_up(void **state)
{
    (void)state;
    sv_color_init();
    signal(SIGSEGV, on_fault);
    signal(SIGBUS, on_fault);
    signal(SIGFPE, on_fault);
    for (int k = 0; k < EXTREMES_SLOTS; k++) {
        char *p = mmap(NULL, (SLOT_PAGES + 2) * PAGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (p == MAP_FAILED || mprotect(p + PAGE, SLOT_PAGES * PAGE, PROT_READ | PROT_WRITE))
            return -1;
        slots[k] = p + PAGE;
    }
    return 0;
}

/* `bytes` that end (or begin) at a page that may not be touched. */
void *extremes_guarded(struct sv_rng *rng, int slot, size_t bytes)
{
    assert_true(bytes <= SLOT_PAGES * PAGE);
    return sv_rng_next(rng) & 1 ? slots[slot] + SLOT_PAGES * PAGE - bytes : slots[slot];
}

/* ---- extreme values ---- */

uint32_t extremes_pick(struct sv_rng *rng, uint32_t n)
{
    return (uint32_t)(sv_rng_next(rng) % n);
}

double extremes_length(struct sv_rng *rng)
{
    static const double named[] = {1e-6, 1, 1e6};
    return extremes_pick(rng, 3) ? pow(10, sv_rng_range(rng, -6, 6)) : named[extremes_pick(rng, 3)];
}

float extremes_displ(struct sv_rng *rng, double scale)
{
    static const float named[] = {0,     -0.0f,    1e9f,     -1e9f,     1e-42f, -1e-42f, NAN,
                                  3e38f, -3.4e38f, INFINITY, -INFINITY, 1e-30f, 1e6f,    -1e6f};
    if (extremes_pick(rng, 4) == 0)
        return named[extremes_pick(rng, sizeof named / sizeof *named)];
    return (float)(scale * sv_rng_range(rng, -20, 20));
}

struct sv_vec3 extremes_unit(struct sv_rng *rng)
{
    static const double axis[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    if (extremes_pick(rng, 3) == 0) {
        const double *a = axis[extremes_pick(rng, 6)];
        return sv_vec3(a[0], a[1], a[2]);
    }
    double z = sv_rng_range(rng, -1, 1), phi = sv_rng_range(rng, 0, 2 * SV_PI), r = sqrt(1 - z * z);
    return sv_vec3(r * cos(phi), r * sin(phi), z);
}

struct sv_relief_frame extremes_frame(struct sv_rng *rng)
{
    struct sv_relief_frame f;
    struct sv_vec3 x, y;
    do {
        x = extremes_unit(rng);
        y = sv_cross(x, extremes_unit(rng));
    } while (sv_length(y) < 0.01);
    y = sv_normalize(y);
    f.a = sv_scale(x, extremes_length(rng));
    f.b = sv_scale(y, extremes_length(rng));
    f.f = sv_scale(sv_normalize(sv_cross(x, y)), sv_rng_next(rng) & 1 ? 1 : -1);
    f.origin =
        extremes_pick(rng, 3) ? sv_vec3(0, 0, 0) : sv_vec3(500000.25, 4e6, sv_rng_range(rng, -100, 100));
    return f;
}

int extremes_side(struct sv_rng *rng)
{
    return extremes_pick(rng, 4) == 0 ? 1 : (int)(1 + extremes_pick(rng, extremes_pick(rng, 8) ? 6 : 16));
}

/* Arrays are guarded; nothing to free. */
struct sv_relief extremes_relief(struct sv_rng *rng)
{
    struct sv_relief r = {
        .frame = extremes_frame(rng), .width = extremes_side(rng), .height = extremes_side(rng)};
    size_t n = (size_t)r.width * (size_t)r.height;
    double scale = extremes_pick(rng, 3) ? sv_length(r.frame.a) : extremes_length(rng);
    r.displ = extremes_guarded(rng, EXTREMES_SLOT_DISPL, n * sizeof *r.displ);
    r.color = extremes_guarded(rng, EXTREMES_SLOT_COLOR, n * sizeof *r.color);
    r.normal = extremes_guarded(rng, EXTREMES_SLOT_NORMAL, n * sizeof *r.normal);
    bool tame = extremes_pick(rng, 4) == 0, see_through = extremes_pick(rng, 3) == 0;
    for (size_t t = 0; t < n; t++) {
        r.displ[t] = tame ? (float)(scale * sv_rng_range(rng, -3, 3)) : extremes_displ(rng, scale);
        for (int c = 0; c < 4; c++) {
            r.color[t][c] = (uint8_t)sv_rng_next(rng);
            r.normal[t][c] = (int16_t)sv_rng_next(rng);
        }
        if (!see_through)
            r.color[t][3] = 255;
    }
    r.cut = extremes_pick(rng, 3) == 0 ? INFINITY : (float)(scale * sv_rng_range(rng, 0.1, 10));
    sv_relief_measure(&r);
    return r;
}

/* On the plane, on a texel, a hair beside it, under it, far away, anywhere, NaN. */
struct sv_vec3 extremes_eye(struct sv_rng *rng, const struct sv_relief *r)
{
    double u = sv_rng_range(rng, -1, r->width + 1.0), v = sv_rng_range(rng, -1, r->height + 1.0);
    double size = sv_length(r->frame.a) * r->width + sv_length(r->frame.b) * r->height, d = 0;
    size_t t = extremes_pick(rng, (uint32_t)(r->width * r->height));
    switch (extremes_pick(rng, 7)) { /* 0: on the plane */
    case 1:
        d = isfinite(r->displ[t]) ? r->displ[t] : 0;
        break;
    case 2:
        d = size * pow(10, sv_rng_range(rng, -12, 0));
        break;
    case 3:
        d = -size * pow(10, sv_rng_range(rng, -12, 0));
        break;
    case 4:
        d = size * pow(10, sv_rng_range(rng, 0, 6));
        break;
    case 5:
        return sv_madd(r->frame.origin, extremes_unit(rng), size * pow(10, sv_rng_range(rng, -6, 6)));
    case 6:
        d = extremes_pick(rng, 4) ? size : NAN;
    }
    return sv_relief_point(&r->frame, u, v, d);
}

/* ---- towards the singular places ---- */

void extremes_judge(const char *what, const char *unit, const struct extremes_row *rows, int count,
                    double factor, double floor_error, double bound)
{
    print_message("%s\n", what);
    double before = 0;
    for (int k = 0; k < count; k++) {
        double now = fmax(rows[k].error, floor_error);
        print_message("  %12.4g   %10.3g %s%s\n", rows[k].at, rows[k].error, unit,
                      k > 0 && now > before * factor ? "   JUMPS" : "");
        assert_true(isfinite(rows[k].error));
        assert_true(k == 0 || now <= before * factor);
        assert_true(rows[k].error < bound);
        before = now;
    }
}

struct sv_relief_frame extremes_square_frame(struct sv_rng *rng)
{
    struct sv_relief_frame f = extremes_frame(rng);
    f.a = sv_normalize(f.a);
    f.b = sv_scale(sv_normalize(f.b), 1.5);
    return f;
}
