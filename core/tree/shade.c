/* shade.c - see shade.h: the object, the suns that it keeps, and the light at a point. */
#include "core/tree/shade.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/shade_private.h"

static enum sv_status look_at_trees(const struct sv_shade_species *species, int species_count,
                                    const struct sv_forest *forest, float *height_mean,
                                    struct sv_error *error)
{
    double height = 0;
    for (uint32_t k = 0; k < forest->count; k++) {
        const struct sv_tree *tree = &forest->trees[k];
        height += (double)tree->height_m;
        if (tree->species >= species_count || !species[tree->species].frames)
            return sv_fail(error, SV_EINVAL, "forest",
                           "tree %u is of species %u, which is not among the %d with an impostor",
                           tree->number, tree->species, species_count);
    }
    *height_mean = forest->count ? (float)(height / forest->count) : 1;
    return SV_OK;
}

/* Takes over what is known of a species; those with the same frames have one owner of their silhouettes. */
static void know_species(struct sv_tree_shade *shade, int k, const struct sv_shade_species *species)
{
    shade->species[k] = *species;
    shade->owner[k] = k;
    for (int i = shade->species_count - 1; i >= 0 && species->frames; i--)
        if (i != k && shade->species[i].frames == species->frames)
            shade->owner[k] = shade->owner[i];
    if (species->frames)
        shade->radius_max = fmaxf(shade->radius_max, species->radius);
}

enum sv_status sv_tree_shade_create(const struct sv_shade_species *species, int species_count,
                                    const struct sv_forest *forest, struct sv_tree_shade **out,
                                    struct sv_error *error)
{
    float height_mean = 1;
    enum sv_status status = look_at_trees(species, species_count, forest, &height_mean, error);
    if (status)
        return status;
    struct sv_tree_shade *shade = calloc(1, sizeof *shade);
    size_t count = (size_t)species_count + 1;
    if (shade) {
        shade->species = calloc(count, sizeof *shade->species);
        shade->owner = calloc(count, sizeof *shade->owner);
    }
    if (!shade || !shade->species || !shade->owner) {
        sv_tree_shade_destroy(shade);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to shade %d species", species_count);
    }
    shade->forest = forest;
    shade->species_count = species_count;
    shade->height_mean = height_mean;
    for (int k = 0; k < species_count; k++)
        know_species(shade, k, &species[k]);
    *out = shade;
    return SV_OK;
}

static void finish_sun(struct sv_shade_sun *sun, int species_count)
{
    for (int k = 0; sun->views && k < species_count; k++)
        sv_shade_view_finish(&sun->views[k]);
    free(sun->views);
    free(sun->light_axes);
    free(sun->lights);
    *sun = (struct sv_shade_sun){0};
}

void sv_tree_shade_destroy(struct sv_tree_shade *shade)
{
    if (!shade)
        return;
    for (int k = 0; k < SV_SHADE_SUNS; k++)
        finish_sun(&shade->suns[k], shade->species_count);
    free(shade->night);
    free(shade->night_axes);
    free(shade->species);
    free(shade->owner);
    free(shade);
}

struct sv_shade_axes sv_shade_axes_of(struct sv_vec3 to_sun)
{
    double across = sqrt(to_sun.x * to_sun.x + to_sun.y * to_sun.y);
    struct sv_shade_axes a = {.to_sun = to_sun, .right = sv_vec3(1, 0, 0)};
    if (across > 1e-9)
        a.right = sv_vec3(-to_sun.y / across, to_sun.x / across, 0);
    a.up = sv_normalize(sv_cross(to_sun, a.right));
    return a;
}

int sv_shade_turn(float rotation_rad)
{
    float turns = rotation_rad * (float)(SV_SHADE_TURNS / (2 * SV_PI));
    return (int)floorf(turns + 0.5f) & (SV_SHADE_TURNS - 1);
}

double sv_shade_ratio(double radius)
{
    return sv_clamp(radius / SV_SHADE_CROWN * (radius / SV_SHADE_CROWN), 1e-3, 4);
}

struct sv_vec3 sv_shade_middle(const struct sv_shade_axes *axes, double ratio)
{
    return sv_vec3(axes->to_sun.x, axes->to_sun.y, ratio * axes->to_sun.z);
}

double sv_shade_chord(const struct sv_shade_axes *axes, double radius)
{
    return radius / sqrt(sv_dot(sv_shade_middle(axes, sv_shade_ratio(radius)), axes->to_sun));
}

/* Rows lie over what the species covers, nodes at the middles of cells; columns are the crown's halves. */
static struct sv_tree_light_axes light_axes(const struct sv_shade_view *view,
                                            const struct sv_shade_axes *axes)
{
    double radius = fmax((double)view->reach, 1e-6), ratio = sv_shade_ratio(radius);
    struct sv_vec3 a = sv_shade_middle(axes, ratio);
    /* Towards the sun, 1 where the longest chord ends. */
    a = sv_scale(a, 1 / (radius * sqrt(sv_dot(a, axes->to_sun))));
    a = sv_scale(a, 0.5 / SV_SHADE_HALF);
    double along = (double)SV_SHADE_ROWS / fmax((double)view->top - (double)view->bottom, 1e-6);
    struct sv_vec3 b = sv_scale(axes->up, along);
    return (struct sv_tree_light_axes){
        {(float)a.x, (float)a.y, (float)a.z, (float)(0.5 - a.z * SV_SHADE_MIDDLE)},
        {(float)b.x, (float)b.y, (float)b.z, (float)(-(double)view->bottom * along - 0.5)}};
}

static enum sv_status make_sun(struct sv_tree_shade *shade, struct sv_vec3 to_sun, sv_shade_ground ground,
                               void *ground_context, struct sv_shade_sun *sun, struct sv_error *error)
{
    size_t species_count = (size_t)shade->species_count + 1, trees = (size_t)shade->forest->count + 1;
    *sun = (struct sv_shade_sun){.axes = sv_shade_axes_of(to_sun),
                                 .views = calloc(species_count, sizeof *sun->views),
                                 .light_axes = calloc(species_count, sizeof *sun->light_axes),
                                 .lights = malloc(trees * sizeof *sun->lights)};
    if (!sun->views || !sun->light_axes || !sun->lights)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for the light on %u trees",
                       shade->forest->count);
    for (int k = 0; k < shade->species_count; k++) {
        int owner = shade->owner[k];
        if (owner == k) {
            enum sv_status status = sv_shade_view_init(&shade->species[k], &sun->axes, &sun->views[k], error);
            if (status)
                return status;
        }
        sun->light_axes[k] = light_axes(&sun->views[owner], &sun->axes);
    }
    return sv_shade_stand(shade, sun, &(struct sv_shade_terrain){ground, ground_context}, error);
}

static bool same(struct sv_vec3 a, struct sv_vec3 b)
{
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

static enum sv_status set_night(struct sv_tree_shade *shade, struct sv_error *error)
{
    if (!shade->night)
        shade->night = calloc((size_t)shade->forest->count + 1, sizeof *shade->night);
    if (!shade->night_axes)
        shade->night_axes = calloc((size_t)shade->species_count + 1, sizeof *shade->night_axes);
    if (!shade->night || !shade->night_axes)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for %u trees at night", shade->forest->count);
    shade->dark = true;
    shade->current = NULL;
    return SV_OK;
}

enum sv_status sv_tree_shade_update(struct sv_tree_shade *shade, struct sv_vec3 to_sun,
                                    sv_shade_ground ground, void *ground_context, struct sv_error *error)
{
    double length = sv_length(to_sun);
    if (!(length > 0) || !(length < INFINITY))
        return sv_fail(error, SV_EINVAL, "to_sun", "(%g, %g, %g) is no direction", to_sun.x, to_sun.y,
                       to_sun.z);
    if (to_sun.z <= 0)
        return set_night(shade, error);
    struct sv_shade_sun *oldest = &shade->suns[0];
    for (int k = 0; k < SV_SHADE_SUNS; k++) {
        struct sv_shade_sun *sun = &shade->suns[k];
        if (sun->used && same(sun->axes.to_sun, to_sun)) {
            sun->used = ++shade->clock;
            shade->current = sun;
            shade->dark = false;
            return SV_OK;
        }
        if (sun->used < oldest->used)
            oldest = sun;
    }
    struct sv_shade_sun made;
    enum sv_status status = make_sun(shade, to_sun, ground, ground_context, &made, error);
    if (status) {
        finish_sun(&made, shade->species_count);
        return status;
    }
    finish_sun(oldest, shade->species_count);
    *oldest = made;
    oldest->used = ++shade->clock;
    shade->current = oldest;
    shade->dark = false;
    return SV_OK;
}

bool sv_tree_shade_keeps(const struct sv_tree_shade *shade, struct sv_vec3 to_sun)
{
    for (int k = 0; k < SV_SHADE_SUNS; k++)
        if (shade->suns[k].used && same(shade->suns[k].axes.to_sun, to_sun))
            return true;
    return false;
}

/* ---- a change of the forest ---- */

/* Species that have come get silhouettes under the sun. */
static enum sv_status see_new_species(struct sv_tree_shade *shade, const bool *is_new,
                                      struct sv_shade_sun *sun, struct sv_error *error)
{
    for (int k = 0; k < shade->species_count; k++) {
        if (!is_new[k])
            continue;
        if (shade->owner[k] == k) {
            enum sv_status status = sv_shade_view_init(&shade->species[k], &sun->axes, &sun->views[k], error);
            if (status)
                return status;
        }
        sun->light_axes[k] = light_axes(&sun->views[shade->owner[k]], &sun->axes);
    }
    return SV_OK;
}

/* Lights in the order of the forest as it is now. */
static enum sv_status carry_lights(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                                   const uint32_t *from, struct sv_error *error)
{
    uint32_t count = shade->forest->count;
    struct sv_tree_light *lights = malloc(((size_t)count + 1) * sizeof *lights);
    if (!lights)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for the light on %u trees", count);
    for (uint32_t k = 0, n; k < count; k += n) { /* stretches of trees stayed together */
        for (n = 1; k + n < count && from[k] != SV_FOREST_CAME && from[k + n] == from[k] + n;)
            n++;
        if (from[k] == SV_FOREST_CAME)
            lights[k] = (struct sv_tree_light){{{0}}};
        else
            memcpy(&lights[k], &sun->lights[from[k]], n * sizeof *lights);
    }
    free(sun->lights);
    sun->lights = lights;
    return SV_OK;
}

static enum sv_status change_sun(struct sv_tree_shade *shade, const struct sv_tree_shade_change *change,
                                 const bool *is_new, struct sv_shade_sun *sun, bool *left,
                                 struct sv_error *error)
{
    struct sv_shade_terrain terrain = {change->ground, change->ground_context};
    enum sv_status status = see_new_species(shade, is_new, sun, error);
    if (!status)
        status = carry_lights(shade, sun, change->from, error);
    return status ? status
                  : sv_shade_stand_again(shade, sun, &terrain, change->gone, change->gone_count, change->from,
                                         change->most, left, error);
}

enum sv_status sv_tree_shade_change(struct sv_tree_shade *shade, const struct sv_tree_shade_change *change,
                                    struct sv_error *error)
{
    bool *is_new = calloc((size_t)shade->species_count + 1, sizeof *is_new);
    if (!is_new)
        return sv_fail(error, SV_ENOMEM, "species", "no memory for %d species", shade->species_count);
    enum sv_status status =
        look_at_trees(change->species, shade->species_count, shade->forest, &shade->height_mean, error);
    for (int k = 0; k < shade->species_count && !status; k++) {
        is_new[k] = !shade->species[k].frames && change->species[k].frames;
        if (is_new[k])
            know_species(shade, k, &change->species[k]);
    }
    free(shade->night);
    shade->night = NULL;
    shade->current = NULL;
    shade->dark = false;
    for (int k = 0; k < SV_SHADE_SUNS; k++) {
        struct sv_shade_sun *sun = &shade->suns[k];
        bool kept = !status && sun->used && same(sun->axes.to_sun, change->to_sun), left = false;
        if (kept)
            status = change_sun(shade, change, is_new, sun, &left, error);
        if (kept && !left && !status)
            shade->current = sun;
        else
            finish_sun(sun, shade->species_count);
    }
    free(is_new);
    return status;
}

struct sv_tree_lights sv_tree_shade_lights(const struct sv_tree_shade *shade)
{
    if (shade->dark)
        return (struct sv_tree_lights){shade->night, shade->night_axes};
    if (!shade->current)
        return (struct sv_tree_lights){NULL, NULL};
    return (struct sv_tree_lights){shade->current->lights, shade->current->light_axes};
}

double sv_tree_shade_texel_m(const struct sv_tree_shade *shade)
{
    return shade->current ? shade->current->texel : 0;
}

static float hold(float v, float high)
{
    return v > 0 ? (v < high ? v : high) : 0;
}

float sv_tree_light_at(const struct sv_tree_light *light, const struct sv_tree_light_axes *axes,
                       const float p[3])
{
    const float *a = axes->across, *b = axes->along;
    float c = hold(a[0] * p[0] + a[1] * p[1] + a[2] * p[2] + a[3], SV_SHADE_COLUMNS - 1);
    float r = hold(b[0] * p[0] + b[1] * p[1] + b[2] * p[2] + b[3], SV_SHADE_ROWS - 1);
    float sum = 0;
    for (int i = 0; i < SV_SHADE_COLUMNS; i++)
        for (int j = 0; j < SV_SHADE_ROWS; j++)
            sum += (float)light->share[i][j] * fmaxf(0, 1 - fabsf(c - (float)i)) *
                   fmaxf(0, 1 - fabsf(r - (float)j));
    return sum / 255.0f;
}

float sv_tree_crown_light(float to_sun_z, float facing)
{
    float z2 = to_sun_z * to_sun_z;
    return (0.97f - 0.28f * z2 * z2 * z2) * (1 + 0.32f * expf((facing - 1) * 12.5f));
}
