/* preview.c - a tool that draws one tree in plain software, so that a person can judge it: front, 45 degrees
 * above, and from above, side by side; Lambert and occlusion light, alpha test, 3 x 3 samples a pixel. Not a
 * test and not shipped.
 *
 * tree_preview HABIT LEAVES SEED OUT.ppm [SIZE_PX [ZOOM]]
 * ZOOM > 1 draws nearer: at 1 the tree fills the picture's height, at 20 one sees single leaves of the lower
 * crown. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/color.h"
#include "core/base/vec.h"
#include "core/tree/grow.h"

enum { SS = 3 };

struct view {
    struct sv_vec3 eye, right, up, forward;
    double focal; /* in samples */
    int size;     /* samples a side */
    float *depth, *rgb;
};

static const double SUN[3] = {0.55, -0.45, 0.70};

static struct view make_view(int size, struct sv_vec3 eye, struct sv_vec3 target, double focal)
{
    struct view v = {.eye = eye, .size = size, .focal = focal * size};
    v.forward = sv_normalize(sv_sub(target, eye));
    v.right =
        sv_normalize(sv_cross(v.forward, fabs(v.forward.z) > 0.99 ? sv_vec3(0, 1, 0) : sv_vec3(0, 0, 1)));
    v.up = sv_cross(v.right, v.forward);
    v.depth = malloc((size_t)size * (size_t)size * sizeof *v.depth);
    v.rgb = malloc((size_t)size * (size_t)size * 3 * sizeof *v.rgb);
    for (int i = 0; v.depth && v.rgb && i < size * size; i++) {
        v.depth[i] = INFINITY;
        float t = (float)(i / size) / (float)size;
        v.rgb[3 * i] = 0.42f + 0.2f * t, v.rgb[3 * i + 1] = 0.58f + 0.12f * t, v.rgb[3 * i + 2] = 0.85f;
    }
    return v;
}

static void texel(const struct sv_image *image, double u, double v, double rgba[4])
{
    double x = (u - floor(u)) * image->width - 0.5, y = (v - floor(v)) * image->height - 0.5;
    double fx = floor(x), fy = floor(y);
    memset(rgba, 0, 4 * sizeof *rgba);
    for (int k = 0; k < 4; k++) {
        int i = ((int)fx + (k & 1) + image->width) % image->width,
            j = ((int)fy + (k >> 1) + image->height) % image->height;
        double w = (k & 1 ? x - fx : 1 - x + fx) * (k >> 1 ? y - fy : 1 - y + fy);
        const uint8_t *t = (const uint8_t *)image->data + 4 * ((size_t)j * (size_t)image->width + (size_t)i);
        for (int c = 0; c < 3; c++)
            rgba[c] += w * (double)sv_linear_from_srgb8[t[c]];
        rgba[3] += w * t[3] / 255.0;
    }
}

static void shade(const struct sv_tree_material *m, struct sv_vec3 n, struct sv_vec3 to_eye, double open,
                  const double a[4], float rgb[3])
{
    static const double sky[3] = {0.17, 0.21, 0.28}, ground[3] = {0.10, 0.09, 0.06},
                        sun[3] = {0.82, 0.78, 0.70};
    struct sv_vec3 l = sv_normalize(sv_vec3(SUN[0], SUN[1], SUN[2]));
    n = sv_normalize(n);
    if (m->is_leaf && sv_dot(n, to_eye) < 0)
        n = sv_scale(n, -1);
    double nl = sv_dot(n, l), lit = nl > 0 ? nl : m->is_leaf ? -nl * (double)m->translucency : 0;
    double visible = fmin(1, 0.25 + 1.0 * open); /* no shadows here: the crown's depth stands in */
    for (int c = 0; c < 3; c++) {
        double ambient = (ground[c] + (sky[c] - ground[c]) * (0.5 + 0.5 * n.z)) * open;
        rgb[c] = (float)(a[c] * (sun[c] * lit * visible + ambient));
    }
}

static void draw_triangle(struct view *view, const struct sv_tree_mesh *mesh,
                          const struct sv_tree_material *m, const uint32_t *index)
{
    const struct sv_tree_vertex *v[3];
    double x[3], y[3], w[3];
    for (int i = 0; i < 3; i++) {
        v[i] = &mesh->vertices[index[i]];
        struct sv_vec3 p =
            sv_sub(sv_vec3(v[i]->position[0], v[i]->position[1], v[i]->position[2]), view->eye);
        double z = sv_dot(p, view->forward);
        if (z < 0.002)
            return;
        w[i] = 1 / z;
        x[i] = 0.5 * view->size + view->focal * sv_dot(p, view->right) * w[i];
        y[i] = 0.5 * view->size - view->focal * sv_dot(p, view->up) * w[i];
    }
    double area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area == 0 || (!m->two_sided && area > 0)) /* y runs down: front faces have negative area */
        return;
    int i0 = (int)fmax(0, floor(fmin(x[0], fmin(x[1], x[2]))));
    int i1 = (int)fmin(view->size - 1, ceil(fmax(x[0], fmax(x[1], x[2]))));
    int j0 = (int)fmax(0, floor(fmin(y[0], fmin(y[1], y[2]))));
    int j1 = (int)fmin(view->size - 1, ceil(fmax(y[0], fmax(y[1], y[2]))));
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++) {
            double px = i + 0.5, py = j + 0.5;
            double b0 = ((x[1] - px) * (y[2] - py) - (x[2] - px) * (y[1] - py)) / area;
            double b1 = ((x[2] - px) * (y[0] - py) - (x[0] - px) * (y[2] - py)) / area, b2 = 1 - b0 - b1;
            if (b0 < 0 || b1 < 0 || b2 < 0)
                continue;
            double iz = b0 * w[0] + b1 * w[1] + b2 * w[2], z = 1 / iz;
            size_t at = (size_t)j * (size_t)view->size + (size_t)i;
            if (z >= (double)view->depth[at])
                continue;
            double b[3] = {b0 * w[0] * z, b1 * w[1] * z, b2 * w[2] * z}, uv[2] = {0, 0}, open = 0, a[4];
            struct sv_vec3 n = sv_vec3(0, 0, 0);
            for (int k = 0; k < 3; k++) {
                uv[0] += b[k] * (double)v[k]->uv[0], uv[1] += b[k] * (double)v[k]->uv[1];
                open += b[k] * v[k]->occlusion / 65535.0;
                n = sv_madd(n, sv_vec3(v[k]->normal[0], v[k]->normal[1], v[k]->normal[2]), b[k] / 32767);
            }
            texel(&m->albedo, uv[0], uv[1], a);
            if (m->masked && a[3] < (double)m->alpha_cutoff)
                continue;
            view->depth[at] = (float)z;
            shade(m, n, sv_scale(view->forward, -1), open, a, view->rgb + 3 * at);
        }
}

static void draw(struct view *view, const struct sv_tree_mesh *mesh)
{
    for (int m = 0; m < mesh->material_count; m++)
        for (uint32_t i = 0; i < mesh->materials[m].index_count; i += 3)
            draw_triangle(view, mesh, &mesh->materials[m],
                          &mesh->indices[mesh->materials[m].first_index + i]);
}

/* Averages samples and puts the picture into column `slot` of the sheet. */
static void resolve(const struct view *view, uint8_t *sheet, int slot, int slots)
{
    int size = view->size / SS;
    for (int j = 0; j < size; j++)
        for (int i = 0; i < size; i++)
            for (int c = 0; c < 3; c++) {
                float sum = 0;
                for (int k = 0; k < SS * SS; k++)
                    sum += view->rgb[3 * ((size_t)(j * SS + k / SS) * (size_t)view->size +
                                          (size_t)(i * SS + k % SS)) +
                                     (size_t)c];
                sheet[3 * ((size_t)j * (size_t)(size * slots) + (size_t)(slot * size + i)) + (size_t)c] =
                    sv_srgb8_from_linear(sum / (SS * SS));
            }
}

static enum sv_habit habit_named(const char *name)
{
    for (int h = 0; h < SV_HABIT_COUNT; h++)
        if (strcmp(name, sv_habit_name((enum sv_habit)h)) == 0)
            return (enum sv_habit)h;
    return SV_HABIT_COUNT;
}

static int write_sheet(const struct sv_tree_mesh *mesh, const char *path, int size, double zoom)
{
    uint8_t *sheet = malloc((size_t)size * (size_t)size * 9);
    FILE *file = fopen(path, "wb");
    if (!sheet || !file)
        return 1;
    double wide = fmax(1.05, 2.1 * (double)mesh->radius);
    for (int slot = 0; slot < 3; slot++) {
        struct sv_vec3 target = sv_vec3(0, 0, 0.5), eye = sv_vec3(0.3, -5, 0.5);
        if (slot == 1)
            eye = sv_vec3(-2.6, -2.6, 4.1);
        if (slot == 2)
            eye = sv_vec3(0, 0, 5.5);
        double focal = 4.7 / wide;
        if (zoom > 1) { /* a walker's views: crown from below, mid crown, whole tree from near */
            struct sv_vec3 near_to[3] = {
                {0, 0, 0.5}, {0.6 * (double)mesh->radius, -0.6 * (double)mesh->radius, 0.45}, {0, 0, 0.04}};
            struct sv_vec3 near_eye[3] = {{0.05, -0.9, 0.07},
                                          {(double)mesh->radius, -(double)mesh->radius - 0.12, 0.43},
                                          {0.1, -0.25, 0.07}};
            eye = near_eye[slot], target = near_to[slot], focal = slot == 0 ? 0.7 : 1.0;
        }
        struct view view = make_view(size * SS, eye, target, focal);
        if (!view.depth || !view.rgb)
            return 1;
        draw(&view, mesh);
        resolve(&view, sheet, slot, 3);
        free(view.depth);
        free(view.rgb);
    }
    fprintf(file, "P6\n%d %d\n255\n", 3 * size, size);
    fwrite(sheet, 9, (size_t)size * (size_t)size, file);
    free(sheet);
    return fclose(file) != 0;
}

int main(int argc, char **argv)
{
    if (argc < 5) {
        fprintf(stderr, "usage: tree_preview HABIT LEAVES SEED OUT.ppm [SIZE_PX [ZOOM]]\n");
        return 2;
    }
    sv_color_init();
    struct sv_tree_mesh mesh;
    struct sv_error error;
    clock_t start = clock();
    if (sv_tree_grow(habit_named(argv[1]), (uint32_t)strtoul(argv[2], NULL, 10), strtoull(argv[3], NULL, 10),
                     &mesh, &error) != SV_OK) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        return 1;
    }
    uint32_t wood = mesh.materials[0].index_count / 3;
    printf("%s %u leaves: %.2f s, wood %u triangles (%.0f %% of leaf), radius %.3f, crown base %.3f, color "
           "%.3f %.3f %.3f\n",
           argv[1], mesh.leaf_count, (double)(clock() - start) / CLOCKS_PER_SEC, wood,
           mesh.leaf_count ? 100.0 * wood / (2.0 * mesh.leaf_count) : 0.0, (double)mesh.radius,
           (double)mesh.crown_base, (double)mesh.crown_color[0], (double)mesh.crown_color[1],
           (double)mesh.crown_color[2]);
    int failed = write_sheet(&mesh, argv[4], argc > 5 ? atoi(argv[5]) : 512, argc > 6 ? atof(argv[6]) : 1);
    sv_tree_mesh_finish(&mesh);
    return failed;
}
