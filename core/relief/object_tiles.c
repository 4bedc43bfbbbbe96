/* object_tiles.c - which parts of an object's reliefs can face an eye.
 *
 * Each relief is cut into tiles; a tile knows a ball that holds its kept texels, and a cone that holds their
 * normals. It can face an eye only where the angle between cone and eye is below 90 degrees plus the cone's
 * half angle plus half the angle under which the eye sees the ball. This is how the faces that a view needs
 * are found (the up to three that look towards the eye, and of the others those that hold texels across an
 * edge), and the rows of each. */
#include "core/relief/object_splat.h"

#include <stdlib.h>
#include <string.h>

enum { SIDE = 8 }; /* texels of a tile */
/* Normals of a bake are means over a texel: what may be off them, rad. */
#define NORMAL_SLACK 0.15

struct sv_relief_tile {
    struct sv_vec3 middle, axis;
    double radius, spread; /* of the ball, model space; half angle of the cone, rad; < 0: nothing is kept */
    double sine, cosine;   /* of spread; 1, 0 from 90 degrees on */
};

static int across(const struct sv_relief *r)
{
    return (r->width + SIDE - 1) / SIDE;
}

static int down(const struct sv_relief *r)
{
    return (r->height + SIDE - 1) / SIDE;
}

static bool kept(const struct sv_relief_object *object, int sheet, size_t texel)
{
    return sv_relief_solid(sv_relief_sheet(object, sheet), texel) &&
           (sheet >= SV_RELIEF_FACES || object->keep[sheet][texel]);
}

static struct sv_vec3 normal_of(const struct sv_relief *r, size_t texel)
{
    const int16_t *n = r->normal[texel];
    struct sv_vec3 a = sv_scale(sv_normalize(r->frame.a), n[0]), b = sv_scale(sv_normalize(r->frame.b), n[1]);
    return sv_normalize(sv_madd(sv_add(a, b), r->frame.f, n[2]));
}

static struct sv_relief_tile measure(const struct sv_relief_object *object, int sheet, int column, int row)
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    struct sv_relief_tile t = {.spread = -1};
    float nearest = -INFINITY, farthest = INFINITY;
    int i1 = column + SIDE < r->width ? column + SIDE : r->width,
        j1 = row + SIDE < r->height ? row + SIDE : r->height;
    for (int j = row; j < j1; j++)
        for (int i = column; i < i1; i++) {
            size_t k = (size_t)j * (size_t)r->width + (size_t)i;
            if (!kept(object, sheet, k))
                continue;
            t.axis = sv_add(t.axis, normal_of(r, k));
            nearest = fmaxf(nearest, r->displ[k]);
            farthest = fminf(farthest, r->displ[k]);
        }
    if (nearest < farthest)
        return t;
    t.axis = sv_normalize(t.axis);
    t.spread = 0;
    for (int j = row; j < j1; j++)
        for (int i = column; i < i1; i++) {
            size_t k = (size_t)j * (size_t)r->width + (size_t)i;
            if (kept(object, sheet, k))
                t.spread = fmax(t.spread, acos(sv_clamp(sv_dot(normal_of(r, k), t.axis), -1, 1)));
        }
    t.spread = fmin(t.spread + NORMAL_SLACK, SV_PI / 2);
    t.sine = sin(t.spread);
    t.cosine = t.spread < SV_PI / 2 ? cos(t.spread) : 0;
    t.middle =
        sv_relief_point(&r->frame, 0.5 * (column + i1), 0.5 * (row + j1), 0.5 * (double)(nearest + farthest));
    double half_u = 0.5 * (i1 - column) * sv_length(r->frame.a),
           half_v = 0.5 * (j1 - row) * sv_length(r->frame.b);
    double half_d = 0.5 * (double)(nearest - farthest);
    t.radius = sqrt(half_u * half_u + half_v * half_v + half_d * half_d);
    return t;
}

/* Normals and sky occlusion plane by plane: a row of normals is tested at once, without the rest. */
static bool split_normals(struct sv_relief_object *object)
{
    size_t texels = 0;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        texels += r->solid_count ? (size_t)r->width * (size_t)r->height : 0;
    }
    int16_t *at = malloc((4 * texels + 1) * sizeof *at);
    free(object->normal_block);
    object->normal_block = at;
    for (int k = 0; at && k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        object->normals[k] = r->solid_count ? at : NULL;
        for (int axis = 0; r->solid_count && axis < 4; axis++)
            for (size_t i = 0; i < (size_t)r->width * (size_t)r->height; i++)
                *at++ = r->normal[i][axis];
    }
    return at != NULL;
}

enum sv_status sv_relief_object_tile(struct sv_relief_object *object, struct sv_error *error)
{
    size_t count = 0;
    if (!split_normals(object))
        return sv_fail(error, SV_ENOMEM, "object", "no memory for normals");
    for (int k = 0; k < SV_RELIEF_SHEETS; k++)
        count += (size_t)across(sv_relief_sheet(object, k)) * (size_t)down(sv_relief_sheet(object, k));
    struct sv_relief_tile *tile = malloc(count * sizeof *tile);
    if (!tile)
        return sv_fail(error, SV_ENOMEM, "object", "no memory for %zu tiles", count);
    free(object->tiles);
    object->tiles = tile;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        object->tile[k] = tile;
        for (int row = 0; row < r->height; row += SIDE)
            for (int column = 0; column < r->width; column += SIDE)
                *tile++ = measure(object, k, column, row);
    }
    return SV_OK;
}

/* eye: a place, or the unit direction to it. */
static bool may_face(const struct sv_relief_tile *t, struct sv_vec3 eye, bool is_place)
{
    if (t->spread < 0)
        return false;
    struct sv_vec3 to_eye = is_place ? sv_sub(eye, t->middle) : eye;
    double square = sv_dot(to_eye, to_eye), along = sv_dot(t->axis, to_eye), ball = is_place ? t->radius : 0;
    if (square <= ball * ball)
        return true;
    /* along > -distance sin(spread + ball's half angle), the sum below 90 degrees. */
    double clear = sqrt(square - ball * ball), bound = t->sine * clear + t->cosine * ball;
    return t->cosine * clear <= t->sine * ball || along > -bound;
}

struct sv_relief_facing sv_relief_object_facing(const struct sv_relief_object *object, int sheet,
                                                struct sv_vec3 eye, bool is_place)
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    size_t texels = (size_t)r->width * (size_t)r->height;
    double pitch = sv_length(r->frame.a);
    struct sv_vec3 e = is_place ? sv_sub(eye, r->frame.origin) : eye;
    struct sv_relief_facing f = {.pitch = is_place ? (float)pitch : 0, .near = is_place ? 1 : 0};
    f.eye[0] = (float)(sv_dot(e, r->frame.a) / pitch);
    f.eye[1] = (float)(sv_dot(e, r->frame.b) / pitch);
    f.eye[2] = (float)sv_dot(e, r->frame.f);
    for (int axis = 0; axis < 3; axis++)
        f.normal[axis] = object->normals[sheet] ? object->normals[sheet] + (size_t)axis * texels : NULL;
    return f;
}

int sv_relief_object_spans_max(const struct sv_relief_object *object)
{
    int most = 1;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        int runs = (across(r) + 1) / 2 * down(r);
        most = runs > most ? runs : most;
    }
    return most;
}

int sv_relief_object_spans(const struct sv_relief_object *object, int sheet, struct sv_vec3 eye,
                           bool is_place, struct sv_relief_span *spans)
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    const struct sv_relief_tile *tile = object->tile[sheet];
    int columns = across(r), rows = down(r), count = 0;
    for (int j = 0; r->solid_count && j < rows; j++, tile += columns)
        for (int i = 0; i < columns; i++) {
            int low = i;
            while (i < columns && may_face(&tile[i], eye, is_place))
                i++;
            if (i == low)
                continue;
            int row1 = (j + 1) * SIDE < r->height ? (j + 1) * SIDE : r->height;
            int column1 = i * SIDE < r->width ? i * SIDE : r->width;
            struct sv_relief_span span = {j * SIDE, row1, low * SIDE, column1};
            int above = count - 1; /* of the tile row above, if it is the same block */
            while (above >= 0 && spans[above].row1 >= span.row0 &&
                   !(spans[above].row1 == span.row0 && spans[above].column0 == span.column0 &&
                     spans[above].column1 == span.column1))
                above--;
            if (above >= 0 && spans[above].row1 == span.row0)
                spans[above].row1 = span.row1;
            else
                spans[count++] = span;
        }
    return count;
}

unsigned sv_relief_object_seen_from(const struct sv_relief_object *object, struct sv_vec3 eye, bool is_place)
{
    unsigned faces = 0;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        unsigned bit = 1u << k % SV_RELIEF_FACES;
        for (int i = 0; r->solid_count && !(faces & bit) && i < across(r) * down(r); i++)
            faces |= may_face(&object->tile[k][i], eye, is_place) ? bit : 0;
    }
    return faces;
}
