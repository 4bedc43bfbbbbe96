/* plot.h - a line plot as an SVG file: what experiments show beside their CSV. */
#ifndef SV_TESTS_PLOT_H
#define SV_TESTS_PLOT_H

#include <stdbool.h>

struct plot_line {
    const char *name; /* plain text */
    const double *x, *y; /* count of each; points that are not finite are left out */
    int count;
    bool dashed;
};

struct plot_axes {
    const char *title, *x_label, *y_label;
    bool x_log, y_log; /* values at or below 0 are then left out */
};

/* False, with errno set, when the file cannot be written. */
bool plot_write(const char *path, const struct plot_axes *axes, const struct plot_line *lines, int count);

#endif
