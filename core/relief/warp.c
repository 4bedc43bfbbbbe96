/* warp.c - maps from cameras, the buffer, and where on its source a pixel looks. */
#include "core/relief/warp.h"

#include <stdlib.h>
#include <string.h>

#include "core/relief/warp_kernel.h"

enum { PICTURE_MAX = 16384 };

/* Row r of clip_from_local applied to O - eye + u a + v b + t f. */
static void relief_row(const struct sv_relief_frame *frame, struct sv_vec3 origin, const double clip[4],
                       double row[4])
{
    struct sv_vec3 c = sv_vec3(clip[0], clip[1], clip[2]);
    row[0] = sv_dot(c, frame->a);
    row[1] = sv_dot(c, frame->b);
    row[2] = sv_dot(c, frame->f);
    row[3] = sv_dot(c, origin) + clip[3];
}

/* Clip space to window: px = (1 + X / W) width / 2, py = (1 - Y / W) height / 2 (row 0 at the top), d = Z / W
 * (clip depth is in [0, 1]: camera.h). */
void sv_warp_map_from_camera(const struct sv_relief_frame *frame, const struct sv_camera *camera,
                             double shift_x_px, double shift_y_px, struct sv_warp_map *map)
{
    struct sv_mat4 clip;
    double row[4][4];
    struct sv_vec3 origin = sv_sub(frame->origin, camera->eye);
    sv_camera_clip_from_local(camera, shift_x_px, shift_y_px, &clip);
    for (int i = 0; i < 4; i++)
        relief_row(frame, origin, clip.m[i], row[i]);
    for (int k = 0; k < 4; k++) {
        map->m[0][k] = 0.5 * camera->width * (row[3][k] + row[0][k]);
        map->m[1][k] = 0.5 * camera->height * (row[3][k] - row[1][k]);
        map->m[2][k] = row[2][k];
        map->m[3][k] = row[3][k];
    }
}

enum sv_status sv_warp_buffer_create(int width, int height, struct sv_warp_buffer *buffer,
                                     struct sv_error *error)
{
    if (width < 1 || height < 1 || width > PICTURE_MAX || height > PICTURE_MAX)
        return sv_fail(error, SV_EINVAL, width < 1 || width > PICTURE_MAX ? "width" : "height",
                       "a picture to warp into has 1 to %d px a side, not %d x %d", PICTURE_MAX, width,
                       height);
    size_t n = (size_t)width * (size_t)height;
    struct sv_warp_buffer b = {.width = width, .height = height, .end = height, .x1 = width, .y1 = height};
    b.depth = malloc(n * sizeof *b.depth);
    b.texel = malloc(n * sizeof *b.texel);
    b.place = calloc(n, sizeof *b.place);
    b.tears = calloc(1, sizeof *b.tears);
    if (!b.depth || !b.texel || !b.place || !b.tears) {
        sv_warp_buffer_finish(&b);
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a warp of %d x %d px", width, height);
    }
    sv_warp_clear(&b);
    *buffer = b;
    return SV_OK;
}

void sv_warp_buffer_limit(struct sv_warp_buffer *buffer, int first, int end)
{
    sv_warp_clear(buffer);
    buffer->first = first;
    buffer->end = end;
}

void sv_warp_buffer_finish(struct sv_warp_buffer *buffer)
{
    free(buffer->depth);
    free(buffer->texel);
    free(buffer->place);
    if (buffer->tears) {
        free(buffer->tears->items);
        free(buffer->tears->holes);
    }
    free(buffer->tears);
    memset(buffer, 0, sizeof *buffer);
}

void sv_warp_clear(struct sv_warp_buffer *buffer)
{
    if (buffer->x0 < buffer->x1 && buffer->y0 < buffer->y1) {
        size_t n = (size_t)(buffer->x1 - buffer->x0);
        for (int y = buffer->y0; y < buffer->y1; y++) {
            size_t p = (size_t)y * (size_t)buffer->width + (size_t)buffer->x0;
            memset(buffer->depth + p, 0, n * sizeof *buffer->depth);
            memset(buffer->texel + p, 0xff, n * sizeof *buffer->texel);
        }
    }
    buffer->x0 = buffer->width;
    buffer->y0 = buffer->height;
    buffer->x1 = buffer->y1 = 0;
    buffer->tears->count = 0;
}

void sv_warp_touch(struct sv_warp_buffer *buffer, int x0, int y0, int x1, int y1)
{
    buffer->x0 = x0 < buffer->x0 ? x0 : buffer->x0;
    buffer->x1 = x1 > buffer->x1 ? x1 : buffer->x1;
    y0 = y0 > buffer->first ? y0 : buffer->first;
    y1 = y1 < buffer->end ? y1 : buffer->end;
    buffer->y0 = y0 < buffer->y0 ? y0 : buffer->y0;
    buffer->y1 = y1 > buffer->y1 ? y1 : buffer->y1;
}

void sv_warp_tear_add(struct sv_warp_buffer *buffer, const struct sv_warp_tear *tear)
{
    struct sv_warp_tears *tears = buffer->tears;
    if (tears->count == tears->room) {
        size_t room = tears->room ? tears->room * 2 : 256;
        struct sv_warp_tear *items = realloc(tears->items, room * sizeof *items);
        if (!items) {
            return; /* what it opens stays a hole */
        }
        tears->items = items;
        tears->room = room;
    }
    tears->items[tears->count++] = *tear;
}

/* A quarter of a texel's footprint, as the splat has the surface there (warp_cell.c): t at the texel's
 * centre, at the middles of its two edges, and at the cell's middle; in a whole cell that is the bilinear
 * surface. */
struct quarter {
    int column, row, h, v; /* the texel; which side of its centre: -1, 1 */
    double t[2][2];        /* [along v][along u], 0: at the centre */
};

static bool texel_is_there(const struct sv_warp_source *source, int c, int j)
{
    size_t at = (size_t)j * (size_t)source->width + (size_t)c;
    return c >= 0 && j >= 0 && c < source->width && j < source->height && source->color[at][3] >= 128 &&
           isfinite(source->t[at]);
}

static double texel_t(const struct sv_warp_source *source, int c, int j)
{
    return source->t[(size_t)j * (size_t)source->width + (size_t)c];
}

static bool are_joined(const struct sv_warp_source *source, int c0, int j0, int c1, int j1)
{
    if (!texel_is_there(source, c0, j0) || !texel_is_there(source, c1, j1))
        return false;
    return fabsf((float)texel_t(source, c0, j0) - (float)texel_t(source, c1, j1)) <= source->cut;
}

static void quarter_set(const struct sv_warp_source *source, struct quarter *q)
{
    int c = q->column, j = q->row, c1 = c + q->h, j1 = j + q->v;
    bool h = are_joined(source, c, j, c1, j), v = are_joined(source, c, j, c, j1);
    bool far_h = are_joined(source, c, j1, c1, j1), far_v = are_joined(source, c1, j, c1, j1);
    bool diagonal = (h && far_v) || (v && far_h);
    bool has_h = h || (v && far_h && far_v), has_v = v || (h && far_v && far_h);
    double own = texel_t(source, c, j), sum = own;
    sum += has_h ? texel_t(source, c1, j) : 0;
    sum += has_v ? texel_t(source, c, j1) : 0;
    sum += diagonal ? texel_t(source, c1, j1) : 0;
    q->t[0][0] = own;
    q->t[0][1] = h ? 0.5 * (own + texel_t(source, c1, j)) : own;
    q->t[1][0] = v ? 0.5 * (own + texel_t(source, c, j1)) : own;
    q->t[1][1] = sum / (1 + has_h + has_v + diagonal);
}

/* One Newton step towards picture place (px, py) on the quarter's surface; false when it leads nowhere. */
static bool quarter_step(const struct sv_warp_source *source, const struct quarter *q, double px, double py,
                         double *u, double *v)
{
    double a = 2 * q->h * (*u - q->column - 0.5), b = 2 * q->v * (*v - q->row - 0.5), w[4], wu[4], wv[4];
    double near = q->t[0][0] + a * (q->t[0][1] - q->t[0][0]),
           far = q->t[1][0] + a * (q->t[1][1] - q->t[1][0]);
    double t = near + b * (far - near), tv = 2 * q->v * (far - near);
    double tu = 2 * q->h * ((1 - b) * (q->t[0][1] - q->t[0][0]) + b * (q->t[1][1] - q->t[1][0]));
    for (int k = 0; k < 4; k++) {
        const double *m = source->map.m[k];
        w[k] = m[0] * *u + m[1] * (source->row0 + *v) + m[2] * t + m[3];
        wu[k] = m[0] + m[2] * tu;
        wv[k] = m[1] + m[2] * tv;
    }
    double x = px - w[0] / w[3], y = py - w[1] / w[3]; /* derivatives of w[k] / w[3], times w[3] */
    double xu = wu[0] - w[0] / w[3] * wu[3], yu = wu[1] - w[1] / w[3] * wu[3];
    double xv = wv[0] - w[0] / w[3] * wv[3], yv = wv[1] - w[1] / w[3] * wv[3];
    double scale = w[3] / (xu * yv - yu * xv), du = scale * (x * yv - y * xv), dv = scale * (y * xu - x * yu);
    if (!(w[3] > 0 && fabs(du) <= 0.5 && fabs(dv) <= 0.5))
        return false;
    *u += du;
    *v += dv;
    return true;
}

/* Takes the place over to the neighbour where it has left texel q; back to the edge where they are torn. */
static void quarter_move(const struct sv_warp_source *source, struct quarter *q, double *u, double *v)
{
    int c = (int)floor(*u), j = (int)floor(*v);
    if (c != q->column && !are_joined(source, q->column, q->row, c, q->row)) {
        *u = c < q->column ? q->column : q->column + 1;
        c = q->column;
    }
    if (j != q->row && !are_joined(source, c, q->row, c, j)) {
        *v = j < q->row ? q->row : q->row + 1;
        j = q->row;
    }
    q->column = c;
    q->row = j;
    q->h = *u < c + 0.5 ? -1 : 1;
    q->v = *v < j + 0.5 ? -1 : 1;
}

bool sv_warp_locate(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int i, int j,
                    double *u, double *v)
{
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
    uint32_t texel = buffer->texel[p], place = buffer->place[p];
    if (texel == SV_WARP_EMPTY)
        return false;
    const struct sv_warp_source *source = sources + (texel >> SV_WARP_TEXEL_BITS & (SV_WARP_SOURCES_MAX - 1));
    uint32_t index = texel & SV_WARP_TEXEL_MASK;
    int c = (int)(index % (uint32_t)source->width), row = (int)(index / (uint32_t)source->width);
    double half = place & 1 ? 0.5 : 0;
    *u = c + half + ((double)(place >> 8) + 0.5) / 256;
    *v = row + half + ((double)(place >> 1 & 127) + 0.5) / 128;
    if (texel & SV_WARP_FILLED)
        return true;
    struct quarter q = {.column = (int)*u, .row = (int)*v};
    double from_u = *u, from_v = *v, at_u = *u, at_v = *v;
    for (int step = 0; step < 5; step++) {
        quarter_move(source, &q, &at_u, &at_v);
        quarter_set(source, &q);
        if (!quarter_step(source, &q, i + 0.5, j + 0.5, &at_u, &at_v) || fabs(at_u - from_u) > 0.5 ||
            fabs(at_v - from_v) > 0.5)
            return true; /* seen edge-on: what the splat found stands */
    }
    quarter_move(source, &q, &at_u, &at_v);
    *u = at_u;
    *v = at_v;
    return true;
}
