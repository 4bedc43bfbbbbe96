/* lattice.c - face-centred lattices, one a ring, each twice as wide as the one before. */
#include "core/cell/lattice.h"

#include <assert.h>
#include <math.h>

#include "core/base/hash.h"
#include "core/base/shell.h"

void sv_cell_rings_make(double outer_m, double inner_m, double pitch, struct sv_cell_rings *rings)
{
    *rings = (struct sv_cell_rings){.pitch = pitch};
    if (!(outer_m > 0 && inner_m > 0 && pitch > 0 && pitch <= SV_CELL_PITCH_MAX) || isinf(outer_m) ||
        isinf(inner_m))
        return;
    double halvings = round(log2(outer_m / inner_m));
    rings->count = 1 + (int)sv_clamp(halvings, 0, SV_CELL_RINGS_MAX - 1);
    for (int r = 0; r < rings->count; r++)
        rings->distance_m[r] = ldexp(outer_m, r - (rings->count - 1));
}

static double step_m(const struct sv_cell_rings *rings, int ring)
{
    return rings->pitch * rings->distance_m[ring];
}

struct sv_cell_place sv_cell_place_at(const struct sv_cell_rings *rings, int ring, int32_t i, int32_t j,
                                      int32_t k, bool top)
{
    double s = step_m(rings, ring);
    return (struct sv_cell_place){ring, i, j, k, sv_vec3(i * s, j * s, ((double)k + top) * s)};
}

/* The nearest lattice point to u, in steps: the nearest integers and, where their sum is odd, the one that
 * was rounded farthest goes to its other side (Conway and Sloane 1982, algorithm for D_n). Halves round up;
 * of equal errors the first of x, y, z moves, of no error upward. */
static void own(const double u[3], int32_t index[3])
{
    double n[3], worst = -1;
    int turn = 0;
    for (int a = 0; a < 3; a++) {
        n[a] = floor(u[a] + 0.5);
        if (fabs(u[a] - n[a]) > worst) {
            worst = fabs(u[a] - n[a]);
            turn = a;
        }
    }
    if (fmod(n[0] + n[1] + n[2], 2) != 0)
        n[turn] += u[turn] >= n[turn] ? 1 : -1;
    for (int a = 0; a < 3; a++)
        index[a] = (int32_t)n[a];
}

/* In steps of the next ring V stands at half its own index, exactly: no rounding decides who owns it. */
struct sv_cell_place sv_cell_next(const struct sv_cell_rings *rings, const struct sv_cell_place *place,
                                  bool top)
{
    assert(place->ring >= 0 && place->ring < rings->count - 1);
    double u[3] = {0.5 * place->i, 0.5 * place->j, 0.5 * ((double)place->k + top)};
    int32_t n[3];
    own(u, n);
    return sv_cell_place_at(rings, place->ring + 1, n[0], n[1], n[2], top);
}

bool sv_cell_chain(const struct sv_cell_rings *rings, struct sv_vec3 eye, bool top,
                   struct sv_cell_place chain[SV_CELL_RINGS_MAX])
{
    if (rings->count == 0)
        return false;
    double s = step_m(rings, 0);
    double u[3] = {eye.x / s, eye.y / s, eye.z / s};
    int32_t n[3];
    for (int a = 0; a < 3; a++)
        if (!(fabs(u[a]) <= 0x1p30))
            return false;
    own(u, n);
    chain[0] = sv_cell_place_at(rings, 0, n[0], n[1], n[2], top);
    for (int r = 1; r < rings->count; r++)
        chain[r] = sv_cell_next(rings, &chain[r - 1], top);
    return true;
}

void sv_cell_face_axes(enum sv_cell_face face, struct sv_vec3 *right, struct sv_vec3 *up,
                       struct sv_vec3 *forward)
{
    static const struct sv_vec3 axes[SV_CELL_FACES][3] = {
        [SV_CELL_EAST] = {{0, -1, 0}, {0, 0, 1}, {1, 0, 0}},
        [SV_CELL_NORTH] = {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
        [SV_CELL_WEST] = {{0, 1, 0}, {0, 0, 1}, {-1, 0, 0}},
        [SV_CELL_SOUTH] = {{-1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
        [SV_CELL_DOWN] = {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
        [SV_CELL_UP] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}},
    };
    *right = axes[face][0];
    *up = axes[face][1];
    *forward = axes[face][2];
}

bool sv_cell_in_cube(struct sv_vec3 v, double distance_m, struct sv_vec3 foot, double height_m)
{
    struct sv_vec3 d = sv_sub(foot, v);
    return fabs(d.x) <= distance_m && fabs(d.y) <= distance_m && d.z <= distance_m &&
           d.z + height_m >= -distance_m;
}

struct sv_cell_shell sv_cell_shell(const struct sv_cell_rings *rings, const struct sv_cell_place *place,
                                   bool top)
{
    struct sv_cell_shell shell = {place->v, place->v, rings->distance_m[place->ring], INFINITY};
    if (place->ring < rings->count - 1) {
        shell.outer_v = sv_cell_next(rings, place, top).v;
        shell.outer_m = rings->distance_m[place->ring + 1];
    }
    return shell;
}

/* Whether the tree is in the cube as it is for it. */
static bool holds(struct sv_vec3 v, double distance_m, struct sv_vec3 foot, double height_m, double reach_m)
{
    return sv_cell_in_cube(v, distance_m + sv_shell_growth_m(distance_m, reach_m), foot, height_m);
}

bool sv_cell_in_shell(const struct sv_cell_shell *shell, struct sv_vec3 foot, double height_m, double reach_m)
{
    return !holds(shell->v, shell->distance_m, foot, height_m, reach_m) &&
           (isinf(shell->outer_m) || holds(shell->outer_v, shell->outer_m, foot, height_m, reach_m));
}

/* How far along n (each component -1, 0 or 1) the box about V reaches. */
static double reach_along(struct sv_vec3 n, struct sv_vec3 low, struct sv_vec3 high)
{
    return (n.x > 0 ? n.x * high.x : n.x * low.x) + (n.y > 0 ? n.y * high.y : n.y * low.y) +
           (n.z > 0 ? n.z * high.z : n.z * low.z);
}

static bool all_inside(struct sv_vec3 v, double distance_m, struct sv_vec3 low, struct sv_vec3 high)
{
    return low.x >= v.x - distance_m && low.y >= v.y - distance_m && low.z >= v.z - distance_m &&
           high.x <= v.x + distance_m && high.y <= v.y + distance_m && high.z <= v.z + distance_m;
}

static bool all_outside(struct sv_vec3 v, double distance_m, struct sv_vec3 low, struct sv_vec3 high)
{
    return low.x > v.x + distance_m || low.y > v.y + distance_m || low.z > v.z + distance_m ||
           high.x < v.x - distance_m || high.y < v.y - distance_m || high.z < v.z - distance_m;
}

bool sv_cell_sees_box(const struct sv_cell_shell *shell, enum sv_cell_face face, struct sv_vec3 low,
                      struct sv_vec3 high)
{
    struct sv_vec3 axes[3], from = sv_sub(low, shell->v), to = sv_sub(high, shell->v);
    sv_cell_face_axes(face, &axes[0], &axes[1], &axes[2]);
    for (int side = 0; side < 4; side++) /* forward >= |right|, |up| somewhere */
        if (reach_along(sv_madd(axes[2], axes[side / 2], side % 2 ? -1 : 1), from, to) < 0)
            return false;
    if (isinf(shell->outer_m) || !all_outside(shell->outer_v, shell->outer_m, low, high))
        return !all_inside(shell->v, shell->distance_m, low, high);
    return false;
}

int sv_cell_ring_of(const struct sv_cell_rings *rings, const struct sv_cell_place *chain, struct sv_vec3 foot,
                    double height_m, double reach_m)
{
    for (int r = 0; r < rings->count; r++)
        if (holds(chain[r].v, rings->distance_m[r], foot, height_m, reach_m))
            return r - 1;
    return rings->count - 1;
}

uint64_t sv_cell_key(const struct sv_cell_rings *rings, const struct sv_cell_key_parts *parts)
{
    const struct sv_cell_place *p = &parts->place;
    const int32_t index[8] = {
        p->ring,      p->i,       p->j, p->k, p->ring == rings->count - 1, (int32_t)parts->face,
        parts->layer, parts->size};
    uint64_t h = sv_hash_bytes(SV_HASH_INIT, index, sizeof index);
    h = sv_hash_double(h, rings->distance_m[p->ring]);
    h = sv_hash_double(h, rings->pitch);
    h = sv_hash_double(h, p->v.z); /* at the cell's top or at its centre */
    h = sv_hash_done(sv_hash_u64(sv_hash_u64(h, parts->light), parts->scene));
    return h ? h : 1;
}
