#include "tests/experiments/plot.h"

#include <math.h>
#include <stdio.h>

enum { WIDTH = 960, HEIGHT = 560, LEFT = 70, TOP = 40, BOTTOM = 50, RIGHT = 250, TICKS = 6 };
static const char *const COLORS[] = {"#1b6ca8", "#c0392b", "#27864a", "#8e44ad", "#d68910",
                                     "#2e4053", "#d81b60", "#00838f", "#6d4c41"};
enum { COLOR_COUNT = sizeof COLORS / sizeof COLORS[0] };

struct scale {
    double lo, hi;
    bool log;
};

static bool in_scale(const struct scale *s, double v)
{
    return isfinite(v) && (!s->log || v > 0);
}

static double position(const struct scale *s, double v)
{
    return s->log ? log(v / s->lo) / log(s->hi / s->lo) : (v - s->lo) / (s->hi - s->lo);
}

/* 1, 2 or 5 times a power of ten, at least v. */
static double round_up(double v)
{
    double ten = pow(10, floor(log10(v)));
    return v <= ten ? ten : v <= 2 * ten ? 2 * ten : v <= 5 * ten ? 5 * ten : 10 * ten;
}

static struct scale scale_of(const struct plot_line *lines, int count, bool of_x, bool is_log)
{
    struct scale s = {INFINITY, -INFINITY, is_log};
    for (int k = 0; k < count; k++)
        for (int i = 0; i < lines[k].count; i++) {
            double v = of_x ? lines[k].x[i] : lines[k].y[i];
            if (!in_scale(&s, v) || !isfinite(lines[k].y[i]))
                continue;
            s.lo = fmin(s.lo, v);
            s.hi = fmax(s.hi, v);
        }
    if (!(s.lo <= s.hi))
        s.lo = s.hi = 1;
    if (is_log) {
        s.hi = round_up(s.hi);
        s.lo = 1 / round_up(1 / s.lo);
        s.hi = s.hi > s.lo ? s.hi : 10 * s.lo;
        return s;
    }
    s.lo = s.lo < 0 ? -round_up(-s.lo) : 0;
    s.hi = s.hi > s.lo ? s.hi : s.lo + 1;
    return s;
}

static void write_ticks(FILE *f, const struct scale *s, bool of_x)
{
    double plot_w = WIDTH - LEFT - RIGHT, plot_h = HEIGHT - TOP - BOTTOM;
    double step = round_up((s->hi - s->lo) / TICKS);
    double v = s->log ? s->lo : ceil(s->lo / step) * step;
    for (int k = 0; v <= s->hi * (1 + 1e-9) && k < 100; k++) {
        double p = position(s, v);
        if (of_x) {
            double x = LEFT + p * plot_w;
            fprintf(f, "<line x1='%.1f' y1='%d' x2='%.1f' y2='%d' stroke='#ddd'/>", x, TOP, x, HEIGHT - BOTTOM);
            fprintf(f, "<text x='%.1f' y='%d' text-anchor='middle'>%g</text>\n", x, HEIGHT - BOTTOM + 18, v);
        } else {
            double y = TOP + (1 - p) * plot_h;
            fprintf(f, "<line x1='%d' y1='%.1f' x2='%d' y2='%.1f' stroke='#ddd'/>", LEFT, y, WIDTH - RIGHT, y);
            fprintf(f, "<text x='%d' y='%.1f' text-anchor='end'>%g</text>\n", LEFT - 6, y + 4, v);
        }
        v = s->log ? round_up(v * 1.5) : v + step;
    }
}

static void write_line(FILE *f, const struct plot_line *line, int k, const struct scale *sx, const struct scale *sy)
{
    double plot_w = WIDTH - LEFT - RIGHT, plot_h = HEIGHT - TOP - BOTTOM;
    const char *color = COLORS[k % COLOR_COUNT], *dash = line->dashed ? " stroke-dasharray='6 4'" : "";
    fprintf(f, "<polyline fill='none' stroke='%s' stroke-width='2'%s points='", color, dash);
    for (int i = 0; i < line->count; i++)
        if (in_scale(sx, line->x[i]) && in_scale(sy, line->y[i]))
            fprintf(f, "%.1f,%.1f ", LEFT + position(sx, line->x[i]) * plot_w,
                    TOP + (1 - position(sy, line->y[i])) * plot_h);
    int y = TOP + 10 + 20 * k, x = WIDTH - RIGHT + 15;
    fprintf(f, "'/>\n<line x1='%d' y1='%d' x2='%d' y2='%d' stroke='%s' stroke-width='2'%s/>", x, y, x + 30, y, color,
            dash);
    fprintf(f, "<text x='%d' y='%d'>%s</text>\n", x + 36, y + 4, line->name);
}

bool plot_write(const char *path, const struct plot_axes *axes, const struct plot_line *lines, int count)
{
    FILE *f = fopen(path, "w");
    if (!f)
        return false;
    struct scale sx = scale_of(lines, count, true, axes->x_log), sy = scale_of(lines, count, false, axes->y_log);
    fprintf(f,
            "<svg xmlns='http://www.w3.org/2000/svg' width='%d' height='%d' font-family='sans-serif' font-size='12'>\n"
            "<rect width='100%%' height='100%%' fill='white'/>\n<text x='%d' y='24' font-size='15'>%s</text>\n",
            WIDTH, HEIGHT, LEFT, axes->title);
    write_ticks(f, &sx, true);
    write_ticks(f, &sy, false);
    fprintf(f, "<text x='%d' y='%d' text-anchor='middle'>%s</text>", (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10,
            axes->x_label);
    fprintf(f, "<text x='14' y='%d' text-anchor='middle' transform='rotate(-90 14 %d)'>%s</text>\n", HEIGHT / 2,
            HEIGHT / 2, axes->y_label);
    for (int k = 0; k < count; k++)
        write_line(f, &lines[k], k, &sx, &sy);
    fprintf(f, "</svg>\n");
    return fclose(f) == 0;
}
