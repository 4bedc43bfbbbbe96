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
    struct sv_warp_buffer b = {.width = width, .height = height, .x1 = width, .y1 = height};
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
    buffer->y0 = y0 < buffer->y0 ? y0 : buffer->y0;
    buffer->x1 = x1 > buffer->x1 ? x1 : buffer->x1;
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

/* Position (u, v) on the bilinear patch of cell (c, j): picture place and its derivatives by u and v. False
 * when it is not in front. */
static bool patch_project(const struct sv_warp_source *source, int c, int j, double s, double r,
                          double out[2], double du[2], double dv[2])
{
    const float *t = source->t + (size_t)j * (size_t)source->width + (size_t)c;
    double t00 = t[0], t10 = t[1], t01 = t[source->width], t11 = t[source->width + 1];
    double top = t00 + s * (t10 - t00), low = t01 + s * (t11 - t01), d = top + r * (low - top);
    double ts = (t10 - t00) + r * ((t11 - t01) - (t10 - t00)), tr = low - top;
    double h[4], hu[4], hv[4];
    for (int k = 0; k < 4; k++) {
        const double *m = source->map.m[k];
        h[k] = m[0] * (c + 0.5 + s) + m[1] * (j + 0.5 + r) + m[2] * d + m[3];
        hu[k] = m[0] + m[2] * ts;
        hv[k] = m[1] + m[2] * tr;
    }
    for (int k = 0; k < 2; k++) {
        out[k] = h[k] / h[3];
        du[k] = (hu[k] - out[k] * hu[3]) / h[3];
        dv[k] = (hv[k] - out[k] * hv[3]) / h[3];
    }
    return h[3] > 0;
}

/* One Newton step from (s, r) towards picture place (px, py); left alone where the patch is seen edge-on or
 * the step leaves the cell by more than a quarter of a texel (what the splat found stands). */
static void patch_refine(const struct sv_warp_source *source, int c, int j, double px, double py, double *s,
                         double *r)
{
    double at[2], du[2], dv[2];
    if (!patch_project(source, c, j, *s, *r, at, du, dv))
        return;
    double det = du[0] * dv[1] - du[1] * dv[0], x = px - at[0], y = py - at[1];
    double s1 = *s + (x * dv[1] - y * dv[0]) / det, r1 = *r + (y * du[0] - x * du[1]) / det;
    if (!(fabs(s1 - 0.5) <= 0.75 && fabs(r1 - 0.5) <= 0.75))
        return;
    *s = s1;
    *r = r1;
}

bool sv_warp_locate(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int i, int j,
                    double *u, double *v)
{
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
    uint32_t texel = buffer->texel[p], place = buffer->place[p];
    if (texel == SV_WARP_EMPTY)
        return false;
    const struct sv_warp_source *source = sources + (texel >> SV_WARP_TEXEL_BITS & 31);
    uint32_t index = texel & ((UINT32_C(1) << SV_WARP_TEXEL_BITS) - 1);
    int c = (int)(index % (uint32_t)source->width), row = (int)(index / (uint32_t)source->width);
    double s = ((double)(place >> 8) + 0.5) / 256, r = ((double)(place >> 1 & 127) + 0.5) / 128;
    if (place & 1) {
        patch_refine(source, c, row, i + 0.5, j + 0.5, &s, &r);
        *u = c + 0.5 + s;
        *v = row + 0.5 + r;
        return true;
    }
    *u = c + s;
    *v = row + r;
    return true;
}
