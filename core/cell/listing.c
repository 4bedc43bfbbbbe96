/* listing.c - see listing.h. */
#include "core/cell/listing.h"

#include <math.h>
#include <stdlib.h>

#include "core/cell/panel.h"

#define ORDER(a, b)    \
    do {               \
        if ((a) < (b)) \
            return -1; \
        if ((a) > (b)) \
            return 1;  \
    } while (0)

/* All that tells one cell from another. */
static int compare_cells(const struct sv_cell_cache_item *a, const struct sv_cell_cache_item *b)
{
    const struct sv_cell_key_parts *p = &a->label.parts, *q = &b->label.parts;
    ORDER(a->label.shell.distance_m, b->label.shell.distance_m);
    ORDER(a->label.shell.outer_m, b->label.shell.outer_m);
    ORDER(p->place.ring, q->place.ring);
    ORDER(p->place.i, q->place.i);
    ORDER(p->place.j, q->place.j);
    ORDER(p->place.k, q->place.k);
    ORDER(p->place.v.z, q->place.v.z);
    ORDER(a->label.pitch, b->label.pitch);
    ORDER(p->size, q->size);
    ORDER(p->light, q->light);
    ORDER(p->scene, q->scene);
    return 0;
}

static bool is_shadow(const struct sv_cell_cache_item *item)
{
    return item->label.parts.layer == SV_PANEL_SHADOW;
}

size_t sv_cell_listing_shadows(const struct sv_cell_cache_item *items, size_t count)
{
    size_t shadows = 0;
    for (size_t k = 0; k < count; k++)
        shadows += is_shadow(&items[k]) && !items[k].building;
    return shadows;
}

static int compare(const void *a, const void *b)
{
    const struct sv_cell_cache_item *x = a, *y = b;
    ORDER(is_shadow(x), is_shadow(y));
    int cells = compare_cells(x, y);
    if (cells != 0)
        return cells;
    ORDER(x->label.parts.layer, y->label.parts.layer);
    ORDER(x->label.parts.face, y->label.parts.face);
    ORDER(x->refined, y->refined);
    return 0;
}

/* The id is the key of no face and no layer. Of its rings a key knows the place's distance, the pitch, and
 * whether it is the last. */
static struct sv_cell_listed begin(const struct sv_cell_cache_item *item, size_t first)
{
    const struct sv_cell_shell *shell = &item->label.shell;
    struct sv_cell_key_parts parts = item->label.parts;
    int ring = parts.place.ring >= 0 && parts.place.ring < SV_CELL_RINGS_MAX ? parts.place.ring : 0;
    struct sv_cell_rings rings = {.count = isinf(shell->outer_m) ? ring + 1 : SV_CELL_RINGS_MAX + 1,
                                  .pitch = item->label.pitch};
    rings.distance_m[ring] = shell->distance_m;
    parts.place.ring = ring;
    parts.face = (enum sv_cell_face)0;
    parts.layer = 0;
    double step = rings.pitch * shell->distance_m;
    return (struct sv_cell_listed){
        .id = sv_cell_key(&rings, &parts),
        .centre = sv_vec3(parts.place.i * step, parts.place.j * step, parts.place.k * step),
        .place = parts.place,
        .distance_m = shell->distance_m,
        .outer_m = shell->outer_m,
        .half_axis_m = step,
        .size = parts.size,
        .age_s = INFINITY,
        .first = first};
}

size_t sv_cell_listing(struct sv_cell_cache_item *items, size_t count, struct sv_cell_listed *cells)
{
    size_t found = 0;
    if (count > 0)
        qsort(items, count, sizeof *items, compare);
    while (count > 0 && is_shadow(&items[count - 1]))
        count--;
    for (size_t k = 0; k < count; k++) {
        if (k == 0 || compare_cells(&items[k - 1], &items[k]) != 0)
            cells[found++] = begin(&items[k], k);
        struct sv_cell_listed *cell = &cells[found - 1];
        cell->count++;
        cell->bytes += items[k].bytes;
        cell->hits += items[k].hits;
        if (!items[k].building && items[k].age_s < cell->age_s)
            cell->age_s = items[k].age_s;
    }
    return found;
}
