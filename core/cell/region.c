/* region.c - M, and the error that a move from V is predicted to bring. */
#include "core/cell/region.h"

#include <math.h>

bool sv_region_holds(struct sv_vec3 offset)
{
    double x = fabs(offset.x), y = fabs(offset.y), z = fabs(offset.z);
    return x + y <= 1 && x + z <= 1 && y + z <= 1;
}

/* sec^2 of the angle between the picture's axis and its corner. */
static double corner_stretch(const struct sv_region_view *view)
{
    double x = 0.5 * view->width / view->focal_px, y = 0.5 * view->height / view->focal_px;
    return 1 + x * x + y * y;
}

static double opening(double move, double rising, double falling)
{
    return move > 0 ? move * falling : -move * rising;
}

/* stretch: m of the header. */
static double hole_share(const struct sv_region_panel *panel, const double e[3], double stretch)
{
    const struct sv_cell_jumps *s = &panel->jumps;
    if (s->texels == 0)
        return 0;
    double sum = opening(e[0], s->x_plus, s->x_minus) + opening(e[1], s->y_plus, s->y_minus) +
                 fabs(e[2]) * (s->xx + s->yy);
    return 0.5 * panel->size * sum * stretch / s->texels;
}

/* lean: gamma q of the nearest content. */
static double stretch_of(double lean)
{
    double near = 1 - lean;
    return lean > 0 ? 1 / (near * near * near) : near * near;
}

/* e: (alpha, beta, gamma). low, high: between which gamma lies for all eyes that are meant. */
static struct sv_region_error predict(const struct sv_region_panel *panel, const double e[3], double low,
                                      double high, const struct sv_region_view *view)
{
    double q = panel->q_most;
    if (!(high < 1 && high * q < 1 && low > -INFINITY && fabs(e[0]) < INFINITY && fabs(e[1]) < INFINITY))
        return (struct sv_region_error){INFINITY, INFINITY, INFINITY, INFINITY};
    double approach = 1 / (1 - fmax(high * q, 0)), forward = fmax(high, -low);
    double focal = view->focal_px * corner_stretch(view);
    double flow = hypot(fabs(e[0]) + forward, fabs(e[1]) + forward) * approach * approach;
    struct sv_region_error error = {
        .hole_share = hole_share(panel, e, fmax(stretch_of(low * q), stretch_of(high * q))),
        .texel_px = 2 * focal / panel->size * approach,
    };
    error.position_px = sqrt(0.5) * error.texel_px + focal * flow * 0x1p-16;
    error.total = view->hole_weight * error.hole_share + view->pixel_weight * error.position_px;
    return error;
}

static void along_face(enum sv_cell_face face, struct sv_vec3 offset, double e[3])
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(face, &right, &up, &forward);
    e[0] = sv_dot(offset, right);
    e[1] = sv_dot(offset, up);
    e[2] = sv_dot(offset, forward);
}

struct sv_region_error sv_region_predict(const struct sv_region_panel *panel, struct sv_vec3 offset,
                                         const struct sv_region_view *view)
{
    double e[3];
    along_face(panel->face, offset, e);
    return predict(panel, e, e[2], e[2], view);
}

/* The corners of M: six where four faces meet, eight where three do. */
enum { CORNERS = 14 };
static struct sv_vec3 corner(int n)
{
    double sign = n & 1 ? -1 : 1;
    if (n < 6)
        return sv_vec3(n / 2 == 0 ? sign : 0, n / 2 == 1 ? sign : 0, n / 2 == 2 ? sign : 0);
    int m = n - 6;
    return sv_vec3(m & 1 ? -0.5 : 0.5, m & 2 ? -0.5 : 0.5, m & 4 ? -0.5 : 0.5);
}

/* With the stretches of the whole r M, what is left of the prediction is convex in the offset, so that its
 * largest value is at a corner. */
static bool within(const struct sv_region_panel *panel, double r, bool top, const struct sv_region_view *view,
                   double tolerance)
{
    struct sv_vec3 centre = sv_vec3(0, 0, top ? -r : 0);
    double middle[3], e[3];
    along_face(panel->face, centre, middle);
    for (int n = 0; n < CORNERS; n++) {
        along_face(panel->face, sv_madd(centre, corner(n), r), e);
        if (!(predict(panel, e, middle[2] - r, middle[2] + r, view).total <= tolerance))
            return false;
    }
    return true;
}

double sv_region_radius(const struct sv_region_panel *panels, int count, bool top,
                        const struct sv_region_view *view, double tolerance)
{
    double low = 0, high = 1;
    while (high - low > 0x1p-20) {
        double r = 0.5 * (low + high);
        int n = 0;
        while (n < count && within(&panels[n], r, top, view, tolerance))
            n++;
        *(n == count ? &low : &high) = r;
    }
    return low;
}

double sv_region_pitch(const struct sv_region_panel *panels, int count, bool top,
                       const struct sv_region_view *view, double tolerance)
{
    double most = fmin(0.5 * sv_region_radius(panels, count, top, view, tolerance), SV_CELL_PITCH_MAX);
    double pitch = SV_REGION_PITCH_LEAST;
    while (2 * pitch <= most)
        pitch *= 2;
    return pitch;
}

/* The root below 1 of kappa (1 - r)^2 = r, in the form that cancels nothing. */
double sv_region_radius_hard(double eps_px, double focal_px, double jump)
{
    if (!(eps_px > 0 && focal_px > 0))
        return 0;
    if (jump <= 0)
        return 1;
    double kappa = eps_px / (focal_px * jump);
    return isnan(kappa) ? 0 : isinf(kappa) ? 1 : 2 * kappa / (2 * kappa + 1 + sqrt(4 * kappa + 1));
}
