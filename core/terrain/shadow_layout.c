/* shadow_layout.c - which windows of shadows a view needs. */
#include <math.h>
#include <stdbool.h>

#include "core/terrain/shadow_window.h"

enum { SIDE = SV_SHADOW_WINDOW_SIDE };

/* The ladder: each window's texel is RATIO times the one before. */
static const double FINEST_M = 0.125;
enum { RATIO = 4, LADDER = 12 };
/* A window stands this share of its side ahead of the eye, on a lattice of that share. */
static const double AHEAD = 0.25, LATTICE = 0.125;
/* Texels may be this many pixels wide where the view is nearest to the ground. */
static const double TEXEL_PX = 1.5;
/* The farthest pixels (seen at a slant, twice as large as square on) are larger than this many texels. */
static const double OUTER_PX = 1;
/* Highest tree or house whose shadow-bearing ground must be seen, and slack for relief between probes, m. */
static const double SLACK_M = 20;

static double side_x(const struct sv_heightfield *f)
{
    return (f->width - 1) * f->dx;
}
static double side_y(const struct sv_heightfield *f)
{
    return (f->height - 1) * f->dy;
}

/* The window over all of the field, a texel to spare. */
static struct sv_shadow_place whole(const struct sv_heightfield *f)
{
    double texel = fmax(side_x(f), side_y(f)) / (SIDE - 4);
    return (struct sv_shadow_place){f->x0 + 0.5 * side_x(f) - 0.5 * SIDE * texel,
                                    f->y0 + 0.5 * side_y(f) - 0.5 * SIDE * texel, texel};
}

static struct sv_shadow_place snapped(double x, double y, double texel_m)
{
    double w = SIDE * texel_m, step = LATTICE * w;
    return (struct sv_shadow_place){round(x / step) * step - 0.5 * w, round(y / step) * step - 0.5 * w,
                                    texel_m};
}

static bool touches_field(const struct sv_heightfield *f, struct sv_shadow_place p)
{
    double w = SIDE * p.texel_m;
    return p.x0 < f->x0 + side_x(f) && p.x0 + w > f->x0 && p.y0 < f->y0 + side_y(f) && p.y0 + w > f->y0;
}

/* Lowest and highest ground of the window by probes; what they miss makes a far corner coarser at worst. */
static void probe(const struct sv_heightfield *f, struct sv_shadow_place p, double range[2])
{
    enum { PROBES = 12 };
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int b = 0; b <= PROBES; b++)
        for (int a = 0; a <= PROBES; a++) {
            double z, x = sv_clamp(p.x0 + a * SIDE * p.texel_m / PROBES, f->x0, f->x0 + side_x(f));
            double y = sv_clamp(p.y0 + b * SIDE * p.texel_m / PROBES, f->y0, f->y0 + side_y(f));
            if (!sv_heightfield_height(f, x, y, &z))
                continue;
            range[0] = fmin(range[0], z);
            range[1] = fmax(range[1], z);
        }
}

/* Whether the box of the window's ground reaches into the view volume. */
static bool seen(const struct sv_heightfield *f, const struct sv_camera *camera, struct sv_shadow_place p)
{
    double planes[5][4], range[2], w = SIDE * p.texel_m;
    probe(f, p, range);
    if (!(range[1] >= range[0]))
        return true;
    double slack = fmin(SLACK_M, 0.1 * w);
    sv_camera_planes(camera, planes);
    for (int k = 0; k < 5; k++) {
        const double *n = planes[k];
        double x = n[0] > 0 ? p.x0 + w : p.x0, y = n[1] > 0 ? p.y0 + w : p.y0;
        double z = n[2] > 0 ? range[1] + slack : range[0] - slack;
        if (n[0] * (x - camera->eye.x) + n[1] * (y - camera->eye.y) + n[2] * (z - camera->eye.z) + n[3] < 0)
            return false;
    }
    return true;
}

/* Steepest of the picture's rays, as the sine of its depression: 1 when straight down is in the picture. */
static double steepest(const struct sv_camera *c)
{
    struct sv_vec3 origin, ray;
    double px, py, depth, most = -1;
    if (sv_camera_project(c, sv_vec3(c->eye.x, c->eye.y, c->eye.z - 10), &px, &py, &depth) && px >= 0 &&
        py >= 0 && px <= c->width && py <= c->height)
        return 1;
    /* Along the border of the picture: the extreme of a great circle's arc may lie inside a side. */
    for (int k = 0; k < 4; k++)
        for (int a = 0; a < 8; a++) {
            double t = a / 8.0, x = k == 0 ? t : k == 1 ? 1 : k == 2 ? 1 - t : 0;
            double y = k == 0 ? 0 : k == 1 ? t : k == 2 ? 1 : 1 - t;
            sv_camera_ray(c, x * c->width, y * c->height, &origin, &ray);
            most = fmax(most, -ray.z / sv_length(ray));
        }
    return most;
}

/* How near the view may come to the ground, m: along its steepest ray, less a third for relief. */
static double nearest_ground(const struct sv_heightfield *f, const struct sv_camera *c)
{
    double x = sv_clamp(c->eye.x, f->x0, f->x0 + side_x(f)), y = sv_clamp(c->eye.y, f->y0, f->y0 + side_y(f));
    double ground = f->z0, off = hypot(c->eye.x - x, c->eye.y - y);
    (void)sv_heightfield_height(f, x, y, &ground);
    double above = fmax(c->eye.z - ground, 0);
    double along = 0.67 * above / fmax(steepest(c), 0.25);
    return fmax(along, off);
}

static void choose_perspective(const struct sv_heightfield *f, const struct sv_camera *c, double finest_m,
                               struct sv_shadow_layout *layout)
{
    struct sv_shadow_place last = whole(f);
    double useful = fmax(TEXEL_PX * nearest_ground(f, c) / sv_camera_focal_px(c), finest_m);
    double level = hypot(c->forward.x, c->forward.y);
    double ahead_x = level > 1e-6 ? c->forward.x / level : 0,
           ahead_y = level > 1e-6 ? c->forward.y / level : 0;
    double texel = FINEST_M;
    for (int k = 0; k < LADDER && texel * 2 <= last.texel_m && layout->count < SV_SHADOW_LEVELS_MAX - 1;
         k++, texel *= RATIO) {
        if (texel * RATIO <= useful)
            continue;
        double ahead = AHEAD * SIDE * texel * level;
        struct sv_shadow_place p = snapped(c->eye.x + ahead * ahead_x, c->eye.y + ahead * ahead_y, texel);
        if (touches_field(f, p) && seen(f, c, p))
            layout->place[layout->count++] = p;
    }
    layout->place[layout->count++] = last;
    double far = hypot(fmax(fabs(c->eye.x - f->x0), fabs(c->eye.x - f->x0 - side_x(f))),
                       fmax(fabs(c->eye.y - f->y0), fabs(c->eye.y - f->y0 - side_y(f))));
    layout->outer =
        far / sv_camera_focal_px(c) > OUTER_PX * last.texel_m && layout->count < SV_SHADOW_LEVELS_MAX;
}

/* Rectangle of the ground that an orthographic picture sees from above; false for a level one. */
static bool footprint(const struct sv_heightfield *f, const struct sv_camera *c, double box[4])
{
    if (c->forward.z > -1e-3)
        return false;
    box[0] = box[1] = INFINITY;
    box[2] = box[3] = -INFINITY;
    for (int k = 0; k < 8; k++) {
        struct sv_vec3 origin, ray;
        sv_camera_ray(c, k & 1 ? c->width : 0, k & 2 ? c->height : 0, &origin, &ray);
        double z = f->z0 + (double)(k & 4 ? f->h_max : f->h_min) - c->eye.z;
        double t = (z - origin.z) / ray.z;
        box[0] = fmin(box[0], c->eye.x + origin.x + t * ray.x);
        box[1] = fmin(box[1], c->eye.y + origin.y + t * ray.y);
        box[2] = fmax(box[2], c->eye.x + origin.x + t * ray.x);
        box[3] = fmax(box[3], c->eye.y + origin.y + t * ray.y);
    }
    box[0] = fmax(box[0], f->x0);
    box[1] = fmax(box[1], f->y0);
    box[2] = fmin(box[2], f->x0 + side_x(f));
    box[3] = fmin(box[3], f->y0 + side_y(f));
    return true;
}

static void choose_orthographic(const struct sv_heightfield *f, const struct sv_camera *c, double finest_m,
                                struct sv_shadow_layout *layout)
{
    double box[4], texel = FINEST_M;
    struct sv_shadow_place last = whole(f);
    if (!footprint(f, c, box)) {
        layout->place[layout->count++] = last;
        return;
    }
    double side = fmax(box[2] - box[0], box[3] - box[1]);
    if (!(side > 0))
        return;
    while (texel * 2 <= finest_m || side > (1 - LATTICE) * SIDE * texel - 4 * texel)
        texel *= 2;
    layout->place[layout->count++] =
        texel < last.texel_m ? snapped(0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]), texel) : last;
}

void sv_shadow_layout_choose(const struct sv_heightfield *field, const struct sv_camera *camera,
                             double finest_m, struct sv_shadow_layout *layout)
{
    layout->count = 0;
    layout->outer = false;
    if (camera->projection == SV_PROJECTION_ORTHOGRAPHIC)
        choose_orthographic(field, camera, finest_m, layout);
    else
        choose_perspective(field, camera, finest_m, layout);
}
