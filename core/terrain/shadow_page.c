/* shadow_page.c - see shadow_page.h. A hash table over the slots; look-ups renew a slot's time of use. */
#include "core/terrain/shadow_page.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = SV_SHADOW_PAGE_SIDE, STEP = SV_SHADOW_PAGE_STEP, BUCKETS = 4096, NONE = -1 };
enum { TEXELS = SIDE * SIDE, SPARE = 4 };

struct slot {
    uint64_t key, used;
    int level, i, j;
    int next; /* in its bucket */
};

struct sv_shadow_pages {
    struct sv_shadow_scene scene;
    struct sv_shadow_window window; /* the one that is being filled; its light is a page's */
    uint8_t *own_light, *light;
    struct slot slots[SV_SHADOW_PAGES];
    int slot_count; /* that were ever used */
    int emptied;    /* of these: those that hold no page (used is 0) */
    int buckets[BUCKETS];
    uint64_t clock, filled;
};

enum sv_status sv_shadow_pages_create(struct sv_shadow_pages **pages, struct sv_error *error)
{
    struct sv_shadow_pages *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for pages of shadows");
    enum sv_status status = sv_shadow_window_alloc(&made->window, SIDE, error);
    made->own_light = made->window.light;
    made->light = malloc((size_t)SV_SHADOW_PAGES * TEXELS + SPARE);
    if (!status && !made->light)
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory for %d pages of shadows", SV_SHADOW_PAGES);
    if (status) {
        sv_shadow_pages_destroy(made);
        return status;
    }
    memset(made->light + (size_t)SV_SHADOW_PAGES * TEXELS, 0, SPARE);
    for (int k = 0; k < BUCKETS; k++)
        made->buckets[k] = NONE;
    *pages = made;
    return SV_OK;
}

void sv_shadow_pages_destroy(struct sv_shadow_pages *pages)
{
    if (!pages)
        return;
    pages->window.light = pages->own_light;
    sv_shadow_window_finish(&pages->window);
    free(pages->light);
    free(pages);
}

void sv_shadow_pages_use(struct sv_shadow_pages *pages, const struct sv_shadow_scene *scene)
{
    pages->scene = *scene;
}

const uint8_t *sv_shadow_pages_light(const struct sv_shadow_pages *pages)
{
    return pages->light;
}

uint64_t sv_shadow_pages_filled(const struct sv_shadow_pages *pages)
{
    return pages->filled;
}

int sv_shadow_pages_finest(const struct sv_shadow_pages *pages)
{
    const struct sv_shadow_scene *scene = &pages->scene;
    int level = 0;
    for (int k = 0; k < SV_SHADOW_CASTERS_MAX; k++)
        if (scene->casters[k].cast)
            return 0;
    double finest = fmin(scene->field->dx, scene->field->dy) / 8;
    while (level < SV_SHADOW_PAGE_LEVELS - 1 && ldexp(SV_SHADOW_PAGE_TEXEL_M, level + 1) <= finest)
        level++;
    return level;
}

static int *bucket_of(struct sv_shadow_pages *pages, uint64_t key, int level, int i, int j)
{
    uint64_t h = (uint64_t)(uint32_t)i * UINT64_C(0x9E3779B97F4A7C15) ^
                 ((uint64_t)(uint32_t)j + ((uint64_t)(uint32_t)level << 32)) * UINT64_C(0xC2B2AE3D27D4EB4F) ^
                 key;
    return &pages->buckets[(h * UINT64_C(0x9E3779B97F4A7C15)) >> 52];
}

static void unlink_slot(struct sv_shadow_pages *pages, int slot)
{
    struct slot *s = &pages->slots[slot];
    int *at = bucket_of(pages, s->key, s->level, s->i, s->j);
    while (*at != slot)
        at = &pages->slots[*at].next;
    *at = s->next;
}

/* A slot to fill: a fresh one, or that of the page that was wanted longest ago. */
static int free_slot(struct sv_shadow_pages *pages)
{
    if (pages->emptied == 0 && pages->slot_count < SV_SHADOW_PAGES)
        return pages->slot_count++;
    int oldest = 0;
    for (int k = 1; k < pages->slot_count; k++)
        if (pages->slots[k].used < pages->slots[oldest].used)
            oldest = k;
    if (pages->slots[oldest].used)
        unlink_slot(pages, oldest);
    else
        pages->emptied--;
    return oldest;
}

static void fill(struct sv_shadow_pages *pages, int slot)
{
    const struct sv_shadow_scene *scene = &pages->scene;
    const struct slot *s = &pages->slots[slot];
    double texel = ldexp(SV_SHADOW_PAGE_TEXEL_M, s->level);
    struct sv_shadow_place place = {scene->field->x0 + ((double)s->i * STEP - 1) * texel,
                                    scene->field->y0 + ((double)s->j * STEP - 1) * texel, texel};
    pages->window.light = pages->light + (size_t)slot * TEXELS;
    sv_shadow_window_fill(&pages->window, scene->field, scene->terrain, place);
    for (int k = 0; k < SV_SHADOW_CASTERS_MAX; k++)
        if (scene->casters[k].cast)
            scene->casters[k].cast(scene->casters[k].context, &pages->window);
    pages->filled++;
}

/* The slot of a page of the scene in use, or NONE. */
static int find_slot(struct sv_shadow_pages *pages, int level, int i, int j)
{
    uint64_t key = pages->scene.key;
    for (int k = *bucket_of(pages, key, level, i, j); k != NONE; k = pages->slots[k].next) {
        const struct slot *s = &pages->slots[k];
        if (s->i == i && s->j == j && s->level == level && s->key == key)
            return k;
    }
    return NONE;
}

uint32_t sv_shadow_pages_want(struct sv_shadow_pages *pages, int level, int i, int j)
{
    uint64_t key = pages->scene.key;
    int k = find_slot(pages, level, i, j);
    pages->clock++;
    if (k != NONE) {
        pages->slots[k].used = pages->clock;
        return (uint32_t)k * TEXELS;
    }
    k = free_slot(pages);
    int *bucket = bucket_of(pages, key, level, i, j);
    pages->slots[k] = (struct slot){key, pages->clock, level, i, j, *bucket};
    *bucket = k;
    fill(pages, k);
    return (uint32_t)k * TEXELS;
}

/* ---- what is no longer so ---- */

/* Of light from lower than that nothing is cast (shadow_window.h). */
static const double LOWEST_SUN_Z = 0.004;

/* May the box's shadow fall on the page? It is swept down to the field's lowest ground. */
static bool falls_on(const struct sv_shadow_box *b, const struct slot *s, const struct sv_heightfield *f,
                     struct sv_vec3 to_sun)
{
    double texel = ldexp(SV_SHADOW_PAGE_TEXEL_M, s->level), spread = 2 * texel;
    double drop = fmax(b->max[2] - (f->z0 + (double)f->h_min), 0) / fmax(to_sun.z, LOWEST_SUN_Z);
    const double corner[2] = {f->x0 + ((double)s->i * STEP - 1) * texel,
                              f->y0 + ((double)s->j * STEP - 1) * texel};
    const double shift[2] = {-to_sun.x * drop, -to_sun.y * drop};
    /* The sweep is a parallelogram; what lies beside its axis is told by the part of it over the page. */
    double from = 0, to = 1;
    for (int a = 0; a < 2; a++) {
        double lo = corner[a] - spread - b->max[a], hi = corner[a] + SIDE * texel + spread - b->min[a];
        if (fabs(shift[a]) < 1e-9) {
            if (lo > 0 || hi < 0)
                return false;
            continue;
        }
        double p = lo / shift[a], q = hi / shift[a];
        from = fmax(from, fmin(p, q));
        to = fmin(to, fmax(p, q));
    }
    return from <= to;
}

void sv_shadow_pages_drop(struct sv_shadow_pages *pages, uint64_t key, struct sv_vec3 to_sun,
                          const struct sv_heightfield *field, const struct sv_shadow_box *boxes, size_t count)
{
    for (int k = 0; k < pages->slot_count; k++) {
        struct slot *s = &pages->slots[k];
        bool stale = s->key != key;
        for (size_t b = 0; b < count && !stale; b++)
            stale = falls_on(&boxes[b], s, field, to_sun);
        if (!s->used || !stale)
            continue;
        unlink_slot(pages, k);
        s->used = 0;
        pages->emptied++;
    }
}

static int pages_across(double side_m, int level)
{
    return (int)fmin(ceil(side_m / (ldexp(SV_SHADOW_PAGE_TEXEL_M, level) * STEP)), 1e4);
}

/* What a body costs at a level, ns: every page that its shadow might reach looks at it, over as much relief
 * as the light crosses; small shadows are put down texel by texel, larger ones row by row. Fitted to a
 * million trees of 6 to 20 m on 4.5 km with 220 m of relief, under suns of 4 and 40 degrees, to a factor of
 * two on one core of an EPYC. */
static double body_ns(const struct sv_shadow_scene *scene, int level, int pages)
{
    static const double LOOK_NS = 300, STAMP_NS = 50, STAMP_TEXELS = 16, TEXEL_NS = 1.5, BODY_M2 = 100;
    const struct sv_heightfield *f = scene->field;
    double rise = fmax(scene->terrain ? scene->terrain->to_sun.z : 1, 0.01),
           run = sqrt(1 - fmin(rise * rise, 1));
    double texel = ldexp(SV_SHADOW_PAGE_TEXEL_M, level), texels = BODY_M2 / (rise * texel * texel);
    double reach = ((double)f->h_max - (double)f->h_min) * run / rise;
    return LOOK_NS * fmin(1 + reach / (texel * STEP), pages) + STAMP_NS * fmin(texels, STAMP_TEXELS) +
           TEXEL_NS * texels;
}

/* Pages of a level of w * h that are not there. */
static int count_missing(struct sv_shadow_pages *pages, int level, int w, int h)
{
    int missing = 0;
    for (int k = 0; k < w * h; k++)
        missing += find_slot(pages, level, k % w, k / w) == NONE;
    return missing;
}

int sv_shadow_pages_fill_whole(struct sv_shadow_pages *pages, double casters, double most_s)
{
    const struct sv_heightfield *f = pages->scene.field;
    double size_x = (f->width - 1) * f->dx, size_y = (f->height - 1) * f->dy, ns = 0;
    int level = SV_SHADOW_PAGE_LEVELS - 1, count = 0, finest = sv_shadow_pages_finest(pages);
    for (; level > finest; level--) {
        int w = pages_across(size_x, level - 1), h = pages_across(size_y, level - 1);
        if (w * h == 1)
            continue;
        count += w * h;
        if (count > SV_SHADOW_PAGES_WHOLE)
            break;
        ns += casters * body_ns(&pages->scene, level - 1, w * h) * count_missing(pages, level - 1, w, h) /
              (w * h);
        if (ns > 1e9 * most_s)
            break;
        for (int k = 0; k < w * h; k++)
            (void)sv_shadow_pages_want(pages, level - 1, k % w, k / w);
    }
    return level;
}
