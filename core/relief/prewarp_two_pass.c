/* prewarp_two_pass.c - the two-pass serial warp of relief textures (Oliveira, Bishop and McAllister 2000,
 * section 5), in the form that they call pipelined: as soon as a row is done by pass 1, pass 2 draws what
 * lies between it and its neighbour, so that the intermediate picture is two rows and need not decide what is
 * seen.
 *
 * Order. Rows from the border of the texture towards the row of the epipole, from both sides; inside a row
 * texels from the border towards the epipole's column: McMillan's four quadrants, split at e clamped to the
 * texture. prewarp.h derives that this is from far to near for an eye on either side; what comes later
 * overwrites, and no depth is compared between rows. For parallel projection e is infinitely far and one
 * quadrant is left. A panel from which the eye has moved back is drawn the other way round, from the epipole
 * outward.
 *
 * Which axis first: pass 2 joins what lies in one column of samples in neighbouring rows; where pass 1 has
 * compressed a row, or shifts differ from row to row, that is far apart along the row, and is drawn cell by
 * cell instead. The axis along which it is nearer together needs less of that (prewarp_window.c). The code
 * below knows a first and a second axis only.
 */
#include <stdlib.h>
#include <string.h>

#include "core/relief/prewarp_private.h"

void sv_warped_finish(struct sv_warped *warped)
{
    free(warped->block);
    *warped = (struct sv_warped){0};
}

static enum sv_status check(const struct sv_relief *relief, const struct sv_prewarp *prewarp,
                            const struct sv_prewarp_options *options, struct sv_error *error)
{
    int max = SV_PREWARP_SIDE_MAX;
    if (relief->width < 1 || relief->height < 1 || relief->width > SV_RELIEF_SIDE_MAX ||
        relief->height > SV_RELIEF_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "relief", "%d x %d texels is outside 1 .. %d a side", relief->width,
                       relief->height, SV_RELIEF_SIDE_MAX);
    if (options->width < 0 || options->height < 0 || options->width > max || options->height > max)
        return sv_fail(error, SV_EINVAL, "options", "%d x %d samples is outside 0 .. %d a side",
                       options->width, options->height, max);
    if (!(prewarp->near > 0))
        return sv_fail(error, SV_EINVAL, "prewarp", "near = %g is not above 0", prewarp->near);
    return SV_OK;
}

static enum sv_status alloc_out(const struct sv_prewarp_extent *extent,
                                const struct sv_prewarp_options *options, struct sv_warped *out,
                                struct sv_error *error)
{
    double nu = fmin(extent->u1 - extent->u0, SV_PREWARP_SIDE_MAX);
    double nv = fmin(extent->v1 - extent->v0, SV_PREWARP_SIDE_MAX);
    *out = (struct sv_warped){.width = options->width > 0 ? options->width : (int)nu,
                              .height = options->height > 0 ? options->height : (int)nv,
                              .u0 = extent->u0,
                              .v0 = extent->v0,
                              .u1 = extent->u1,
                              .v1 = extent->v1};
    size_t n = (size_t)out->width * (size_t)out->height;
    out->block = malloc(n * (sizeof *out->color + sizeof *out->displ + sizeof *out->texel));
    if (!out->block)
        return sv_fail(error, SV_ENOMEM, "options", "no memory for %d x %d samples", out->width, out->height);
    out->displ = out->block;
    out->texel = (uint32_t *)(out->displ + n);
    out->color = (uint8_t(*)[4])(out->texel + n);
    memset(out->displ, 0, n * sizeof *out->displ);
    memset(out->texel, 0xFF, n * sizeof *out->texel);
    memset(out->color, 0, n * sizeof *out->color);
    return SV_OK;
}

static struct sv_prewarp_work make_work(const struct sv_relief *relief, const struct sv_prewarp *prewarp,
                                        const struct sv_prewarp_options *options, struct sv_warped *out)
{
    const double *k = prewarp->k;
    double ku = k[0] + k[3], kv = k[1] + k[4];
    bool turned = out->columns_first;
    double scale_u = out->width / (out->u1 - out->u0), scale_v = out->height / (out->v1 - out->v0);
    return (struct sv_prewarp_work){.relief = relief,
                                    .color =
                                        options->color ? options->color : (const uint8_t(*)[4])relief->color,
                                    .width = turned ? relief->height : relief->width,
                                    .height = turned ? relief->width : relief->height,
                                    .step_u = turned ? (size_t)relief->width : 1,
                                    .step_v = turned ? 1 : (size_t)relief->width,
                                    .k1 = turned ? kv : ku,
                                    .k2 = turned ? ku : kv,
                                    .k3 = k[2],
                                    .near = prewarp->near,
                                    .toward = prewarp->behind ? -1 : 1,
                                    .outward = prewarp->outward,
                                    .epipole_u = prewarp->epipole[turned],
                                    .epipole_v = prewarp->epipole[!turned],
                                    .out_width = turned ? out->height : out->width,
                                    .out_height = turned ? out->width : out->height,
                                    .out_step_x = turned ? (size_t)out->width : 1,
                                    .out_step_y = turned ? 1 : (size_t)out->width,
                                    .u0 = turned ? out->v0 : out->u0,
                                    .v0 = turned ? out->u0 : out->v0,
                                    .scale_u = turned ? scale_v : scale_u,
                                    .scale_v = turned ? scale_u : scale_v,
                                    .out = out};
}

/* Bytes rounded up so that any array may follow. */
static size_t padded(size_t bytes)
{
    return (bytes + 15) & ~(size_t)15;
}

/* Three rows, the order along them and what pass 2 remembers of a column, in one block. */
static void *alloc_rows(struct sv_prewarp_work *w, struct sv_prewarp_row rows[3], struct sv_error *error)
{
    size_t texels = padded((size_t)w->width * sizeof *rows->texel), samples = (size_t)w->out_width;
    size_t counts = padded(samples * sizeof *rows->count), landed = padded(samples * sizeof *rows->samples);
    size_t order = padded(((size_t)w->width + 1) * sizeof *w->order_u), apart = padded(samples);
    size_t cells = padded((size_t)w->width + 1);
    char *block = malloc(order + cells + apart + 3 * (texels + counts + landed)), *at = block;
    if (!block) {
        (void)sv_fail(error, SV_ENOMEM, "relief", "no memory for three rows of %d texels", w->width);
        return NULL;
    }
    w->order_u = (int32_t *)at;
    w->cells = (uint8_t *)(at += order);
    w->apart = (uint8_t *)(at += cells);
    at += apart;
    for (int k = 0; k < 3; k++) {
        struct sv_prewarp_row *r = &rows[k];
        r->texel = (struct sv_prewarp_vertex *)at;
        r->samples = (struct sv_prewarp_sample *)(at += texels);
        r->count = (uint32_t *)(at += landed);
        at += counts;
    }
    return block;
}

/* Rows from the interval that holds the epipole to both borders. Interval j lies between rows j - 1 and j. */
static void warp_rows_outward(const struct sv_prewarp_work *w, struct sv_prewarp_row rows[3])
{
    struct sv_prewarp_row *top = NULL, *bottom = NULL, *first = &rows[0], *spare = &rows[2];
    if (w->split_v > 0)
        sv_prewarp_warp_row(w, w->split_v - 1, top = &rows[1]);
    if (w->split_v < w->height)
        sv_prewarp_warp_row(w, w->split_v, bottom = first);
    sv_prewarp_warp_columns(w, w->split_v, top, bottom);
    for (int j = w->split_v - 1; j >= 0; j--) {
        struct sv_prewarp_row *before = j > 0 ? spare : NULL;
        if (before)
            sv_prewarp_warp_row(w, j - 1, before);
        sv_prewarp_warp_columns(w, j, before, top);
        spare = top;
        top = before;
    }
    spare = &rows[1];
    for (int j = w->split_v + 1; j <= w->height; j++) {
        struct sv_prewarp_row *after = j < w->height ? spare : NULL;
        if (after)
            sv_prewarp_warp_row(w, j, after);
        sv_prewarp_warp_columns(w, j, bottom, after);
        spare = bottom;
        bottom = after;
    }
}

/* Rows from both borders to the interval that holds the epipole. */
static void warp_rows(const struct sv_prewarp_work *w, struct sv_prewarp_row rows[3])
{
    struct sv_prewarp_row *top = NULL, *bottom = NULL, *next = &rows[0], *spare = &rows[1];
    for (int j = 0; j < w->split_v; j++) {
        sv_prewarp_warp_row(w, j, next);
        sv_prewarp_warp_columns(w, j, top, next);
        top = next;
        next = spare;
        spare = top;
    }
    spare = &rows[2];
    for (int j = w->height; j > w->split_v; j--) {
        sv_prewarp_warp_row(w, j - 1, next);
        sv_prewarp_warp_columns(w, j, next, bottom);
        bottom = next;
        next = spare;
        spare = bottom;
    }
    sv_prewarp_warp_columns(w, w->split_v, top, bottom);
}

enum sv_status sv_prewarp_two_pass(const struct sv_relief *relief, const struct sv_prewarp *prewarp,
                                   const struct sv_prewarp_options *options, struct sv_warped *warped,
                                   struct sv_error *error)
{
    struct sv_prewarp_extent extent;
    struct sv_warped out = {0};
    struct sv_prewarp_row rows[3];
    enum sv_status status = check(relief, prewarp, options, error);
    if (!status)
        status = sv_prewarp_extent(relief, prewarp, &extent, error);
    if (!status)
        status = alloc_out(&extent, options, &out, error);
    if (status)
        return status;
    out.columns_first = options->order == SV_PREWARP_ORDER_AUTO ? extent.lost_v < extent.lost_u
                                                                : options->order == SV_PREWARP_COLUMNS_FIRST;
    struct sv_prewarp_work work = make_work(relief, prewarp, options, &out);
    void *block = alloc_rows(&work, rows, error);
    if (!block) {
        sv_warped_finish(&out);
        return SV_ENOMEM;
    }
    (void)sv_prewarp_order(work.width + 1, work.epipole_u + 0.5, work.outward, work.order_u);
    double split = work.epipole_v + 0.5; /* intervals between centres lie half a texel before their number */
    work.split_v = !(split >= 0) ? 0 : split >= work.height ? work.height : (int)split;
    if (work.outward)
        warp_rows_outward(&work, rows);
    else
        warp_rows(&work, rows);
    status = sv_prewarp_fill(&work, options->fill, error);
    free(block);
    if (status)
        sv_warped_finish(&out);
    else
        *warped = out;
    return status;
}
