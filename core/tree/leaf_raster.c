/* leaf_raster.c - the plain-loop kernels of leaf_kernel.h: project, raster, settle. */
#include "core/tree/leaf_kernel.h"

#include <math.h>

#include "core/tree/leaf_shade.h"

static const struct sv_leaf_kernel *const self = &sv_leaf_scalar;

static int queue_of(int nx, int ny)
{
    int side = nx > ny ? nx : ny, q = 0;
    while (side > sv_leaf_side[q])
        q++;
    return q;
}

static void enqueue(struct sv_leaf_job *job, const struct sv_leaf_kernel *kernel, const float v[9],
                    const int box[4], uint32_t piece)
{
    int rows[2];
    if (!sv_leaf_rows(&job->eye, box[1], box[3], rows))
        return;
    int q = queue_of(box[2], box[3]);
    struct sv_leaf_queue *queue = &job->queue[q];
    int n = queue->count++;
    for (int k = 0; k < 9; k++)
        queue->v[k][n] = v[k];
    queue->i0[n] = box[0];
    queue->j0[n] = box[1];
    queue->nx[n] = box[2];
    queue->ny[n] = box[3];
    queue->piece[n] = piece;
    if (queue->count >= SV_LEAF_QUEUE)
        kernel->raster(job, q);
}

/* Pixels whose centres lie in [lo, hi], 0 .. size - 1; false when there is none, or a NaN. */
static bool pixel_range(float lo, float hi, int size, int *first, int *count)
{
    if (!(lo <= hi))
        return false;
    float a = ceilf(sv_leaf_max(lo - SV_LEAF_MARGIN, 0));
    float b = floorf(sv_leaf_min(hi + SV_LEAF_MARGIN, (float)(size - 1)));
    if (!(a <= b))
        return false;
    *first = (int)a;
    *count = (int)(b - a + 1);
    return true;
}

/* Corner k of a piece around its rim from P0; 3 corners of a triangle, 4 of a card. */
static void corner_of(const float v[9], bool card, int k, float p[3])
{
    for (int c = 0; c < 3; c++) {
        float a = v[3 + c], b = v[6 + c];
        p[c] = k == 0 ? v[c] : k == 1 ? v[c] + a : k == 2 && card ? (v[c] + a) + b : v[c] + b;
    }
}

void sv_leaf_queue_crossing(struct sv_leaf_job *job, const struct sv_leaf_kernel *kernel, const float v[9],
                            bool card, uint32_t piece)
{
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    int corners = card ? 4 : 3, box[4];
    for (int k = 0; k < corners; k++) {
        float p[3], q[3];
        corner_of(v, card, k, p);
        corner_of(v, card, (k + 1) % corners, q);
        bool in = p[2] >= job->eye.near_m, next_in = q[2] >= job->eye.near_m;
        for (int end = 0; end < 2; end++) {
            if (end ? in == next_in : !in)
                continue; /* 0: the corner, 1: where the rim crosses */
            float t = end ? (job->eye.near_m - p[2]) / (q[2] - p[2]) : 0;
            float z = end ? job->eye.near_m : p[2];
            for (int c = 0; c < 2; c++) {
                float at = (p[c] + t * (q[c] - p[c])) / z;
                lo[c] = fminf(lo[c], at);
                hi[c] = fmaxf(hi[c], at);
            }
        }
    }
    /* Rounding is large this near; a pixel more costs little. */
    if (pixel_range(lo[0] - 1, hi[0] + 1, job->eye.width, &box[0], &box[2]) &&
        pixel_range(lo[1] - 1, hi[1] + 1, job->eye.height, &box[1], &box[3]))
        enqueue(job, kernel, v, box, piece);
}

/* Moves lane `lane` of a block into the picture: P0, E1, E2 as A, B, C. False: thinned out. */
static bool move_piece(const struct sv_leaf_job *job, uint32_t block, int lane,
                       const struct sv_leaf_thin *thin, float v[9])
{
    const struct sv_leaf_block *b = &job->form->blocks[block];
    float k = 1, p[3][3];
    if (thin) {
        float growth = (thin->upto - job->form->fades[block].rank[lane]) / thin->window;
        if (!(growth > 0))
            return false;
        k = thin->scale * sqrtf(sv_leaf_min(growth, 1));
    }
    for (int c = 0; c < 3; c++) {
        p[0][c] = b->p0[c][lane];
        p[1][c] = b->e1[c][lane];
        p[2][c] = b->e2[c][lane];
        if (!thin)
            continue;
        float middle = job->form->fades[block].middle[c][lane];
        p[0][c] = middle + k * (p[0][c] - middle);
        p[1][c] = k * p[1][c];
        p[2][c] = k * p[2][c];
    }
    for (int n = 0; n < 3; n++)
        for (int c = 0; c < 3; c++) {
            const float *m = job->eye.m[c];
            float at = (m[0] * p[n][0] + m[1] * p[n][1]) + m[2] * p[n][2];
            v[3 * n + c] = n == 0 ? at + m[3] : at;
        }
    return true;
}

static void project_piece(struct sv_leaf_job *job, const float v[9], bool card, uint32_t piece)
{
    float x[4], y[4], least = INFINITY, most = -INFINITY;
    int corners = card ? 4 : 3, box[4];
    for (int k = 0; k < corners; k++) {
        float p[3];
        corner_of(v, card, k, p);
        float inverse = job->eye.orthographic ? 1 : 1 / p[2];
        x[k] = p[0] * inverse;
        y[k] = p[1] * inverse;
        least = sv_leaf_min(p[2], least);
        most = sv_leaf_max(p[2], most);
    }
    if (!job->eye.orthographic && least < job->eye.near_m) {
        if (most >= job->eye.near_m)
            sv_leaf_queue_crossing(job, self, v, card, piece);
        return;
    }
    x[3] = card ? x[3] : x[2];
    y[3] = card ? y[3] : y[2];
    float x0 = sv_leaf_min(sv_leaf_min(x[0], x[1]), sv_leaf_min(x[2], x[3]));
    float x1 = sv_leaf_max(sv_leaf_max(x[0], x[1]), sv_leaf_max(x[2], x[3]));
    float y0 = sv_leaf_min(sv_leaf_min(y[0], y[1]), sv_leaf_min(y[2], y[3]));
    float y1 = sv_leaf_max(sv_leaf_max(y[0], y[1]), sv_leaf_max(y[2], y[3]));
    if (pixel_range(x0, x1, job->eye.width, &box[0], &box[2]) &&
        pixel_range(y0, y1, job->eye.height, &box[1], &box[3]))
        enqueue(job, self, v, box, piece);
}

static void project(struct sv_leaf_job *job, const struct sv_leaf_cluster *cluster)
{
    const struct sv_leaf_thin *thin = sv_leaf_thins(job, cluster);
    for (uint32_t b = cluster->block; b < cluster->block + cluster->block_count; b++) {
        if (thin && job->form->fades[b].rank[0] >= thin->upto)
            return; /* and so do all that follow */
        for (int lane = 0; lane < SV_LEAF_LANES; lane++) {
            float v[9];
            if (move_piece(job, b, lane, thin, v))
                project_piece(job, v, cluster->card, b * SV_LEAF_LANES + (uint32_t)lane);
        }
    }
}

/* What is linear in the pixel: f[0] x + f[1] y + f[2], (x, y) from the box's first pixel. */
struct plane {
    float f[3];
};

static float at(const struct plane *p, float x, float y)
{
    return (p->f[1] * y + p->f[2]) + p->f[0] * x;
}

struct planes {
    struct plane s, r, q, d; /* places times q; q; depth */
};

static struct plane cross(const float a[3], const float b[3], float g)
{
    return (struct plane){
        {(a[1] * b[2] - a[2] * b[1]) * g, (a[2] * b[0] - a[0] * b[2]) * g, (a[0] * b[1] - a[1] * b[0]) * g}};
}

static void set_perspective(const struct sv_leaf_eye *eye, const float v[9], float i0, float j0,
                            struct planes *p)
{
    float w[3][3];
    for (int n = 0; n < 3; n++) {
        w[n][0] = v[3 * n] - i0 * v[3 * n + 2];
        w[n][1] = v[3 * n + 1] - j0 * v[3 * n + 2];
        w[n][2] = v[3 * n + 2];
    }
    struct plane n = cross(w[1], w[2], 1);
    float volume = (w[0][0] * n.f[0] + w[0][1] * n.f[1]) + w[0][2] * n.f[2], g = eye->near_m / volume;
    p->s = cross(w[2], w[0], g);
    p->r = cross(w[0], w[1], g);
    p->q = (struct plane){{n.f[0] * g, n.f[1] * g, n.f[2] * g}};
    p->d = p->q;
}

static void set_orthographic(const struct sv_leaf_eye *eye, const float v[9], float i0, float j0,
                             struct planes *p)
{
    float a = v[0] - i0, b = v[1] - j0, g = 1 / (v[3] * v[7] - v[4] * v[6]), f = 1 / eye->far_m;
    p->s = (struct plane){{v[7] * g, -v[6] * g, (v[6] * b - v[7] * a) * g}};
    p->r = (struct plane){{-v[4] * g, v[3] * g, (a * v[4] - b * v[3]) * g}};
    p->q = (struct plane){{0, 0, 1}};
    for (int k = 0; k < 3; k++)
        p->d.f[k] = (p->s.f[k] * v[5] + p->r.f[k] * v[8]) * -f;
    p->d.f[2] = (1 - v[2] * f) + p->d.f[2];
}

static bool inside(float s, float r, float q, bool card)
{
    float edge = SV_LEAF_EDGE * q, most = q + edge;
    return s >= -edge && r >= -edge && (card ? s <= most && r <= most : s + r <= most);
}

static void raster_piece(struct sv_leaf_job *job, const struct sv_leaf_queue *queue, int n)
{
    float v[9], i0 = (float)queue->i0[n], j0 = (float)queue->j0[n];
    for (int k = 0; k < 9; k++)
        v[k] = queue->v[k][n];
    struct planes p;
    (job->eye.orthographic ? set_orthographic : set_perspective)(&job->eye, v, i0, j0, &p);
    struct sv_leaf_hits *hits = &job->hits;
    int rows[2], top = queue->j0[n] - job->eye.row_first;
    (void)sv_leaf_rows(&job->eye, queue->j0[n], queue->ny[n], rows);
    for (int y = rows[0]; y < rows[1]; y++)
        for (int x = 0; x < queue->nx[n]; x++) {
            float fx = (float)x, fy = (float)y;
            float s = at(&p.s, fx, fy), r = at(&p.r, fx, fy), q = at(&p.q, fx, fy), d = at(&p.d, fx, fy);
            size_t pixel = (size_t)(top + y) * (size_t)job->eye.width + (size_t)(queue->i0[n] + x);
            if (!inside(s, r, q, job->card) || !(d > 0 && d <= 1 && d >= job->depth[pixel]))
                continue;
            int m = hits->count++;
            hits->pixel[m] = (uint32_t)pixel;
            hits->piece[m] = queue->piece[n];
            hits->d[m] = d;
            hits->s[m] = s;
            hits->r[m] = r;
            if (hits->count >= SV_LEAF_HITS)
                self->settle(job);
        }
}

static void raster(struct sv_leaf_job *job, int q)
{
    struct sv_leaf_queue *queue = &job->queue[q];
    for (int n = 0; n < queue->count; n++)
        raster_piece(job, queue, n);
    queue->count = 0;
}

/* Bilinear alpha by the rule of mesh.h; the same operations as sv_texture_alpha (core/truth/texture.c). */
static bool is_there(const struct sv_leaf_job *job, const float uv[6], float s, float r)
{
    const struct sv_leaf_map *map = job->mask;
    float u = (uv[0] + s * uv[2]) + r * uv[4], v = (uv[1] + s * uv[3]) + r * uv[5];
    float x = sv_leaf_texel(u, map->width), y = sv_leaf_texel(v, map->height);
    float bx = floorf(x), by = floorf(y), fu = x - bx, fv = y - by;
    int i[2], j[2];
    sv_leaf_wrap((int)bx, map->width, i);
    sv_leaf_wrap((int)by, map->height, j);
    uint32_t at = (uint32_t)(j[0] * map->width + i[0]), class = map->classes[at >> 4] >> 2 * (at & 15) & 3;
    if (class != SV_LEAF_MIXED)
        return class == SV_LEAF_IN;
    float a[4];
    for (int k = 0; k < 4; k++)
        a[k] = (float)map->rgba[j[k >> 1] * map->width + i[k & 1]][3];
    float top = a[0] + (a[1] - a[0]) * fu, bottom = a[2] + (a[3] - a[2]) * fu;
    return !((top + (bottom - top) * fv) * (1.0f / 255.0f) * job->alpha_factor < job->alpha_cutoff);
}

static float held(float v)
{
    return sv_leaf_min(sv_leaf_max(v, 0), 1);
}

void sv_leaf_settle_run(struct sv_leaf_job *job, int from, int to)
{
    const struct sv_leaf_hits *hits = &job->hits;
    for (int n = from; n < to; n++) {
        float inverse = job->eye.orthographic ? 1 : 1 / hits->d[n];
        float s = held(hits->s[n] * inverse), r = held(hits->r[n] * inverse);
        if (job->mask && !is_there(job, job->form->records[hits->piece[n]].uv, s, r))
            continue;
        uint32_t place = (uint32_t)(s * 65535 + 0.5f) | (uint32_t)(r * 65535 + 0.5f) << 16;
        sv_leaf_put(job, hits->pixel[n], hits->d[n], hits->piece[n], place);
    }
}

static void settle(struct sv_leaf_job *job)
{
    sv_leaf_settle_run(job, 0, job->hits.count);
    job->hits.count = 0;
}

static float least(const float *depth, int stride, int w, int h)
{
    float v = INFINITY;
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++)
            v = sv_leaf_min(depth[(size_t)j * (size_t)stride + (size_t)i], v);
    return v;
}

const struct sv_leaf_kernel sv_leaf_scalar = {
    .project = project, .raster = raster, .settle = settle, .shade = sv_leaf_shade_scalar, .least = least};
