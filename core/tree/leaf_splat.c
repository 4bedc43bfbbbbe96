/* leaf_splat.c - see leaf_splat.h: forms, how much of a tree is drawn, bands of rows and samples of a pixel.
 */
#include "core/tree/leaf_splat.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/leaf_pass.h"

enum { TILE = SV_LEAF_TILE, BAND_PIXELS = 1 << 20, BAND_SAMPLES = 1 << 18 };

/* px^2 that a card of the mean size covers, seen from its front, when thinning out begins. Found on five
 * species of 39,000 leaves at 30 to 120 px, 4 samples: the error against 64 rays is then within 5 % of that
 * of all leaves (bench_leaf_splat); what it saves is the projection of leaves, since those that stay cover
 * the same pixels. */
static const double CARD_PX2 = 0.3;
/* Least share of the leaves that a tree keeps. */
static const double FRACTION_MIN = 1.0 / 256;

/* ---- forms ---- */

void sv_leaf_splat_add(struct sv_leaf_splat *splat, int k, const struct sv_tree_mesh *mesh)
{
    if (splat->species[k].mesh)
        return;
    splat->species[k].mesh = mesh;
    splat->species[k].owner = k;
    for (int i = splat->species_count - 1; i >= 0; i--)
        if (i != k && splat->species[i].mesh == mesh)
            splat->species[k].owner = splat->species[i].owner;
}

enum sv_status sv_leaf_splat_create(const struct sv_tree_draw_species *species, int species_count,
                                    struct sv_leaf_splat **out, struct sv_error *error)
{
    struct sv_leaf_splat *splat = calloc(1, sizeof *splat);
    if (splat) {
        splat->species = calloc((size_t)species_count + 1, sizeof *splat->species);
        splat->job = aligned_alloc(64, (sizeof *splat->job + 63) / 64 * 64);
    }
    if (!splat || !splat->species || !splat->job) {
        sv_leaf_splat_destroy(splat);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw leaves of %d species", species_count);
    }
    memset(splat->job, 0, sizeof *splat->job);
    sv_color_init();
    splat->species_count = species_count;
    splat->kernel = sv_leaf_kernel_at(sv_simd_level());
    for (int k = 0; k < species_count; k++)
        if (species[k].tree_count > 0)
            sv_leaf_splat_add(splat, k, species[k].mesh);
    *out = splat;
    return SV_OK;
}

void sv_leaf_splat_destroy(struct sv_leaf_splat *splat)
{
    if (!splat)
        return;
    for (int k = 0; k < splat->species_count; k++)
        sv_leaf_form_finish(&splat->species[k].form);
    free(splat->species);
    free(splat->job);
    free(splat->seen);
    free(splat->sample_depth);
    free(splat->sample_color);
    free(splat->list);
    free(splat->sorted);
    free(splat->tile_far);
    free(splat->tile_state);
    free(splat->tile_touched);
    free(splat->tile_fresh);
    free(splat);
}

struct sv_leaf_species *sv_leaf_owner(const struct sv_leaf_splat *splat, int species)
{
    if (species < 0 || species >= splat->species_count || !splat->species[species].mesh)
        return NULL;
    return &splat->species[splat->species[species].owner];
}

enum sv_status sv_leaf_splat_prepare(struct sv_leaf_splat *splat, int species, struct sv_error *error)
{
    struct sv_leaf_species *s = sv_leaf_owner(splat, species);
    if (!s || s->made)
        return SV_OK;
    enum sv_status status = sv_leaf_form_init(s->mesh, &s->form, error);
    s->made = status == SV_OK;
    return status;
}

size_t sv_leaf_splat_bytes(const struct sv_leaf_splat *splat, int species)
{
    const struct sv_leaf_species *s = sv_leaf_owner(splat, species);
    return s && s->made && s == &splat->species[species] ? s->form.bytes : 0;
}

/* ---- thinning out ---- */

float sv_leaf_splat_fraction(const struct sv_leaf_splat *splat, int species, double height_px)
{
    const struct sv_leaf_species *s = sv_leaf_owner(splat, species);
    if (!s || !s->made || s->form.leaf_count == 0 || !(s->form.leaf_area > 0))
        return 1;
    double area = (double)s->form.leaf_area * height_px * height_px, f = area / CARD_PX2;
    return f >= 1 || !(f == f) ? 1 : (float)fmax(f, FRACTION_MIN);
}

/* ---- the draw call ---- */

static enum sv_status make_room(struct sv_leaf_splat *splat, size_t pixels, size_t tiles,
                                struct sv_error *error)
{
    if (splat->seen_room < pixels) {
        free(splat->seen);
        splat->seen = calloc(pixels, sizeof *splat->seen);
        splat->seen_room = splat->seen ? pixels : 0;
    }
    if (splat->tile_room < tiles) {
        free(splat->tile_far);
        free(splat->tile_state);
        free(splat->tile_touched);
        free(splat->tile_fresh);
        splat->tile_far = malloc(tiles * sizeof *splat->tile_far);
        splat->tile_state = malloc(tiles);
        splat->tile_touched = calloc(tiles, 1);
        splat->tile_fresh = malloc(tiles);
        bool all = splat->tile_far && splat->tile_state && splat->tile_touched && splat->tile_fresh;
        splat->tile_room = all ? tiles : 0;
    }
    if (!splat->seen_room || !splat->tile_room)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory to draw leaves on %zu pixels", pixels);
    return SV_OK;
}

void sv_leaf_splat_set_level(struct sv_leaf_splat *splat, enum sv_simd level)
{
    splat->kernel = sv_leaf_kernel_at(level);
}

static enum sv_status make_samples(struct sv_leaf_splat *splat, size_t n, struct sv_error *error)
{
    if (splat->sample_room >= n)
        return SV_OK;
    free(splat->sample_depth);
    free(splat->sample_color);
    splat->sample_depth = malloc(n * sizeof *splat->sample_depth);
    splat->sample_color = malloc(n * 4);
    splat->sample_room = splat->sample_depth && splat->sample_color ? n : 0;
    return splat->sample_room ? SV_OK : sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu samples", n);
}

/* One pixel from its samples, first of which is `at` of the band's. */
static void end_pixel(const struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass, size_t pixel,
                      size_t at)
{
    size_t columns = (size_t)(pass->canvas->width * pass->across);
    int covered = 0, samples = pass->across * pass->down;
    float sum[3] = {0}, nearest = 0;
    for (int k = 0; k < samples; k++) {
        size_t p = at + (size_t)(k / pass->across) * columns + (size_t)(k % pass->across);
        const uint8_t *c = splat->sample_color + 4 * p;
        if (c[3] == 0)
            continue;
        covered++;
        nearest = fmaxf(nearest, splat->sample_depth[p]);
        for (int a = 0; a < 3; a++)
            sum[a] += sv_linear_from_srgb8[c[a]];
    }
    if (covered == 0)
        return;
    uint8_t *to = pass->canvas->color + 4 * pixel;
    bool half = 2 * covered >= samples || (pass->canvas->surface && to[3] < 128);
    float bare = (float)(samples - covered), each = 1 / (float)samples;
    for (int a = 0; a < 3; a++)
        to[a] = sv_srgb8_from_linear((sum[a] + bare * sv_linear_from_srgb8[to[a]]) * each);
    to[3] = (uint8_t)(((float)covered * 255 + bare * (float)to[3]) * each + 0.5f);
    if (half)
        pass->canvas->depth[pixel] = nearest;
}

/* Pixels of the tiles that were begun. */
static void end_samples(const struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass, size_t tiles)
{
    const struct sv_canvas *band = pass->canvas;
    size_t columns = (size_t)(band->width * pass->across);
    int w = TILE / pass->across, h = TILE / pass->down;
    for (size_t tile = 0; tile < tiles; tile++) {
        if (splat->tile_state[tile] == SV_LEAF_TILE_RAW)
            continue;
        int i0 = (int)(tile % (size_t)pass->tiles_x) * w, j0 = (int)(tile / (size_t)pass->tiles_x) * h;
        for (int j = j0; j < j0 + h && j < band->row_count; j++)
            for (int i = i0; i < i0 + w && i < band->width; i++)
                end_pixel(splat, pass, (size_t)j * (size_t)band->width + (size_t)i,
                          (size_t)(j * pass->down) * columns + (size_t)(i * pass->across));
    }
}

enum sv_status sv_leaf_band_begin(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                                  struct sv_error *error)
{
    const struct sv_camera *camera = &pass->view->camera;
    const struct sv_canvas *band = pass->canvas;
    int width = band->width * pass->across, height = band->row_count * pass->down;
    pass->center[0] = (0.5 * camera->width - pass->view->shift_x_px) * pass->across - 0.5;
    pass->center[1] = (0.5 * camera->height - pass->view->shift_y_px) * pass->down - 0.5;
    pass->tiles_x = (width + TILE - 1) / TILE;
    pass->tiles = (size_t)pass->tiles_x * (size_t)((height + TILE - 1) / TILE);
    enum sv_status status = make_room(splat, (size_t)width * (size_t)height, pass->tiles, error);
    if (!status && pass->sampled)
        status = make_samples(splat, (size_t)width * (size_t)height, error);
    if (status)
        return status;
    memset(splat->tile_state, pass->sampled ? SV_LEAF_TILE_RAW : SV_LEAF_TILE_OLD, pass->tiles);
    memset(splat->tile_fresh, 0, pass->tiles);
    memset(splat->tile_far, 0, pass->tiles * sizeof *splat->tile_far);
    pass->color = pass->sampled ? splat->sample_color : band->color;
    splat->job->depth = pass->sampled ? splat->sample_depth : band->depth;
    splat->job->seen = splat->seen;
    splat->job->tile_far = splat->tile_far;
    splat->job->tiles_x = pass->tiles_x;
    return SV_OK;
}

enum sv_status sv_leaf_band_draw(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                                 struct sv_error *error)
{
    const struct sv_leaf_splat_trees *list = pass->trees;
    enum sv_status status = SV_OK;
    for (uint32_t k = 0; k < list->count && !status; k++) {
        pass->tree = &list->trees[list->entries[k].tree];
        status = sv_leaf_draw_tree(splat, pass, k, list->entries[k].tree, error);
    }
    return status;
}

static bool lattice_of(int samples, int *across, int *down)
{
    static const struct {
        int samples, across, down;
    } lattice[] = {{1, 1, 1}, {2, 1, 2}, {4, 2, 2}, {8, 4, 2}, {16, 4, 4}};
    for (size_t k = 0; k < sizeof lattice / sizeof *lattice; k++)
        if (lattice[k].samples == samples) {
            *across = lattice[k].across;
            *down = lattice[k].down;
            return true;
        }
    return false;
}

enum sv_status sv_leaf_pass_init(const struct sv_leaf_splat *splat, const struct sv_leaf_view *view,
                                 int samples, struct sv_leaf_pass *pass, struct sv_error *error)
{
    *pass = (struct sv_leaf_pass){
        .kernel = splat->kernel, .view = view, .focal = sv_camera_focal_px(&view->camera)};
    if (!lattice_of(samples, &pass->across, &pass->down))
        return sv_fail(error, SV_EINVAL, "samples", "%d samples a pixel: 1, 2, 4, 8 or 16", samples);
    pass->sampled = samples > 1;
    pass->focal_x = pass->focal * pass->across;
    pass->focal_y = pass->focal * pass->down;
    return SV_OK;
}

enum sv_status sv_leaf_splat_draw(struct sv_leaf_splat *splat, const struct sv_leaf_view *view,
                                  const struct sv_canvas *canvas, const struct sv_leaf_splat_trees *trees,
                                  struct sv_leaf_splat_stats *stats, struct sv_error *error)
{
    const struct sv_camera *camera = &view->camera;
    if (canvas->width != camera->width || canvas->height != camera->height)
        return sv_fail(error, SV_EINVAL, "canvas", "%d x %d px, the camera has %d x %d", canvas->width,
                       canvas->height, camera->width, camera->height);
    struct sv_leaf_pass pass;
    enum sv_status status = sv_leaf_pass_init(splat, view, trees->samples, &pass, error);
    if (status)
        return status;
    if (trees->samples > 1 && (canvas->id || canvas->normal))
        return sv_fail(error, SV_EINVAL, "samples", "ids and normals are of one sample a pixel, not of %d",
                       trees->samples);
    pass.trees = trees;
    int samples = trees->samples, room = samples > 1 ? BAND_SAMPLES / samples : BAND_PIXELS;
    int last = canvas->row_first + canvas->row_count, most = room / canvas->width;
    most = most > TILE ? most / TILE * TILE : TILE;
    for (int row = canvas->row_first; row < last && trees->count > 0 && !status; row += most) {
        struct sv_canvas band = sv_canvas_band(canvas, row, row + most < last ? most : last - row);
        pass.canvas = &band;
        status = sv_leaf_band_begin(splat, &pass, error);
        if (!status)
            status = sv_leaf_band_draw(splat, &pass, error);
        if (!status && pass.sampled)
            end_samples(splat, &pass, pass.tiles);
    }
    if (!status && stats)
        *stats = pass.stats;
    return status;
}
