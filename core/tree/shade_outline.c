/* shade_outline.c - a species' silhouettes in parallel light, from its impostor.
 *
 * For each turn about the stem the frame nearest to the sun (in the model's axes) is taken, laid into space
 * in the plane that fits its depth (impostor.h) and projected along the light on the plane square to it: an
 * affine map of the frame's cell, so that what stands near that plane moves as it should although the sun is
 * up to 18 degrees off the frame (paper 1, 3.3.2, step (2), for an impostor). Coverage is the share of rays
 * that an alpha-tested mesh stops, box-filtered; levels are means of four. */
#include <math.h>
#include <stdlib.h>

#include "core/tree/shade_private.h"

/* s = s0 + sx x + sy y, t likewise: cell coordinates of the place (x, y) on the light's plane. */
struct map {
    float s0, sx, sy, t0, tx, ty;
};

/* A frame turned into the world and seen along the light: cell -> (x, y) in heights. */
struct seen {
    float origin[2], along_s[2], along_t[2];
};

static void project(const struct sv_shade_axes *axes, double rotation_rad, const float p[3], float out[2])
{
    struct sv_vec3 world =
        sv_vec3(cos(rotation_rad) * (double)p[0] + sin(rotation_rad) * (double)p[1],
                cos(rotation_rad) * (double)p[1] - sin(rotation_rad) * (double)p[0], (double)p[2]);
    out[0] = (float)sv_dot(world, axes->right);
    out[1] = (float)sv_dot(world, axes->up);
}

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* As sprite_setup.c lays its pictures: round crowns do not get narrower beside their frame. */
static struct seen see(const struct sv_impostor_frame *f, const struct sv_shade_axes *axes,
                       double rotation_rad, const float to_sun[3])
{
    struct seen seen;
    project(axes, rotation_rad, f->origin, seen.origin);
    project(axes, rotation_rad, f->along_s, seen.along_s);
    project(axes, rotation_rad, f->along_t, seen.along_t);
    float beside = dot3(f->right, to_sun), wider = 1 / sqrtf(fmaxf(1 - beside * beside, 0.5f));
    float axis = -dot3(f->origin, f->right) * f->texels / SV_IMPOSTOR_CELL;
    for (int a = 0; a < 2; a++) {
        seen.origin[a] += axis * (1 - wider) * seen.along_s[a];
        seen.along_s[a] *= wider;
    }
    return seen;
}

static bool invert(const struct seen *seen, struct map *map)
{
    float det = seen->along_s[0] * seen->along_t[1] - seen->along_s[1] * seen->along_t[0];
    if (!(fabsf(det) > 1e-8f))
        return false;
    map->sx = seen->along_t[1] / det;
    map->sy = -seen->along_t[0] / det;
    map->tx = -seen->along_s[1] / det;
    map->ty = seen->along_s[0] / det;
    map->s0 = -(map->sx * seen->origin[0] + map->sy * seen->origin[1]);
    map->t0 = -(map->tx * seen->origin[0] + map->ty * seen->origin[1]);
    return true;
}

/* Coverage at cell coordinates, bilinear; outside the cell there is nothing. */
static float sample(const uint8_t *cell, float s, float t)
{
    float x = s * SV_IMPOSTOR_CELL - 0.5f, y = t * SV_IMPOSTOR_CELL - 0.5f;
    if (!(x > -1 && y > -1 && x < SV_IMPOSTOR_CELL && y < SV_IMPOSTOR_CELL))
        return 0;
    int i = (int)(x + 1) - 1, j = (int)(y + 1) - 1; /* floor: both above -1 */
    float fx = x - (float)i, fy = y - (float)j, tap[4];
    for (int k = 0; k < 4; k++) {
        int u = i + (k & 1), v = j + (k >> 1);
        bool in = u >= 0 && v >= 0 && u < SV_IMPOSTOR_CELL && v < SV_IMPOSTOR_CELL;
        tap[k] = in ? (float)cell[(size_t)v * SV_IMPOSTOR_SIDE + (size_t)u] : 0;
    }
    return (tap[0] * (1 - fx) + tap[1] * fx) * (1 - fy) + (tap[2] * (1 - fx) + tap[3] * fx) * fy;
}

static int at_least_one(float v)
{
    int n = (int)ceilf(v);
    return n < 1 ? 1 : n > SV_OUTLINE_SIDE ? SV_OUTLINE_SIDE : n;
}

/* Size and place of level 0; false where nothing is seen. */
static bool frame_outline(const struct sv_impostor_frame *f, const struct seen *seen,
                          struct sv_shade_outline *o)
{
    if (!(f->s_min < f->s_max) || !(f->t_min < f->t_max))
        return false;
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY}, edge = 0.5f / SV_IMPOSTOR_CELL;
    for (int k = 0; k < 4; k++) {
        float s = k & 1 ? f->s_max + edge : f->s_min - edge, t = k & 2 ? f->t_max + edge : f->t_min - edge;
        for (int a = 0; a < 2; a++) {
            float at = seen->origin[a] + s * seen->along_s[a] + t * seen->along_t[a];
            lo[a] = fminf(lo[a], at);
            hi[a] = fmaxf(hi[a], at);
        }
    }
    float width = hi[0] - lo[0], height = hi[1] - lo[1];
    o->texel = fmaxf(fmaxf(width, height) / SV_OUTLINE_SIDE, 1 / f->texels);
    o->left = lo[0];
    o->top = hi[1];
    o->level[0].width = at_least_one(width / o->texel);
    o->level[0].height = at_least_one(height / o->texel);
    return o->texel > 0 && o->texel < INFINITY;
}

static void draw_outline(const uint8_t *cell, const struct map *map, const struct sv_shade_outline *o,
                         uint8_t *out)
{
    int width = o->level[0].width, height = o->level[0].height;
    for (int j = 0; j < height; j++) {
        float y = o->top - ((float)j + 0.5f) * o->texel, x0 = o->left + 0.5f * o->texel;
        float s = map->s0 + map->sx * x0 + map->sy * y, t = map->t0 + map->tx * x0 + map->ty * y;
        for (int i = 0; i < width; i++) {
            float along = (float)i * o->texel;
            out[(size_t)j * (size_t)width + (size_t)i] =
                (uint8_t)(sample(cell, s + map->sx * along, t + map->tx * along) + 0.5f);
        }
    }
}

/* Means of four, from `in` at twice the resolution; what lies beyond its edge is empty. */
static void halve(const float *in, int in_width, int in_height, float *out, int width, int height)
{
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            float sum = 0;
            for (int k = 0; k < 4; k++) {
                int u = 2 * i + (k & 1), v = 2 * j + (k >> 1);
                sum += u < in_width && v < in_height ? in[(size_t)v * (size_t)in_width + (size_t)u] : 0;
            }
            out[(size_t)j * (size_t)width + (size_t)i] = 0.25f * sum;
        }
}

static int levels_of(int width, int height)
{
    int levels = 1;
    for (; (width > 1 || height > 1) && levels < SV_OUTLINE_LEVELS; levels++) {
        width = (width + 1) / 2;
        height = (height + 1) / 2;
    }
    return levels;
}

/* Levels 1 .. from level 0, through floats: 8-bit rounding is not piled up. */
static void draw_levels(struct sv_shade_outline *o, uint8_t *texels, float *work)
{
    float *from = work, *to = work + (size_t)SV_OUTLINE_SIDE * SV_OUTLINE_SIDE;
    size_t count = (size_t)o->level[0].width * (size_t)o->level[0].height;
    for (size_t k = 0; k < count; k++)
        from[k] = texels[k];
    for (int n = 1; n < o->levels; n++) {
        struct sv_silhouette *l = &o->level[n];
        texels += (size_t)l[-1].width * (size_t)l[-1].height;
        halve(from, l[-1].width, l[-1].height, to, l->width, l->height);
        for (size_t k = 0; k < (size_t)l->width * (size_t)l->height; k++)
            texels[k] = (uint8_t)(to[k] + 0.5f);
        float *swap = from;
        from = to;
        to = swap;
    }
}

static void measure(struct sv_shade_outline *o, const uint8_t *texels)
{
    double sum = 0, x = 0, y = 0;
    int width = o->level[0].width, height = o->level[0].height;
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            double c = texels[(size_t)j * (size_t)width + (size_t)i];
            sum += c;
            x += c * (i + 0.5);
            y += c * (j + 0.5);
        }
    double texel = (double)o->texel;
    o->area = (float)(sum / 255 * texel * texel);
    o->middle_x = sum > 0 ? o->left + (float)(x / sum * texel) : 0;
    o->middle_y = sum > 0 ? o->top - (float)(y / sum * texel) : 0;
}

/* Everything of the levels but coverage. radius bounds the body, for its depth along the light. */
static void place_levels(struct sv_shade_outline *o, const struct sv_shade_axes *axes, float radius)
{
    double across = sqrt(fmax(0, 1 - axes->to_sun.z * axes->to_sun.z)), r = (double)radius;
    double near = r * across + axes->to_sun.z, far = -r * across; /* along to_sun, from the foot */
    struct sv_vec3 corner = sv_scale(axes->to_sun, near);
    corner = sv_madd(corner, axes->right, (double)o->left);
    corner = sv_madd(corner, axes->up, (double)o->top);
    o->levels = levels_of(o->level[0].width, o->level[0].height);
    for (int k = 0; k < o->levels; k++) {
        struct sv_silhouette *l = &o->level[k];
        l->width = k ? (l[-1].width + 1) / 2 : l->width;
        l->height = k ? (l[-1].height + 1) / 2 : l->height;
        double texel = ldexp((double)o->texel, k);
        l->corner = corner;
        l->right = axes->right;
        l->down = sv_scale(axes->up, -1);
        l->travel = sv_scale(axes->to_sun, -1);
        l->width_m = texel * l->width;
        l->height_m = texel * l->height;
        l->first_m = 0;
        l->last_m = near - far;
    }
}

static size_t outline_bytes(const struct sv_shade_outline *o)
{
    size_t bytes = 0;
    for (int k = 0; k < o->levels; k++)
        bytes += (size_t)o->level[k].width * (size_t)o->level[k].height;
    return bytes;
}

static void widen_bounds(struct sv_shade_view *view, const struct sv_shade_outline *o)
{
    float right = o->left + (float)o->level[0].width * o->texel;
    float bottom = o->top - (float)o->level[0].height * o->texel;
    view->reach = fmaxf(view->reach, fmaxf(fabsf(o->left), fabsf(right)));
    view->bottom = fminf(view->bottom, bottom);
    view->top = fmaxf(view->top, o->top);
}

struct turned {
    const uint8_t *cell;
    struct map map;
};

static void plan_turn(const struct sv_shade_species *species, const struct sv_shade_axes *axes, int turn,
                      struct sv_shade_outline *o, struct turned *turned)
{
    double angle = 2 * SV_PI * turn / SV_SHADE_TURNS, c = cos(angle), s = sin(angle);
    const float to_sun[3] = {(float)(c * axes->to_sun.x - s * axes->to_sun.y),
                             (float)(c * axes->to_sun.y + s * axes->to_sun.x), (float)axes->to_sun.z};
    int index = sv_impostor_nearest(to_sun[0], to_sun[1], to_sun[2]);
    const struct sv_impostor_frame *f = &species->frames[index];
    struct seen seen = see(f, axes, angle, to_sun);
    if (!invert(&seen, &turned->map) || !frame_outline(f, &seen, o))
        return;
    place_levels(o, axes, species->radius);
    turned->cell = species->coverage +
                   (size_t)(index / SV_IMPOSTOR_GRID) * SV_IMPOSTOR_CELL * SV_IMPOSTOR_SIDE +
                   (size_t)(index % SV_IMPOSTOR_GRID) * SV_IMPOSTOR_CELL;
}

enum sv_status sv_shade_view_init(const struct sv_shade_species *species, const struct sv_shade_axes *axes,
                                  struct sv_shade_view *view, struct sv_error *error)
{
    *view = (struct sv_shade_view){0};
    if (!species->frames)
        return SV_OK;
    struct turned turned[SV_SHADE_TURNS];
    size_t bytes = 0;
    for (int k = 0; k < SV_SHADE_TURNS; k++) {
        plan_turn(species, axes, k, &view->turn[k], &turned[k]);
        bytes += outline_bytes(&view->turn[k]);
    }
    float *work = malloc(2 * (size_t)SV_OUTLINE_SIDE * SV_OUTLINE_SIDE * sizeof *work);
    uint8_t *at = view->texels = malloc(bytes + 1);
    if (!work || !at) {
        free(work);
        return sv_fail(error, SV_ENOMEM, "species", "no memory for silhouettes of %zu bytes", bytes);
    }
    for (int k = 0; k < SV_SHADE_TURNS; k++) {
        struct sv_shade_outline *o = &view->turn[k];
        if (o->levels == 0)
            continue;
        draw_outline(turned[k].cell, &turned[k].map, o, at);
        draw_levels(o, at, work);
        measure(o, at);
        widen_bounds(view, o);
        for (int n = 0; n < o->levels; n++) {
            o->level[n].coverage = at;
            at += (size_t)o->level[n].width * (size_t)o->level[n].height;
        }
    }
    free(work);
    return SV_OK;
}

void sv_shade_view_finish(struct sv_shade_view *view)
{
    free(view->texels);
    *view = (struct sv_shade_view){0};
}
