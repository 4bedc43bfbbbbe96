/* shadow_page.c - see shadow_page.h. A hash table over the slots; look-ups renew a slot's time of use. */
#include "core/terrain/shadow_page.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = SV_SHADOW_PAGE_SIDE, STEP = SV_SHADOW_PAGE_STEP, BUCKETS = 4096, NONE = -1 };
enum { TEXELS = SIDE * SIDE, SPARE = 4, ASKED = 1024 };
/* Refined pages are of a key of their own, so that who uses no source never sees them. */
#define REFINED UINT64_C(0x5E1F0C3A9B7D2468)

struct slot {
    uint64_t key, used;
    int level, i, j;
    int next;                 /* in its bucket */
    uint64_t number, version; /* of a refined one: the source's number of it, and when that was asked */
};

/* A page that the source did not have. */
struct asked {
    uint64_t key, version;
    int level, i, j;
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
    int finest; /* of the scene in use */
    /* refined pages */
    struct asked asked[ASKED]; /* by hash, the last one asked for */
    uint8_t read[TEXELS];      /* one that is asked for */
    uint64_t lacking;
    struct sv_shadow_wishes *wishes;
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
    for (int k = 0; k < ASKED; k++)
        made->asked[k].level = SV_SHADOW_PAGE_LEVELS; /* of no page */
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

static int finest_of(const struct sv_shadow_scene *scene)
{
    int level = 0;
    for (int k = 0; k < SV_SHADOW_CASTERS_MAX; k++)
        if (scene->casters[k].cast)
            return 0;
    double finest = fmin(scene->field->dx, scene->field->dy) / 8;
    while (level < SV_SHADOW_PAGE_LEVELS - 1 && ldexp(SV_SHADOW_PAGE_TEXEL_M, level + 1) <= finest)
        level++;
    return level;
}

void sv_shadow_pages_use(struct sv_shadow_pages *pages, const struct sv_shadow_scene *scene)
{
    pages->scene = *scene;
    pages->finest = finest_of(scene);
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
    return pages->finest;
}

bool sv_shadow_pages_refines(const struct sv_shadow_pages *pages)
{
    return pages->scene.refined.read != NULL;
}

uint64_t sv_shadow_pages_lacking(const struct sv_shadow_pages *pages)
{
    return pages->lacking;
}

static uint64_t hash_of(uint64_t key, int level, int i, int j)
{
    uint64_t h = (uint64_t)(uint32_t)i * UINT64_C(0x9E3779B97F4A7C15) ^
                 ((uint64_t)(uint32_t)j + ((uint64_t)(uint32_t)level << 32)) * UINT64_C(0xC2B2AE3D27D4EB4F) ^
                 key;
    return h * UINT64_C(0x9E3779B97F4A7C15);
}

static int *bucket_of(struct sv_shadow_pages *pages, uint64_t key, int level, int i, int j)
{
    return &pages->buckets[hash_of(key, level, i, j) >> 52];
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

struct sv_shadow_place sv_shadow_page_place(const struct sv_heightfield *field, int level, int i, int j)
{
    double texel = ldexp(SV_SHADOW_PAGE_TEXEL_M, level);
    return (struct sv_shadow_place){field->x0 + ((double)i * STEP - 1) * texel,
                                    field->y0 + ((double)j * STEP - 1) * texel, texel};
}

static void fill(struct sv_shadow_pages *pages, int slot)
{
    const struct sv_shadow_scene *scene = &pages->scene;
    const struct slot *s = &pages->slots[slot];
    struct sv_shadow_place place = sv_shadow_page_place(scene->field, s->level, s->i, s->j);
    pages->window.light = pages->light + (size_t)slot * TEXELS;
    sv_shadow_window_fill(&pages->window, scene->field, scene->terrain, place);
    for (int k = 0; k < SV_SHADOW_CASTERS_MAX; k++)
        if (scene->casters[k].cast)
            scene->casters[k].cast(scene->casters[k].context, &pages->window);
    pages->filled++;
}

/* The slot of a page, or NONE. */
static int find_slot(struct sv_shadow_pages *pages, uint64_t key, int level, int i, int j)
{
    for (int k = *bucket_of(pages, key, level, i, j); k != NONE; k = pages->slots[k].next) {
        const struct slot *s = &pages->slots[k];
        if (s->i == i && s->j == j && s->level == level && s->key == key)
            return k;
    }
    return NONE;
}

/* A slot for a page that has none. */
static int take_slot(struct sv_shadow_pages *pages, uint64_t key, int level, int i, int j)
{
    int k = free_slot(pages), *bucket = bucket_of(pages, key, level, i, j);
    pages->slots[k] =
        (struct slot){.key = key, .used = pages->clock, .level = level, .i = i, .j = j, .next = *bucket};
    *bucket = k;
    return k;
}

static void empty_slot(struct sv_shadow_pages *pages, int k)
{
    unlink_slot(pages, k);
    pages->slots[k].used = 0;
    pages->emptied++;
}

uint32_t sv_shadow_pages_want(struct sv_shadow_pages *pages, int level, int i, int j)
{
    uint64_t key = pages->scene.key;
    int k = find_slot(pages, key, level, i, j);
    pages->clock++;
    if (k != NONE) {
        pages->slots[k].used = pages->clock;
        return (uint32_t)k * TEXELS;
    }
    k = take_slot(pages, key, level, i, j);
    fill(pages, k);
    return (uint32_t)k * TEXELS;
}

/* ---- refined pages ---- */

void sv_shadow_pages_note(struct sv_shadow_pages *pages, struct sv_shadow_wishes *wishes)
{
    pages->wishes = wishes;
}

bool sv_shadow_pages_notes(const struct sv_shadow_pages *pages)
{
    return pages->wishes != NULL;
}

static bool is_wish(const struct sv_shadow_wish *w, int level, int i, int j)
{
    return w->level == level && w->i == i && w->j == j;
}

/* Neighbouring pixels mostly wish for the same page. */
static void note(struct sv_shadow_wishes *w, int level, int i, int j)
{
    size_t at = w->last;
    if (at >= w->count || !is_wish(&w->list[at], level, i, j))
        for (at = 0; at < w->count && !is_wish(&w->list[at], level, i, j); at++)
            ;
    if (at == w->room)
        return;
    if (at == w->count)
        w->list[w->count++] = (struct sv_shadow_wish){level, i, j, 0};
    w->list[at].count++;
    w->last = at;
}

/* The slot of the source's page, as the source has it now; NONE: it has none. */
static int refined_slot(struct sv_shadow_pages *pages, int level, int i, int j)
{
    const struct sv_shadow_source *source = &pages->scene.refined;
    uint64_t key = pages->scene.key ^ REFINED;
    int k = find_slot(pages, key, level, i, j);
    if (k != NONE && pages->slots[k].version == source->version)
        return k;
    struct asked *a = &pages->asked[hash_of(key, level, i, j) >> 54],
                 now = {key, source->version, level, i, j};
    if (k == NONE && a->level == level && a->i == i && a->j == j && a->version == now.version &&
        a->key == key)
        return NONE;
    uint64_t number =
        source->read(source->context, level, i, j, k != NONE ? pages->slots[k].number : 0, pages->read);
    if (number == 0) {
        if (k != NONE)
            empty_slot(pages, k);
        *a = now;
        return NONE;
    }
    if (k == NONE)
        k = take_slot(pages, key, level, i, j);
    if (pages->slots[k].number != number)
        memcpy(pages->light + (size_t)k * TEXELS, pages->read, TEXELS);
    pages->slots[k].number = number;
    pages->slots[k].version = source->version;
    return k;
}

uint32_t sv_shadow_pages_want_refined(struct sv_shadow_pages *pages, int level, int last, int i, int j,
                                      int *found)
{
    if (pages->wishes)
        note(pages->wishes, level, i, j);
    pages->clock++;
    for (int l = level; l <= last; l++, i >>= 1, j >>= 1) {
        int k = refined_slot(pages, l, i, j);
        *found = l;
        if (k != NONE) {
            pages->slots[k].used = pages->clock;
            return (uint32_t)k * TEXELS;
        }
        pages->lacking += l == level;
    }
    return SV_SHADOW_PAGE_NONE;
}

/* ---- what is no longer so ---- */

/* Of light from lower than that nothing is cast (shadow_window.h). */
static const double LOWEST_SUN_Z = 0.004;

bool sv_shadow_page_meets(const struct sv_heightfield *f, struct sv_vec3 to_sun,
                          const struct sv_shadow_box *b, int level, int i, int j)
{
    struct sv_shadow_place place = sv_shadow_page_place(f, level, i, j);
    double texel = place.texel_m, spread = 2 * texel;
    double drop = fmax(b->max[2] - (f->z0 + (double)f->h_min), 0) / fmax(to_sun.z, LOWEST_SUN_Z);
    const double corner[2] = {place.x0, place.y0};
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
        const struct slot *s = &pages->slots[k];
        bool stale = s->key != key && s->key != (key ^ REFINED);
        for (size_t b = 0; b < count && !stale; b++)
            stale = sv_shadow_page_meets(field, to_sun, &boxes[b], s->level, s->i, s->j);
        if (s->used && stale)
            empty_slot(pages, k);
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
        missing += find_slot(pages, pages->scene.key, level, k % w, k / w) == NONE;
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
