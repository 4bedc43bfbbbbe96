/* sprite_setup.c - a tree in a view: which pictures stand for it, where they lie, what light they get. */
#include <math.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/scene/id.h"
#include "core/tree/sprite_private.h"

enum { LAST_LEVEL = SV_SPRITE_LEVELS - 1 };

/* Half of the zone where one picture passes into the next, of the way between them (impostor.h): a share of
 * the tree's height in the picture, px, held between bounds: what is small changes unseen. */
static const float BLEND_HALF_A_PX = 1.0f / 400, BLEND_HALF_MIN = 0.02f, BLEND_HALF_MAX = 0.12f;
/* Added to the level that has one texel a pixel, for trees of at most the first and at least the second
 * height, px; between them in between. Finer levels give back the contrast that filtering takes; small trees
 * would glitter. */
static const float LEVEL_BIAS[2] = {-0.1f, -0.7f}, LEVEL_BIAS_PX[2] = {20, 80};
/* Trees change their level at sizes of their own, this much apart at most: a forest's levels do not change in
 * a line. */
static const float LEVEL_SPREAD = 0.4f;
/* What stands out of a crown by one rms gets more of the sun by the first, and by the second times the cosine
 * between the directions to sun and viewer, and more of the sky by the third: leaves shade one another, of
 * which mean openness knows nothing. Fitted to the gradient energy of ray casts of dense forests. */
static const float STAND = 0.3f, STAND_FACING = 0.3f, STAND_SKY = 0.1f;
/* By how much of a tree's height what is seen of it from its side gets its light from higher up than where it
 * stands in the picture: leaves of trees behind reach through crowns from which a picture of one tree alone
 * hides them, and those that do so are above. Nothing where no tree shades another. Fitted to the mean light
 * of ray casts of stands of 20,000 and 45,000 trees a square kilometre under suns of 20 to 60 degrees. */
static const float SEEN_ABOVE = 0.13f;
/* Smaller trees, px, and those that are magnified have their coverage taken between texels. */
static const float BETWEEN_BELOW_PX = 6;
/* Trees taller than this in the picture have their texels moved by depth, px. */
static const float MOVE_MIN_PX = 20;
/* Pixels a texel of level 0 at which moving by depth begins to fade, and has faded: depth has texels four
 * times as large, and enlarged crowns would tear along them. */
static const float MOVE_FADE[2] = {0.6f, 1.2f};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(const float a[3], const float b[3], float out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Model space to world axes: sv_rotate_clockwise with c, s at hand. */
static void turn(float c, float s, const float p[3], float out[3])
{
    out[0] = c * p[0] + s * p[1];
    out[1] = c * p[1] - s * p[0];
    out[2] = p[2];
}

static int clamp_int(float v, int lo, int hi)
{
    return v > (float)lo ? v < (float)hi ? (int)v : hi : lo;
}

/* The box of pixels whose centres lie in [lo, hi], held to the picture, so that a picture does not depend on
 * the band that it is drawn in; false when none of it is in the band. */
static bool set_box(const struct sv_sprite_frame_view *view, const float lo[2], const float hi[2],
                    struct sv_sprite_tree *out)
{
    out->x0 = clamp_int(ceilf(lo[0]), 0, view->width);
    out->x1 = clamp_int(floorf(hi[0]) + 1, 0, view->width);
    out->y0 = clamp_int(ceilf(lo[1]), 0, view->height);
    out->y1 = clamp_int(floorf(hi[1]) + 1, 0, view->height);
    return out->x0 < out->x1 && out->y0 < out->y1 && out->y0 < view->row_last && out->y1 > view->row_first;
}

bool sv_sprite_bound(const struct sv_sprite_frame_view *view, const struct sv_sprite_species *species,
                     const struct sv_tree *tree, struct sv_sprite_tree *out)
{
    float h = tree->height_m, radius = h * species->reach;
    float p[3] = {(float)(tree->x - view->eye.x), (float)(tree->y - view->eye.y),
                  (float)(tree->z - view->eye.z) + 0.5f * h};
    float x = dot3(p, view->right), y = dot3(p, view->up), z = dot3(p, view->forward), scale = view->focal_px;
    out->near_z = z - radius;
    if (!(z + radius > view->near_m))
        return false;
    float reach = radius * scale + 1;
    if (!view->orthographic) {
        if (!(z - radius > view->near_m)) {
            static const float all[2][2] = {{-INFINITY, -INFINITY}, {INFINITY, INFINITY}};
            return set_box(view, all[0], all[1], out);
        }
        scale /= z;
        /* A ball's outline about its middle's place is longer the farther off the axis: by 1 / cos^2. */
        float off = (x * x + y * y) / (z * z);
        reach = radius * scale * (1 + off) * z / (z - radius) + 1;
    }
    float cx = view->center_x + scale * x, cy = view->center_y - scale * y;
    const float lo[2] = {cx - reach, cy - reach}, hi[2] = {cx + reach, cy + reach};
    return set_box(view, lo, hi, out);
}

/* One picture laid into space: texel (u, v) at origin + u a + v b + e w, eye-relative, m. */
struct laid {
    float origin[3], a[3], b[3], w[3];
};

struct detail {
    int level;
    float inflate; /* >= 1: sides of a tree below the last level's size are this much longer */
};

/* pixels: of the picture, a model unit. */
static struct detail choose_detail(const struct sv_sprite_frame *f, float pixels, uint32_t number)
{
    float large = (pixels - LEVEL_BIAS_PX[0]) / (LEVEL_BIAS_PX[1] - LEVEL_BIAS_PX[0]);
    float bias = LEVEL_BIAS[0] + (LEVEL_BIAS[1] - LEVEL_BIAS[0]) * fminf(fmaxf(large, 0), 1);
    float lod = log2f(f->of.texels / fmaxf(pixels, 1e-12f)) + bias;
    float own = (float)(number * 0x9E3779B9u >> 8) * 0x1p-24f - 0.5f;
    struct detail d = {clamp_int(floorf(lod + LEVEL_SPREAD * own + 0.5f), 0, LAST_LEVEL), 1};
    if (lod > (float)LAST_LEVEL + 0.5f)
        d.inflate = exp2f(lod - (float)LAST_LEVEL - 0.5f);
    return d;
}

/* By how much a picture is drawn wider, about the tree's axis: a crown is round, and seen from beside its
 * frame it does not get narrower, as a plane picture of it would. to_viewer: unit, model space. */
static float widen(const struct sv_impostor_frame *f, const float to_viewer[3])
{
    float beside = dot3(f->right, to_viewer);
    return 1 / sqrtf(fmaxf(1 - beside * beside, 0.5f));
}

/* c, s: cosine and sine of the tree's rotation. */
static void lay(const struct sv_sprite_frame *f, struct detail detail, const float foot[3], float h, float c,
                float s, float wider, struct laid *out)
{
    const struct sv_sprite_level *l = &f->level[detail.level];
    float cell = SV_SPRITE_CELL, texel = (float)(1 << detail.level) / cell;
    float axis = -dot3(f->of.origin, f->of.right) * f->of.texels / cell;
    float along_s[3], along_t[3], origin[3], toward[3];
    turn(c, s, f->of.along_s, along_s);
    turn(c, s, f->of.along_t, along_t);
    turn(c, s, f->of.origin, origin);
    turn(c, s, f->of.toward, toward);
    /* s = (left + (u - 1/2) 2^level) / cell, blown up about the middle of what is covered. */
    float step_u = texel * detail.inflate, step_v = step_u;
    float mid_u = 0.5f * (float)l->width + 0.5f, mid_v = 0.5f * (float)l->height + 0.5f;
    float mid_s = (float)f->left / cell + (mid_u - 0.5f) * texel;
    float mid_t = (float)f->top / cell + (mid_v - 0.5f) * texel;
    mid_s = axis + (mid_s - axis) * wider;
    step_u *= wider;
    for (int k = 0; k < 3; k++) {
        out->a[k] = h * step_u * along_s[k];
        out->b[k] = h * step_v * along_t[k];
        out->w[k] = h * toward[k];
        out->origin[k] = foot[k] + h * (origin[k] + (mid_s - mid_u * step_u) * along_s[k] +
                                        (mid_t - mid_v * step_v) * along_t[k]);
    }
}

/* Grows lo, hi by the picture position of the four corners at depth e; false when one is not in front. */
static bool grow_box(const struct sv_sprite_frame_view *view, const struct laid *laid, float u_end,
                     float v_end, float e, float lo[2], float hi[2], float *near_z)
{
    for (int k = 0; k < 4; k++) {
        float p[3];
        for (int c = 0; c < 3; c++)
            p[c] = laid->origin[c] + (k & 1 ? u_end : 0) * laid->a[c] + (k & 2 ? v_end : 0) * laid->b[c] +
                   e * laid->w[c];
        float z = dot3(p, view->forward);
        *near_z = fminf(*near_z, z);
        if (!view->orthographic && !(z > view->near_m))
            return false;
        float scale = view->orthographic ? view->focal_px : view->focal_px / z;
        float x = view->center_x + scale * dot3(p, view->right);
        float y = view->center_y - scale * dot3(p, view->up);
        lo[0] = fminf(lo[0], x);
        hi[0] = fmaxf(hi[0], x);
        lo[1] = fminf(lo[1], y);
        hi[1] = fmaxf(hi[1], y);
    }
    return true;
}

/* Axes that normals are read in. Leaves show the viewer the side that faces him, wherever he stands, so the
 * mean of a texel's normals follows him: the frame's axes are turned, by the shortest way, until they face
 * the true viewer. Without this the sunlit share of a crown is off by up to 10 % between frames. right comes
 * in as the frame's own. */
static void face_viewer(const float to_viewer[3], float right[3], float up[3], float toward[3])
{
    float length = sqrtf(dot3(to_viewer, to_viewer)), off = 0, across = 0;
    for (int a = 0; a < 3; a++)
        toward[a] = length > 0 ? to_viewer[a] / length : a == 2;
    off = dot3(right, toward);
    for (int a = 0; a < 3; a++)
        up[a] = right[a] - off * toward[a];
    across = sqrtf(dot3(up, up));
    for (int a = 0; a < 3; a++)
        right[a] = across > 1e-3f ? up[a] / across : right[a];
    cross3(toward, right, up);
}

/* The ray of the box' first pixel and its steps: direction (perspective) and origin (orthographic). */
struct rays {
    float origin[3][3], direction[3][3]; /* [at, a column, a row] */
};

static void set_rays(const struct sv_sprite_frame_view *view, int x0, int y0, struct rays *rays)
{
    float each = 1 / view->focal_px;
    float x = ((float)x0 - view->center_x) * each, y = (view->center_y - (float)y0) * each;
    memset(rays, 0, sizeof *rays);
    float(*moving)[3] = view->orthographic ? rays->origin : rays->direction;
    for (int k = 0; k < 3; k++) {
        moving[0][k] = x * view->right[k] + y * view->up[k];
        moving[1][k] = each * view->right[k];
        moving[2][k] = -each * view->up[k];
        rays->direction[0][k] += view->forward[k];
    }
}

/* r . m for each part of the direction. */
static struct sv_sprite_affine along(const struct rays *rays, const float m[3])
{
    return (struct sv_sprite_affine){dot3(rays->direction[0], m), dot3(rays->direction[1], m),
                                     dot3(rays->direction[2], m)};
}

/* sprite_private.h. Of the products of direction and origin only one factor moves. */
static void set_mapping(const struct sv_sprite_frame_view *view, const struct rays *rays,
                        const struct laid *laid, struct sv_sprite *s)
{
    float n[3], m[3], from[3];
    const float *r = rays->direction[0];
    cross3(laid->a, laid->b, n);
    s->c = along(rays, n);
    cross3(laid->b, laid->w, m);
    s->u_depth = along(rays, m);
    cross3(laid->w, laid->a, m);
    s->v_depth = along(rays, m);
    s->z_depth = dot3(laid->w, n);
    for (int k = 0; k < 3; k++)
        from[k] = laid->origin[k] - rays->origin[0][k];
    cross3(laid->b, from, m);
    s->u = along(rays, m);
    cross3(from, laid->a, m);
    s->v = along(rays, m);
    s->z = (struct sv_sprite_affine){dot3(from, n), -dot3(rays->origin[1], n), -dot3(rays->origin[2], n)};
    if (!view->orthographic)
        return;
    float *u = &s->u.at, *v = &s->v.at;
    for (int k = 1; k < 3; k++) {
        cross3(rays->origin[k], laid->b, m);
        u[k] = dot3(r, m);
        cross3(laid->a, rays->origin[k], m);
        v[k] = dot3(r, m);
    }
}

static void set_texels(const struct sv_sprite_atlas *atlas, const struct sv_sprite_frame *f, int level,
                       struct sv_sprite *s)
{
    const struct sv_sprite_level *l = &f->level[level];
    s->texels = atlas->texels + l->texel_first;
    s->smooth = atlas->smooth + l->smooth_first;
    s->stride = l->width + 2;
    s->smooth_stride = sv_sprite_smooth_size(l->width, level);
    s->shift = sv_sprite_shift(level);
    s->u_max = ((float)l->width + 1) * (1 - 0x1p-22f);
    s->v_max = ((float)l->height + 1) * (1 - 0x1p-22f);
    s->block_u = SV_SPRITE_BLOCKS * (1 - 0x1p-20f) / ((float)l->width + 1);
    s->block_v = SV_SPRITE_BLOCKS * (1 - 0x1p-20f) / ((float)l->height + 1);
    memcpy(s->blocks, l->blocks, sizeof s->blocks);
    s->depth_first = f->depth_first;
    s->depth_step = f->depth_step;
}

/* What is told of one tree. */
struct subject {
    const struct sv_tree *tree;
    float foot[3], to_viewer[3]; /* eye-relative; unit, world */
    float model_viewer[3];       /* unit, model space */
    float c, s;
    float pixels; /* a model unit */
    const struct sv_tree_light *light;
    const struct sv_tree_light_axes *axes;
    float crown; /* sv_tree_crown_light */
};

static void set_light(const struct sv_sprite_frame_view *view, const struct subject *of,
                      const struct sv_sprite_frame *f, int level, struct sv_sprite *s)
{
    float up[3], toward[3], sun[3];
    turn(of->c, of->s, f->of.right, s->right);
    face_viewer(of->to_viewer, s->right, up, toward);
    memcpy(s->top, up, sizeof up);
    s->sun[0] = dot3(view->to_sun, s->right);
    s->sun[1] = dot3(view->to_sun, up);
    s->sun[2] = dot3(view->to_sun, toward);
    s->up[0] = up[2];
    s->up[1] = toward[2];
    s->gain = sv_impostor_gain(f->of.scatter, f->guess[level], s->sun);
    turn(of->c, -of->s, view->to_sun, sun);
    s->open_at = 0;
    s->stand = (STAND + STAND_FACING * s->sun[2]) / SV_SPRITE_PROMINENCE;
    s->stand_sky = STAND_SKY / SV_SPRITE_PROMINENCE;
    for (int k = 0; k < 3; k++) {
        s->open[k] = sun[k] * (2.0f / 255.0f);
        s->open_at -= sun[k];
    }
    s->open[3] = 1.0f / 255.0f;
}

/* Coordinates on the tree's grid of light, and its nodes. */
static void set_grid(const struct subject *of, const struct laid *laid, struct sv_sprite *s)
{
    if (!of->light) {
        memset(s->column, 0, sizeof s->column);
        memset(s->row, 0, sizeof s->row);
        for (int k = 0; k < 8; k++)
            s->light[k] = 1;
        return;
    }
    float each = 1 / of->tree->height_m, from[3];
    for (int k = 0; k < 3; k++)
        from[k] = laid->origin[k] - of->foot[k];
    from[2] += SEEN_ABOVE * of->tree->height_m * (1 - of->to_viewer[2] * of->to_viewer[2]);
    s->column[0] = dot3(of->axes->across, laid->a) * each;
    s->column[1] = dot3(of->axes->across, laid->b) * each;
    s->column[2] = dot3(of->axes->across, from) * each + of->axes->across[3];
    s->row[0] = dot3(of->axes->along, laid->a) * each;
    s->row[1] = dot3(of->axes->along, laid->b) * each;
    s->row[2] = dot3(of->axes->along, from) * each + of->axes->along[3];
    for (int k = 0; k < 8; k++)
        s->light[k] = of->crown * (1.0f / 255.0f) * (float)of->light->share[k >> 2][k & 3];
}

static void describe(const struct sv_sprite_frame_view *view, const struct sv_tree *tree, struct subject *of)
{
    float h = tree->height_m, to_eye[3];
    of->tree = tree;
    of->c = cosf(tree->rotation_rad);
    of->s = sinf(tree->rotation_rad);
    of->foot[0] = (float)(tree->x - view->eye.x);
    of->foot[1] = (float)(tree->y - view->eye.y);
    of->foot[2] = (float)(tree->z - view->eye.z);
    const float middle[3] = {of->foot[0], of->foot[1], of->foot[2] + 0.5f * h};
    for (int k = 0; k < 3; k++)
        to_eye[k] = view->orthographic ? -view->forward[k] : -middle[k];
    float length = sqrtf(dot3(to_eye, to_eye));
    for (int k = 0; k < 3; k++)
        of->to_viewer[k] = length > 0 ? to_eye[k] / length : (float)(k == 2);
    turn(of->c, -of->s, of->to_viewer, of->model_viewer);
    float depth = fmaxf(dot3(middle, view->forward), view->near_m);
    of->pixels = h * view->focal_px / (view->orthographic ? 1 : depth);
    of->crown = sv_tree_crown_light(view->to_sun[2], dot3(of->to_viewer, view->to_sun));
}

/* Distance to the viewer, m, as the air's haze counts it: of the tree's middle. */
static float air_keep(const struct sv_sprite_frame_view *view, const struct subject *of)
{
    if (!(view->air_length_m > 0))
        return 1;
    float m[3] = {of->foot[0], of->foot[1], of->foot[2] + 0.5f * of->tree->height_m};
    float distance = view->orthographic ? dot3(m, view->forward) : sqrtf(dot3(m, m));
    return expf(-distance / view->air_length_m);
}

/* One picture but for its mapping, which waits for the tree's box; grows the box. */
static void set_picture(const struct sv_sprite_frame_view *view, const struct sv_sprite_atlas *atlas,
                        const struct subject *of, int index, float weight, struct laid *laid, float lo[2],
                        float hi[2], bool *in_front, struct sv_sprite *s)
{
    const struct sv_sprite_frame *f = &atlas->frames[index];
    struct detail detail = choose_detail(f, of->pixels, of->tree->number);
    lay(f, detail, of->foot, of->tree->height_m, of->c, of->s, widen(&f->of, of->model_viewer), laid);
    set_texels(atlas, f, detail.level, s);
    s->weight = weight / (255.0f * detail.inflate * detail.inflate);
    float fade = (MOVE_FADE[1] - of->pixels / f->of.texels) / (MOVE_FADE[1] - MOVE_FADE[0]);
    fade = fminf(fmaxf(fade, 0), 1);
    s->depth_first *= fade;
    s->depth_step *= fade;
    s->move = of->pixels > MOVE_MIN_PX && s->depth_step > 0;
    s->near_z = INFINITY;
    s->between = of->pixels < BETWEEN_BELOW_PX || of->pixels > f->of.texels;
    const struct sv_sprite_level *l = &f->level[detail.level];
    float u_end = (float)l->width + 1, v_end = (float)l->height + 1;
    for (int k = 0; k < (s->move ? 2 : 1); k++) {
        float e = s->move ? s->depth_first + (k ? 255 * s->depth_step : 0) : 0;
        *in_front &= grow_box(view, laid, u_end, v_end, e, lo, hi, &s->near_z);
    }
    set_light(view, of, f, detail.level, s);
    set_grid(of, laid, s);
}

int sv_sprite_set_up(const struct sv_sprite_frame_view *view, const struct sv_sprite_species *species,
                     const struct sv_tree *tree, const struct sv_tree_light *light,
                     const struct sv_tree_light_axes *axes, struct sv_sprite_tree *out,
                     struct sv_sprite sprites[SV_SPRITE_FRAMES_MAX])
{
    struct subject of = {.light = light, .axes = axes};
    struct laid laid[SV_SPRITE_FRAMES_MAX];
    int frames[SV_SPRITE_FRAMES_MAX], count = 0;
    float weights[SV_SPRITE_FRAMES_MAX], lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    bool in_front = true;
    describe(view, tree, &of);
    float half = fminf(fmaxf(of.pixels * BLEND_HALF_A_PX, BLEND_HALF_MIN), BLEND_HALF_MAX);
    int found =
        sv_impostor_blend(of.model_viewer[0], of.model_viewer[1], of.model_viewer[2], half, frames, weights);
    out->near_z = INFINITY;
    for (int k = 0; k < found; k++) {
        if (species->atlas->frames[frames[k]].level[0].width == 0)
            continue;
        set_picture(view, species->atlas, &of, frames[k], weights[k], &laid[count], lo, hi,
                    &in_front, &sprites[count]);
        out->near_z = fminf(out->near_z, sprites[count].near_z);
        count++;
    }
    if (!in_front) {
        lo[0] = lo[1] = -INFINITY;
        hi[0] = hi[1] = INFINITY;
    }
    if (count == 0 || !set_box(view, lo, hi, out))
        return 0;
    struct rays rays;
    set_rays(view, out->x0, out->y0, &rays);
    for (int k = 0; k < count; k++)
        set_mapping(view, &rays, &laid[k], &sprites[k]);
    out->count = (uint32_t)count;
    out->id = SV_ID_TREE_FIRST + tree->number;
    out->keep = air_keep(view, &of);
    return count;
}
