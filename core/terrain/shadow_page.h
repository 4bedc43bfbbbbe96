/* shadow_page.h - sunlight on the ground wherever it is asked for, as fine as it is asked for, in pages that
 * are filled the first time that somebody looks at them.
 *
 * Level k has texels of SV_SHADOW_PAGE_TEXEL_M * 2^k on a lattice that starts at the field's south-west
 * corner. Page (i, j) of a level is a window (shadow_window.h) of SV_SHADOW_PAGE_SIDE texels a side: the STEP
 * * STEP texels from (STEP i, STEP j) on and one more on each side, so that bilinear look-ups of any place of
 * the page stay inside of it. Coarser levels are the mip levels of finer ones, each cast anew.
 *
 * Who has better pages, cast from rays, lends them as a source (sv_shadow_source): where one is in use, pages
 * are taken from it as far as it has them, down to texels of SV_SHADOW_PAGE_TEXEL_M / 2^FINER, levels -FINER
 * .. -1, which are never built here. Levels nest: page (i, j) of a level lies in page (i >> 1, j >> 1) of the
 * next one.
 *
 * A page's content depends on its place, the sun and what casts, never on earlier views or on the eye, so a
 * picture is the same whoever draws it, and eyes that come by again find the pages there. SV_SHADOW_PAGES are
 * kept, the least lately used gives way. Neighbouring pages agree on the texels that both hold, but for one
 * grey level (the order of casters is the same). Own derivation. No GL. */
#ifndef SV_TERRAIN_SHADOW_PAGE_H
#define SV_TERRAIN_SHADOW_PAGE_H

#include <stddef.h>

#include "core/terrain/shadow_window.h"

enum {
    SV_SHADOW_PAGE_SIDE = 128,
    SV_SHADOW_PAGE_STEP = SV_SHADOW_PAGE_SIDE - 2,
    SV_SHADOW_PAGE_LEVELS = 20,
    SV_SHADOW_PAGE_FINER = 4, /* levels below 0 */
    SV_SHADOW_PAGES = 2048,
    SV_SHADOW_CASTERS_MAX = 4
};
#define SV_SHADOW_PAGE_TEXEL_M 0.125
/* The level for a place: the finest whose texels are at least this share of the pixel there (of the geometric
 * mean of its length and width on the ground): texels of 0.7 to 1.4 pixels. */
#define SV_SHADOW_PAGE_TEXEL_PX 0.7

struct sv_shadow_pages;

/* Where better pages may be had. */
struct sv_shadow_source {
    /* The number of a page, another one when its content is another; 0: there is none. Writes its light (SIDE
     * squared) unless the number is `have`. NULL: no source. */
    uint64_t (*read)(void *context, int level, int i, int j, uint64_t have, uint8_t *light);
    void *context;
    uint64_t version; /* while it stays, nothing is asked for twice */
};

/* What stands between the sun and the ground. */
struct sv_shadow_scene {
    const struct sv_heightfield *field;
    const struct sv_shadow_height *terrain; /* of the sun; NULL: none */
    struct sv_shadow_caster_of {
        sv_shadow_caster cast; /* NULL: an empty place */
        void *context;
    } casters[SV_SHADOW_CASTERS_MAX];
    uint64_t key; /* of the sun and of what casts: pages of another key are not used */
    struct sv_shadow_source refined;
};

/* 34 MB, touched as pages are filled. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_shadow_pages_create(struct sv_shadow_pages **pages, struct sv_error *error);
void sv_shadow_pages_destroy(struct sv_shadow_pages *pages); /* NULL is legal */

/* What pages are filled from; what it points to is borrowed until the next call. */
void sv_shadow_pages_use(struct sv_shadow_pages *pages, const struct sv_shadow_scene *scene);

/* Page (i, j) of a level (0 .. LEVELS - 1) of the scene in use, filled when it is not there: where its first
 * texel lies in sv_shadow_pages_light. Row 0 is the south row. Valid until SV_SHADOW_PAGES - 1 others were
 * wanted. */
uint32_t sv_shadow_pages_want(struct sv_shadow_pages *pages, int level, int i, int j);
/* Where a source is in use, for any levels from -FINER on: the source's page of `level` where it has one,
 * else of the next coarser level, up to `last`. *found: its level; the page there is (i >> (*found - level),
 * j >> ...). SV_SHADOW_PAGE_NONE: it has none of them. Nothing is filled. */
#define SV_SHADOW_PAGE_NONE UINT32_MAX
uint32_t sv_shadow_pages_want_refined(struct sv_shadow_pages *pages, int level, int last, int i, int j,
                                      int *found);
bool sv_shadow_pages_refines(const struct sv_shadow_pages *pages); /* a source is in use */
/* How many times a page was wanted refined that the source does not have, since creation. */
uint64_t sv_shadow_pages_lacking(const struct sv_shadow_pages *pages);

/* Pages that are wanted refined, and how often. */
struct sv_shadow_wish {
    int level, i, j;
    uint32_t count;
};
struct sv_shadow_wishes {
    struct sv_shadow_wish *list;
    size_t count, room; /* what there is no room for is left out */
    size_t last;
};
/* From now on they are noted, whether the source has them or not; NULL: no longer. Borrowed. */
void sv_shadow_pages_note(struct sv_shadow_pages *pages, struct sv_shadow_wishes *wishes);
bool sv_shadow_pages_notes(const struct sv_shadow_pages *pages); /* they are noted */

/* Where a page lies. Its texels are those of the level's lattice from column STEP i - 1 and row STEP j - 1
 * on. */
struct sv_shadow_place sv_shadow_page_place(const struct sv_heightfield *field, int level, int i, int j);
/* Fills whole levels of the scene in use, from the coarsest of several pages down, as long as they are not
 * too much: SV_SHADOW_PAGES_WHOLE pages in all, and for those that are not there most_s of what casters (how
 * many bodies cast; 0: the terrain alone) are estimated to take, more the lower the sun. What belongs to a
 * sun that stays is made once, then. Returns the finest level filled. */
enum { SV_SHADOW_PAGES_WHOLE = 1400 };
#define SV_SHADOW_PAGES_WHOLE_S 2.5 /* before a service first draws */
int sv_shadow_pages_fill_whole(struct sv_shadow_pages *pages, double casters, double most_s);
/* World, m; light comes from to_sun, unit. */
struct sv_shadow_box {
    double min[3], max[3];
};
/* Whether the box's shadow may fall on the page: it is swept down to the field's lowest ground. */
bool sv_shadow_page_meets(const struct sv_heightfield *field, struct sv_vec3 to_sun,
                          const struct sv_shadow_box *box, int level, int i, int j);
/* What stood or stands between the sun and the ground is other: drops pages of other keys than `key`, and of
 * these all on which the shadow of one of the boxes may fall. */
void sv_shadow_pages_drop(struct sv_shadow_pages *pages, uint64_t key, struct sv_vec3 to_sun,
                          const struct sv_heightfield *field, const struct sv_shadow_box *boxes,
                          size_t count);
/* Light of all pages, 255: all sunlight; reads of four bytes from any texel on are legal. */
const uint8_t *sv_shadow_pages_light(const struct sv_shadow_pages *pages);

/* The level whose texels are finest_m wide or just coarser than half of it: no smaller one is of use to the
 * scene. Without casters that is an eighth of the field's spacing. */
int sv_shadow_pages_finest(const struct sv_shadow_pages *pages);
/* How many pages were filled since creation. */
uint64_t sv_shadow_pages_filled(const struct sv_shadow_pages *pages);

#endif
