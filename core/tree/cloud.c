/* cloud.c - see cloud.h: lays the parts of a mesh on the planes that were fitted to them. */
#include "core/tree/cloud.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/vec.h"
#include "core/tree/cloud_private.h"

/* Wood: what two planes that stand parallel about its axis cost against displacement (squared, heights): two
 * copies at right angles keep 71 to 100 % of a tube's width from every side, one plane alone 0 to 100 %. */
static const double PARALLEL2 = 2.5e-3;
/* Further planes take wood that they pass within this share of its radius, at angles above ACROSS to those
 * that have it. */
static const double PASSES = 0.5, ACROSS_COS = 0.9, ALONG_COS = 0.35;
enum { WOOD_PLANES_MAX = 4 };

/* Empty border of a rectangle, of its size: half a texel of 128, four of 1024. */
static const float BORDER = 1.0f / 256;
static const float HALF_MIN = 1e-4f;

struct layout {
    const struct sv_tree_mesh *mesh;
    const struct sv_cloud_options *options;
    struct cloud_cut cut;
    struct cloud_plane planes[SV_CLOUD_PLANES_MAX];
    uint8_t *of_part;
    struct sv_tree_cloud *cloud;
    uint32_t room;
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float dotf(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void sv_tree_cloud_finish(struct sv_tree_cloud *cloud)
{
    free(cloud->pieces);
    free(cloud->triangles);
    memset(cloud, 0, sizeof *cloud);
}

struct sv_tree_vertex sv_cloud_corner(const struct sv_tree_mesh *mesh, const struct sv_cloud_triangle *t,
                                      int k)
{
    const uint32_t *index = mesh->indices + t->index;
    const struct sv_tree_vertex *v[3] = {&mesh->vertices[index[0]], &mesh->vertices[index[1]],
                                         &mesh->vertices[index[2]]};
    for (int i = 0; i < 2; i++)
        if (t->at[k][i] == SV_CLOUD_WEIGHT_ONE)
            return *v[i + 1];
    if (t->at[k][0] == 0 && t->at[k][1] == 0)
        return *v[0];
    float b = t->at[k][0] / (float)SV_CLOUD_WEIGHT_ONE, c = t->at[k][1] / (float)SV_CLOUD_WEIGHT_ONE;
    float w[3] = {1 - b - c, b, c}, normal[3] = {0}, occlusion = 0, open[4] = {0};
    struct sv_tree_vertex out = {.position = {0}};
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++) {
            out.position[a] += w[i] * v[i]->position[a];
            normal[a] += w[i] * (float)v[i]->normal[a];
        }
        for (int a = 0; a < 2; a++)
            out.uv[a] += w[i] * v[i]->uv[a];
        for (int a = 0; a < 4; a++)
            open[a] += w[i] * (float)v[i]->open[a];
        occlusion += w[i] * (float)v[i]->occlusion;
    }
    float length = sqrtf(dotf(normal, normal));
    for (int a = 0; a < 3; a++)
        out.normal[a] = (int16_t)(length > 0 ? normal[a] * (32767.0f / length) : a == 2 ? 32767 : 0);
    for (int a = 0; a < 4; a++)
        out.open[a] = (int8_t)lrintf(open[a]);
    out.occlusion = (uint16_t)lrintf(occlusion);
    return out;
}

/* ---- placing ---- */

/* Rows u, v, normal, times the smallest rotation that takes the piece's normal to the plane's or its
 * opposite. */
static void turn_rows(const struct sv_cloud_plane *plane, const float normal[3], float turn[3][3])
{
    float side = dotf(normal, plane->normal) < 0 ? -1 : 1;
    float m[3] = {side * normal[0], side * normal[1], side * normal[2]}, c = dotf(m, plane->normal);
    float w[3] = {m[1] * plane->normal[2] - m[2] * plane->normal[1],
                  m[2] * plane->normal[0] - m[0] * plane->normal[2],
                  m[0] * plane->normal[1] - m[1] * plane->normal[0]};
    const float *rows[3] = {plane->u, plane->v, plane->normal};
    /* Row r turned back: Q' r = r - w x r + w x (w x r) / (1 + c). */
    for (int r = 0; r < 3; r++) {
        const float *p = rows[r];
        float a[3] = {w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]};
        float b[3] = {w[1] * a[2] - w[2] * a[1], w[2] * a[0] - w[0] * a[2], w[0] * a[1] - w[1] * a[0]};
        for (int k = 0; k < 3; k++)
            turn[r][k] = p[k] - a[k] + b[k] / (1 + c);
    }
}

void sv_cloud_place(const struct sv_tree_cloud *cloud, const struct sv_cloud_piece *piece,
                    struct sv_cloud_placement *placement)
{
    const struct sv_cloud_plane *plane = &cloud->planes[piece->plane];
    memcpy(placement->centre, piece->centre, sizeof placement->centre);
    memcpy(placement->at, piece->at, sizeof placement->at);
    memcpy(placement->turn[0], plane->u, sizeof plane->u);
    memcpy(placement->turn[1], plane->v, sizeof plane->v);
    memcpy(placement->turn[2], plane->normal, sizeof plane->normal);
    if (piece->flags & SV_CLOUD_TURNED)
        turn_rows(plane, piece->normal, placement->turn);
}

/* ---- which planes ---- */

static bool push_piece(struct layout *l, uint32_t part, int plane)
{
    struct sv_tree_cloud *cloud = l->cloud;
    if (cloud->piece_count == l->room) {
        uint32_t room = l->room ? 2 * l->room : 4096;
        struct sv_cloud_piece *grown = realloc(cloud->pieces, room * sizeof *grown);
        if (!grown)
            return false;
        cloud->pieces = grown;
        l->room = room;
    }
    const struct cloud_part *from = &l->cut.parts[part];
    struct sv_cloud_piece *piece = &cloud->pieces[cloud->piece_count++];
    *piece = (struct sv_cloud_piece){.area = from->area,
                                     .first_triangle = from->first_triangle,
                                     .triangle_count = from->triangle_count,
                                     .plane = (uint16_t)plane,
                                     .material = from->material,
                                     .flags = from->flags};
    memcpy(piece->centre, from->centre, sizeof piece->centre);
    memcpy(piece->normal, from->normal, sizeof piece->normal);
    return true;
}

/* What a plane is to a length of wood. */
struct side {
    double distance, along, across[3]; /* n.c - d; n.a; n without its part along the axis, unit */
    double cost;
};

static struct side side_of(const struct cloud_part *part, const struct cloud_plane *plane)
{
    struct side s = {.distance = -plane->d};
    double axis[3], length = 0;
    for (int k = 0; k < 3; k++) {
        axis[k] = (double)part->axis[k];
        s.distance += plane->n[k] * (double)part->centre[k];
    }
    s.along = dot(plane->n, axis);
    for (int k = 0; k < 3; k++)
        s.across[k] = plane->n[k] - s.along * axis[k];
    length = sqrt(dot(s.across, s.across));
    for (int k = 0; k < 3; k++)
        s.across[k] /= length > 1e-6 ? length : 1;
    s.cost = s.distance * s.distance + (double)part->spread2 * s.along * s.along;
    return s;
}

/* The pair of planes that are near and stand across each other, then those that pass through it anyway. */
static int wood_planes(const struct layout *l, const struct cloud_part *part, int out[WOOD_PLANES_MAX])
{
    struct side s[SV_CLOUD_PLANES_MAX];
    int count = l->options->planes, made = 2;
    double least = INFINITY;
    for (int k = 0; k < count; k++)
        s[k] = side_of(part, &l->planes[k]);
    if (count == 1) {
        out[0] = 0;
        return 1;
    }
    for (int a = 0; a < count; a++)
        for (int b = a + 1; b < count; b++) {
            double parallel = dot(s[a].across, s[b].across);
            double cost = s[a].cost + s[b].cost + PARALLEL2 * parallel * parallel;
            if (cost < least) {
                least = cost;
                out[0] = a;
                out[1] = b;
            }
        }
    for (int k = 0; k < count && made < WOOD_PLANES_MAX; k++) {
        bool near = fabs(s[k].distance) < PASSES * (double)part->radius && fabs(s[k].along) < ALONG_COS;
        for (int i = 0; i < made; i++)
            near = near && k != out[i] && fabs(dot(s[k].across, s[out[i]].across)) < ACROSS_COS;
        if (near)
            out[made++] = k;
    }
    return made;
}

static enum sv_status choose_planes(struct layout *l, struct sv_error *error)
{
    for (uint32_t i = 0; i < l->cut.part_count; i++) {
        const struct cloud_part *part = &l->cut.parts[i];
        int planes[WOOD_PLANES_MAX] = {l->of_part[i]}, count = 1;
        if (!(part->flags & SV_CLOUD_LEAF))
            count = wood_planes(l, part, planes);
        if (l->cloud->piece_count + (uint32_t)count > SV_CLOUD_PIECES_MAX)
            return sv_fail(error, SV_ELIMIT, "cloud", "more than %d pieces", SV_CLOUD_PIECES_MAX);
        for (int k = 0; k < count; k++)
            if (!push_piece(l, i, planes[k]))
                return sv_fail(error, SV_ENOMEM, "cloud", "no memory for %u pieces", l->cut.part_count);
    }
    return SV_OK;
}

/* ---- rectangles ---- */

struct point {
    float x, y;
};

static int compare_points(const void *a, const void *b)
{
    const struct point *p = a, *q = b;
    if (p->x != q->x)
        return p->x < q->x ? -1 : 1;
    return p->y < q->y ? -1 : p->y > q->y;
}

static double turn_of(struct point a, struct point b, struct point c)
{
    return ((double)b.x - (double)a.x) * ((double)c.y - (double)a.y) -
           ((double)b.y - (double)a.y) * ((double)c.x - (double)a.x);
}

/* Convex hull by monotone chains (Andrew 1979) into hull (2 count + 2 long); sorts points. */
static size_t convex_hull(struct point *points, size_t count, struct point *hull)
{
    size_t n = 0;
    qsort(points, count, sizeof *points, compare_points);
    for (int pass = 0; pass < 2; pass++) {
        size_t base = n;
        for (size_t i = 0; i < count; i++) {
            struct point p = points[pass ? count - 1 - i : i];
            while (n >= base + 2 && turn_of(hull[n - 2], hull[n - 1], p) <= 0)
                n--;
            hull[n++] = p;
        }
        n -= n > base + 1; /* the last one starts the other chain */
    }
    return n;
}

/* Direction (cos, sin) of a side of the rectangle of least area about the hull: one side lies on an edge. */
static void best_direction(const struct point *hull, size_t count, double out[2])
{
    double least = INFINITY;
    out[0] = 1;
    out[1] = 0;
    for (size_t i = 0; i < count; i++) {
        struct point a = hull[i], b = hull[(i + 1) % count];
        double dx = (double)b.x - (double)a.x, dy = (double)b.y - (double)a.y,
               length = sqrt(dx * dx + dy * dy);
        double lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
        if (!(length > 1e-9))
            continue;
        dx /= length;
        dy /= length;
        for (size_t k = 0; k < count; k++) {
            double s[2] = {dx * (double)hull[k].x + dy * (double)hull[k].y,
                           dx * (double)hull[k].y - dy * (double)hull[k].x};
            for (int c = 0; c < 2; c++) {
                lo[c] = fmin(lo[c], s[c]);
                hi[c] = fmax(hi[c], s[c]);
            }
        }
        double area = (hi[0] - lo[0]) * (hi[1] - lo[1]);
        if (area < least) {
            least = area;
            out[0] = dx;
            out[1] = dy;
        }
    }
}

/* Upright axes of the plane: v as high as it can be. */
static void first_axes(const struct cloud_plane *from, struct sv_cloud_plane *plane)
{
    double up[3] = {0, 0, 1}, u[3], length;
    if (fabs(from->n[2]) > 0.999)
        up[1] = 1, up[2] = 0;
    u[0] = up[1] * from->n[2] - up[2] * from->n[1];
    u[1] = up[2] * from->n[0] - up[0] * from->n[2];
    u[2] = up[0] * from->n[1] - up[1] * from->n[0];
    length = sqrt(dot(u, u));
    for (int k = 0; k < 3; k++) {
        plane->normal[k] = (float)from->n[k];
        plane->u[k] = (float)(u[k] / length);
        plane->centre[k] = (float)(from->n[k] * from->d);
    }
    plane->v[0] = (float)((from->n[1] * u[2] - from->n[2] * u[1]) / length);
    plane->v[1] = (float)((from->n[2] * u[0] - from->n[0] * u[2]) / length);
    plane->v[2] = (float)((from->n[0] * u[1] - from->n[1] * u[0]) / length);
}

/* Turns the axes by (cos, sin), then by quarter turns until v points up most. */
static void turn_axes(struct sv_cloud_plane *plane, const double by[2])
{
    float u[3], v[3], c = (float)by[0], s = (float)by[1];
    for (int k = 0; k < 3; k++) {
        u[k] = c * plane->u[k] + s * plane->v[k];
        v[k] = c * plane->v[k] - s * plane->u[k];
    }
    for (int quarter = 0; quarter < 4 && !(v[2] >= fabsf(u[2]) && (v[2] > 0 || v[1] >= fabsf(u[1])));
         quarter++)
        for (int k = 0; k < 3; k++) {
            float keep = u[k];
            u[k] = v[k];
            v[k] = -keep;
        }
    memcpy(plane->u, u, sizeof u);
    memcpy(plane->v, v, sizeof v);
}

static void set_place(const struct sv_cloud_plane *plane, struct sv_cloud_piece *piece)
{
    float d[3];
    for (int k = 0; k < 3; k++)
        d[k] = piece->centre[k] - plane->centre[k];
    piece->at[0] = dotf(d, plane->u);
    piece->at[1] = dotf(d, plane->v);
    piece->at[2] = dotf(d, plane->normal);
}

/* Plane coordinates of all corners of the plane's pieces. */
static size_t placed_points(const struct layout *l, const struct sv_cloud_plane *plane, struct point *points)
{
    size_t count = 0;
    for (uint32_t i = 0; i < plane->piece_count; i++) {
        struct sv_cloud_piece *piece = &l->cloud->pieces[plane->first_piece + i];
        struct sv_cloud_placement q;
        set_place(plane, piece);
        sv_cloud_place(l->cloud, piece, &q);
        for (uint32_t t = 0; t < piece->triangle_count; t++)
            for (int k = 0; k < 3; k++) {
                float p[3];
                struct sv_tree_vertex v =
                    sv_cloud_corner(l->mesh, &l->cut.triangles[piece->first_triangle + t], k);
                sv_cloud_placed(&q, v.position, p);
                points[count++] = (struct point){p[0], p[1]};
            }
    }
    return count;
}

static void set_rectangle(const struct layout *l, struct sv_cloud_plane *plane, struct point *points,
                          struct point *hull)
{
    double direction[2];
    size_t count = placed_points(l, plane, points), corners;
    plane->half[0] = plane->half[1] = HALF_MIN;
    if (count == 0)
        return;
    corners = convex_hull(points, count, hull);
    best_direction(hull, corners, direction);
    turn_axes(plane, direction);
    count = placed_points(l, plane, points);
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        lo[0] = points[i].x < lo[0] ? points[i].x : lo[0];
        hi[0] = points[i].x > hi[0] ? points[i].x : hi[0];
        lo[1] = points[i].y < lo[1] ? points[i].y : lo[1];
        hi[1] = points[i].y > hi[1] ? points[i].y : hi[1];
    }
    for (int c = 0; c < 2; c++)
        plane->half[c] = fmaxf(0.5f * (hi[c] - lo[c]) * (1 + 2 * BORDER), HALF_MIN);
    for (int k = 0; k < 3; k++)
        plane->centre[k] += 0.5f * (lo[0] + hi[0]) * plane->u[k] + 0.5f * (lo[1] + hi[1]) * plane->v[k];
    for (uint32_t i = 0; i < plane->piece_count; i++)
        set_place(plane, &l->cloud->pieces[plane->first_piece + i]);
}

/* ---- textures of pieces ---- */

/* How the texture lies on the piece: d(x, y)/d(u, v), area-weighted; PLACED when it is the same all over it.
 */
static void set_texture(const struct layout *l, struct sv_cloud_piece *piece)
{
    struct sv_cloud_placement q;
    double j[4] = {0}, square = 0, weight = 0;
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    sv_cloud_place(l->cloud, piece, &q);
    for (uint32_t t = 0; t < piece->triangle_count; t++) {
        float p[3][3], uv[3][2];
        for (int k = 0; k < 3; k++) {
            struct sv_tree_vertex v =
                sv_cloud_corner(l->mesh, &l->cut.triangles[piece->first_triangle + t], k);
            sv_cloud_placed(&q, v.position, p[k]);
            for (int c = 0; c < 2; c++) {
                uv[k][c] = v.uv[c];
                lo[c] = v.uv[c] < lo[c] ? v.uv[c] : lo[c];
                hi[c] = v.uv[c] > hi[c] ? v.uv[c] : hi[c];
            }
        }
        double u1 = (double)(uv[1][0] - uv[0][0]), v1 = (double)(uv[1][1] - uv[0][1]),
               u2 = (double)(uv[2][0] - uv[0][0]), v2 = (double)(uv[2][1] - uv[0][1]),
               det = u1 * v2 - u2 * v1;
        if (!(fabs(det) > 1e-12))
            continue;
        double part = fabs(det), own[4];
        for (int c = 0; c < 2; c++) {
            double e1 = (double)(p[1][c] - p[0][c]), e2 = (double)(p[2][c] - p[0][c]);
            own[2 * c] = (e1 * v2 - e2 * v1) / det;
            own[2 * c + 1] = (e2 * u1 - e1 * u2) / det;
        }
        for (int c = 0; c < 4; c++) {
            j[c] += part * own[c];
            square += part * own[c] * own[c];
        }
        weight += part;
    }
    memcpy(piece->uv_lo, lo, sizeof lo);
    memcpy(piece->uv_hi, hi, sizeof hi);
    if (!(weight > 0))
        return;
    double mean2 = 0;
    for (int c = 0; c < 4; c++) {
        j[c] /= weight;
        mean2 += j[c] * j[c];
    }
    double along = sqrt(j[0] * j[0] + j[2] * j[2]), down = sqrt(j[1] * j[1] + j[3] * j[3]);
    double shear = fabs(j[0] * j[1] + j[2] * j[3]);
    piece->rotation = (float)atan2(j[2], j[0]);
    piece->size[0] = (float)along * (hi[0] - lo[0]);
    piece->size[1] = (float)down * (hi[1] - lo[1]);
    if (j[0] * j[3] - j[1] * j[2] > 0)
        piece->flags |= SV_CLOUD_MIRRORED;
    if (shear <= 0.2 * along * down && square / weight - mean2 <= 0.05 * mean2)
        piece->flags |= SV_CLOUD_PLACED;
}

/* ---- the whole ---- */

static int compare_pieces(const void *a, const void *b)
{
    const struct sv_cloud_piece *p = a, *q = b;
    if (p->plane != q->plane)
        return p->plane < q->plane ? -1 : 1;
    if (p->at[2] != q->at[2])
        return p->at[2] < q->at[2] ? -1 : 1;
    return p->first_triangle < q->first_triangle ? -1 : p->first_triangle > q->first_triangle;
}

static void number_planes(struct sv_tree_cloud *cloud)
{
    uint32_t at = 0;
    for (int k = 0; k < cloud->plane_count; k++) {
        cloud->planes[k].first_piece = at;
        while (at < cloud->piece_count && cloud->pieces[at].plane == k)
            at++;
        cloud->planes[k].piece_count = at - cloud->planes[k].first_piece;
    }
}

/* Mean over all directions of the view of 1 - (n.v)^2 is 2/3. */
static void set_errors(struct sv_tree_cloud *cloud)
{
    double sum = 0, area = 0;
    for (uint32_t i = 0; i < cloud->piece_count; i++) {
        double a = (double)cloud->pieces[i].area, d = (double)cloud->pieces[i].at[2];
        sum += a * d * d;
        area += a;
    }
    cloud->rms = (float)(area > 0 ? sqrt(sum / area) : 0);
    cloud->view_rms = cloud->rms * 0.81649658f;
}

static enum sv_status lay_out(struct layout *l, struct sv_error *error)
{
    struct sv_tree_cloud *cloud = l->cloud;
    size_t most = 0;
    enum sv_status status = choose_planes(l, error);
    if (status)
        return status;
    cloud->plane_count = l->options->planes;
    for (int k = 0; k < cloud->plane_count; k++)
        first_axes(&l->planes[k], &cloud->planes[k]);
    for (uint32_t i = 0; i < cloud->piece_count; i++)
        set_place(&cloud->planes[cloud->pieces[i].plane], &cloud->pieces[i]);
    if (cloud->piece_count)
        qsort(cloud->pieces, cloud->piece_count, sizeof *cloud->pieces, compare_pieces);
    number_planes(cloud);
    for (int k = 0; k < cloud->plane_count; k++) {
        size_t corners = 0;
        for (uint32_t i = 0; i < cloud->planes[k].piece_count; i++)
            corners += 3 * (size_t)cloud->pieces[cloud->planes[k].first_piece + i].triangle_count;
        most = corners > most ? corners : most;
    }
    struct point *points = malloc((most + 1) * sizeof *points), *hull = malloc((2 * most + 2) * sizeof *hull);
    if (points && hull)
        for (int k = 0; k < cloud->plane_count; k++)
            set_rectangle(l, &cloud->planes[k], points, hull);
    else
        status = sv_fail(error, SV_ENOMEM, "cloud", "no memory for the outlines of %zu corners", most);
    free(points);
    free(hull);
    for (uint32_t i = 0; !status && i < cloud->piece_count; i++)
        set_texture(l, &cloud->pieces[i]);
    set_errors(cloud);
    return status;
}

static enum sv_status check_options(const struct sv_cloud_options *options, struct sv_error *error)
{
    if (options->planes < 1 || options->planes > SV_CLOUD_PLANES_MAX)
        return sv_fail(error, SV_EINVAL, "planes", "%d planes are outside 1 .. %d", options->planes,
                       SV_CLOUD_PLANES_MAX);
    if (options->stem_planes < 0 || options->restarts < 1 || options->restarts > 1000)
        return sv_fail(error, SV_EINVAL, "restarts",
                       "%d stem planes or %d restarts (1 .. 1000) are out of range", options->stem_planes,
                       options->restarts);
    if (!(options->lambda >= 0 && options->lambda <= 1))
        return sv_fail(error, SV_EINVAL, "lambda", "%g is outside 0 .. 1", options->lambda);
    return SV_OK;
}

enum sv_status sv_tree_cloud_create(const struct sv_tree_mesh *mesh, const struct sv_cloud_options *options,
                                    struct sv_tree_cloud *cloud, struct sv_error *error)
{
    struct sv_tree_cloud made = {0};
    struct layout l = {.mesh = mesh, .options = options, .cloud = &made};
    enum sv_status status = check_options(options, error);
    if (!status)
        status = sv_cloud_cut(mesh, &l.cut, error);
    if (status)
        return status;
    l.of_part = malloc((size_t)l.cut.part_count + 1);
    if (!l.of_part)
        status = sv_fail(error, SV_ENOMEM, "cloud", "no memory for %u parts", l.cut.part_count);
    if (!status)
        status = sv_cloud_fit(&l.cut, options, l.planes, l.of_part, error);
    if (!status)
        status = lay_out(&l, error);
    if (!status) {
        made.triangles = l.cut.triangles;
        made.triangle_count = l.cut.triangle_count;
        l.cut.triangles = NULL;
        *cloud = made;
    } else {
        sv_tree_cloud_finish(&made);
    }
    sv_cloud_cut_finish(&l.cut);
    free(l.of_part);
    return status;
}
