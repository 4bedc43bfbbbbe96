/* ground.c - the terrain of a scene: read or made, its imagery laid over it, coloured.
 *
 * What is costly to make, a procedural terrain and the colours, goes through the store. The keys hash what it
 * is made from: options and heights, imagery, latitude, and the builders' versions. */
#include "core/scene/loading.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/terrain/coloring.h"
#include "core/terrain/procedural.h"

static const char TERRAIN_KIND[] = "terrain1", COLOR_KIND[] = "color1";
/* Larger blobs are made again: they would push everything else out of the store. */
enum { STORED_BYTES_MAX = 128 << 20 };

typedef unsigned long long ull; /* for %llu */

/* ---- heights ---- */

static void tell_dem(const struct sv_loading *l, const struct sv_dem_report *r)
{
    const struct sv_heightfield *f = &l->scene->terrain.field;
    l->scene->counts.voids_filled = r->voids;
    sv_loading_note(
        l, 0,
        "terrain: %s (%s), %d x %d samples in the file; %d x %d of %g x %g m, heights %.1f .. %.1f m, %s",
        l->spec->terrain.dem, r->driver, r->source_width, r->source_height, f->width, f->height, f->dx, f->dy,
        f->z0 + (double)f->h_min, f->z0 + (double)f->h_max, sv_crs_name(l->scene->crs));
    if (r->warped)
        sv_loading_note(l, 0, "terrain: warped (%s), %.1f %% of its area kept", r->warped, 100 * r->kept);
    if (r->edge_filled)
        sv_loading_note(l, 1, "terrain: %llu samples lie outside the file's data and were invented",
                        (ull)r->edge_filled);
    if (r->voids)
        sv_loading_note(l, 1,
                        "terrain: %llu voids in %llu regions filled, %llu of them not declared as nodata",
                        (ull)r->voids, (ull)r->void_regions, (ull)r->voids_undeclared);
    if (r->voids_flat)
        sv_loading_note(l, 0, "terrain: %llu of these laid flat as water, the largest at %.1f m",
                        (ull)r->voids_flat, r->flat_level_m);
    if (r->all_void)
        sv_loading_note(l, 1, "terrain: no sample of %s holds a height; the terrain is flat at 0 m",
                        l->spec->terrain.dem);
    if (r->height_unit_m != 1)
        sv_loading_note(l, 0, "terrain: heights multiplied by %g m", r->height_unit_m);
    if (r->looks_like_degrees)
        sv_loading_note(l, 1,
                        "terrain: no coordinate system known, but the coordinates look like degrees; \"crs\" "
                        "may be missing");
}

static bool load_dem(struct sv_loading *l)
{
    const struct sv_terrain_spec *t = &l->spec->terrain;
    const struct sv_dem_options options = {t->dem, t->crs, t->has_nodata, t->nodata, t->height_unit_m};
    struct sv_dem_report report = {0};
    struct sv_error error;
    if (sv_dem_read(&options, l->scene->arena, &l->scene->terrain.field, &l->scene->crs, &report, &error) !=
        SV_OK) {
        sv_loading_fail(l, &error, "terrain.dem");
        return false;
    }
    tell_dem(l, &report);
    return true;
}

/* Fills an arena's block of `bytes` from the store; false when it is not there. */
static bool recall(const struct sv_loading *l, const char *kind, uint64_t key, void *block, size_t bytes)
{
    void *data = NULL;
    size_t found = 0;
    if (bytes > STORED_BYTES_MAX || sv_store_get(l->options->store, kind, key, &data, &found, NULL) != SV_OK)
        return false;
    if (found == bytes)
        memcpy(block, data, bytes);
    free(data);
    return found == bytes;
}

static void keep(const struct sv_loading *l, const char *kind, uint64_t key, const void *block, size_t bytes)
{
    if (bytes <= STORED_BYTES_MAX)
        sv_store_put(l->options->store, kind, key, block, bytes, NULL);
}

static uint64_t procedural_key(const struct sv_procedural_options *o)
{
    uint64_t h = sv_hash_u64(SV_HASH_INIT, SV_PROCEDURAL_VERSION);
    h = sv_hash_u64(sv_hash_u64(h, (uint64_t)o->samples), o->seed);
    return sv_hash_done(sv_hash_double(sv_hash_double(h, o->size_m), o->relief_m));
}

/* The field that sv_terrain_procedural would make, its heights from the store. */
static bool recall_procedural(const struct sv_loading *l, const struct sv_procedural_options *o, uint64_t key)
{
    size_t n = (size_t)o->samples * (size_t)o->samples;
    float *h = n * sizeof *h <= STORED_BYTES_MAX && l->options->store
                   ? sv_arena_alloc(l->scene->arena, n, sizeof *h)
                   : NULL;
    if (!h || !recall(l, TERRAIN_KIND, key, h, n * sizeof *h))
        return false;
    l->scene->terrain.field = sv_terrain_procedural_field(o, h);
    return true;
}

static bool load_procedural(struct sv_loading *l)
{
    const struct sv_terrain_spec *t = &l->spec->terrain;
    const struct sv_procedural_options options = {t->size_m, t->samples, t->relief_m, t->seed};
    struct sv_heightfield *f = &l->scene->terrain.field;
    uint64_t key = procedural_key(&options);
    struct sv_error error;
    enum sv_status status = sv_crs_create_local(&l->scene->crs, &error);
    if (status == SV_OK && !recall_procedural(l, &options, key)) {
        status = sv_terrain_procedural(&options, l->scene->arena, f, &error);
        if (status == SV_OK)
            keep(l, TERRAIN_KIND, key, f->h, (size_t)f->width * (size_t)f->height * sizeof *f->h);
    }
    if (status != SV_OK) {
        sv_loading_fail(l, &error, "terrain.procedural");
        return false;
    }
    sv_loading_note(l, 0, "terrain: procedural, %g m a side, %d x %d samples, relief %g m", t->size_m,
                    t->samples, t->samples, t->relief_m);
    return true;
}

bool sv_loading_ground(struct sv_loading *l)
{
    return l->spec->terrain.dem ? load_dem(l) : load_procedural(l);
}

/* ---- colours ---- */

static bool load_imagery(struct sv_loading *l, struct sv_image *rgba)
{
    const struct sv_terrain_spec *t = &l->spec->terrain;
    if (!t->imagery)
        return true;
    struct sv_imagery_options options = {.path = t->imagery};
    memcpy(options.bands, t->imagery_bands, sizeof options.bands);
    struct sv_imagery_report r = {0};
    struct sv_error error;
    if (sv_imagery_read(&options, &l->scene->terrain.field, l->scene->crs, SV_TERRAIN_TEXTURE_SIDE_MAX, rgba,
                        &r, &error) != SV_OK) {
        sv_loading_fail(l, &error, "terrain.imagery");
        return false;
    }
    sv_loading_note(
        l, 0,
        "imagery: %s (%s), %d x %d px, bands %d,%d,%d%s%s%s; texture %d x %d covers %.1f %% of the terrain",
        t->imagery, r.driver, r.source_width, r.source_height, r.bands_used[0], r.bands_used[1],
        r.bands_used[2], r.palette ? ", palette" : "", r.warped ? ", warped" : "",
        r.fitted ? ", laid over the whole terrain" : "", rgba->width, rgba->height, 100 * r.covered);
    if (r.rescaled)
        sv_loading_note(l, 0, "imagery: stretched to bytes from %g .. %g, %g .. %g, %g .. %g",
                        r.stretch[0][0], r.stretch[0][1], r.stretch[1][0], r.stretch[1][1], r.stretch[2][0],
                        r.stretch[2][1]);
    if (r.reduced)
        sv_loading_note(l, 1, "imagery: averaged down to the texture limit of %d texels a side",
                        SV_TERRAIN_TEXTURE_SIDE_MAX);
    return true;
}

static double centre_latitude(const struct sv_scene *s)
{
    const struct sv_heightfield *f = &s->terrain.field;
    double lon, lat, x = 0.5 * (f->x0 + sv_heightfield_x1(f)), y = 0.5 * (f->y0 + sv_heightfield_y1(f));
    return sv_crs_to_lonlat(s->crs, x, y, &lon, &lat) ? lat : NAN;
}

static uint64_t color_key(const struct sv_heightfield *f, const struct sv_image *imagery, double latitude_deg)
{
    uint64_t h = sv_hash_u64(SV_HASH_INIT, SV_COLORING_VERSION);
    h = sv_hash_u64(sv_hash_u64(h, (uint64_t)f->width), (uint64_t)f->height);
    h = sv_hash_double(sv_hash_double(h, f->x0), f->y0);
    h = sv_hash_double(sv_hash_double(sv_hash_double(h, f->dx), f->dy), f->z0);
    h = sv_hash_bytes(h, f->h, (size_t)f->width * (size_t)f->height * sizeof *f->h);
    h = sv_hash_u64(sv_hash_u64(h, (uint64_t)imagery->width), (uint64_t)imagery->height);
    if (imagery->data)
        h = sv_hash_bytes(h, imagery->data, sv_image_bytes(imagery));
    return sv_hash_done(sv_hash_double(h, latitude_deg));
}

/* Colours and normals as one blob: the two images without their pixels, then the pixels of both. */
static bool recall_colors(const struct sv_loading *l, uint64_t key)
{
    struct sv_image images[2];
    char *data = NULL;
    size_t bytes = 0;
    if (sv_store_get(l->options->store, COLOR_KIND, key, (void **)&data, &bytes, NULL) != SV_OK)
        return false;
    bool ok = bytes >= sizeof images;
    if (ok) {
        memcpy(images, data, sizeof images);
        size_t first = sv_image_bytes(&images[0]), second = sv_image_bytes(&images[1]);
        ok = bytes - sizeof images == first + second;
        images[0].data = ok ? sv_arena_copy(l->scene->arena, data + sizeof images, first) : NULL;
        images[1].data = ok ? sv_arena_copy(l->scene->arena, data + sizeof images + first, second) : NULL;
        ok = images[0].data && images[1].data;
    }
    free(data);
    if (ok) {
        l->scene->terrain.albedo = images[0];
        l->scene->terrain.normal = images[1];
    }
    return ok;
}

static void keep_colors(const struct sv_loading *l, uint64_t key)
{
    struct sv_image images[2] = {l->scene->terrain.albedo, l->scene->terrain.normal};
    size_t first = sv_image_bytes(&images[0]), second = sv_image_bytes(&images[1]);
    size_t bytes = sizeof images + first + second;
    char *data = l->options->store && bytes <= STORED_BYTES_MAX ? calloc(1, bytes) : NULL;
    if (!data)
        return;
    memcpy(data + sizeof images, images[0].data, first);
    memcpy(data + sizeof images + first, images[1].data, second);
    images[0].data = images[1].data = NULL;
    memcpy(data, images, sizeof images);
    keep(l, COLOR_KIND, key, data, bytes);
    free(data);
}

bool sv_loading_colors(struct sv_loading *l)
{
    struct sv_terrain *t = &l->scene->terrain;
    struct sv_image imagery = {0};
    struct sv_error error;
    bool ok = load_imagery(l, &imagery);
    double latitude_deg = centre_latitude(l->scene);
    uint64_t key = ok && l->options->store ? color_key(&t->field, &imagery, latitude_deg) : 0;
    if (ok && !recall_colors(l, key)) {
        ok = sv_terrain_color(t, imagery.data ? &imagery : NULL, latitude_deg, l->scene->arena, &error) ==
             SV_OK;
        if (ok)
            keep_colors(l, key);
        else
            sv_loading_fail(l, &error, "terrain");
    }
    t->has_imagery = imagery.data != NULL;
    sv_image_free(&imagery);
    return ok;
}
