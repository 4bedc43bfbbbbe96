/* lighting.c - normals from displ, and the light of every texel (paper 1, section 3.2).
 *
 * Normals: displ -> differences of neighbours of one surface -> eq. (5), (6) as corrected in the header.
 * Light: the rule of core/scene/light.h in the relief's own axes, so that the sun and the zenith are turned
 * into them once and a texel costs two dot products; albedo comes from a table, the eye is needed for the
 * specular term only.
 *
 *   paper        here
 *   |a|, |b|     pitch of a texel, m
 *   delta u, v   Du, Dv: difference of displ across two texels (one, doubled, at a border) */
#include "core/relief/lighting.h"

#include <string.h>

#include "core/base/color.h"
#include "core/base/simd.h"
#include "core/relief/lighting_kernel.h"

/* Difference of displ over two texels along one axis: `step` texels apart in memory, `at` of `count`.
 * Neighbours that are not there, are empty or lie across a torn edge are left out; a difference over one
 * texel is doubled. */
static double difference(const struct sv_relief *r, size_t texel, size_t step, int at, int count)
{
    double here = (double)r->displ[texel], before = here, after = here, cut = (double)r->cut;
    int texels = 0;
    if (at > 0 && sv_relief_solid(r, texel - step) && fabs((double)r->displ[texel - step] - here) <= cut) {
        before = (double)r->displ[texel - step];
        texels++;
    }
    if (at + 1 < count && sv_relief_solid(r, texel + step) &&
        fabs((double)r->displ[texel + step] - here) <= cut) {
        after = (double)r->displ[texel + step];
        texels++;
    }
    return texels == 1 ? 2 * (after - before) : after - before; /* eq. 6 */
}

static void store_normal(double x, double y, double z, int16_t normal[4])
{
    /* Slopes of 1e30 m a texel are legal: scaled before squaring. */
    double largest = fmax(fmax(fabs(x), fabs(y)), fabs(z));
    x /= largest, y /= largest, z /= largest;
    double scale = 32767 / sqrt(x * x + y * y + z * z);
    normal[0] = (int16_t)lrint(x * scale);
    normal[1] = (int16_t)lrint(y * scale);
    normal[2] = (int16_t)lrint(z * scale);
}

void sv_relief_normals(struct sv_relief *relief)
{
    double a = sv_length(relief->frame.a), b = sv_length(relief->frame.b);
    size_t width = (size_t)relief->width;
    for (int j = 0; j < relief->height; j++)
        for (int i = 0; i < relief->width; i++) {
            size_t texel = (size_t)j * width + (size_t)i;
            if (!sv_relief_solid(relief, texel))
                continue;
            double du = difference(relief, texel, 1, i, relief->width);
            double dv = difference(relief, texel, width, j, relief->height);
            store_normal(-b * du, -a * dv, 2 * a * b, relief->normal[texel]); /* eq. 5 */
        }
}

static void to_frame(const struct sv_relief_frame *frame, struct sv_vec3 v, float out[3], double scale)
{
    out[0] = (float)(sv_dot(sv_normalize(frame->a), v) * scale);
    out[1] = (float)(sv_dot(sv_normalize(frame->b), v) * scale);
    out[2] = (float)(sv_dot(frame->f, v) * scale);
}

/* (n.h)^2 at which the mirror comes to 1/20 of a level where a level is least light (1 / (255 * 12.92)). */
static float faint(const struct sv_relief_light_row *row)
{
    float most = 255 * fmaxf(row->mirror[0], fmaxf(row->mirror[1], row->mirror[2]));
    float share = 0.05f / (255 * 12.92f) / most; /* of what the mirror gives at n.h = 1 */
    return share < 1 ? powf(share, 2 / row->shininess) : most > 0 ? 1 : 0;
}

static void prepare(const struct sv_relief_light *options, struct sv_relief_light_row *row)
{
    const struct sv_light *light = options->light;
    *row = (struct sv_relief_light_row){.shininess = fmaxf(1, options->shininess)};
    to_frame(&options->frame, light->to_sun, row->to_sun, 1.0 / 32767);
    to_frame(&options->frame, light->to_sun, row->sun_unit, 1);
    to_frame(&options->frame, sv_vec3(0, 0, 1), row->up, 0.5 / 32767);
    for (int c = 0; c < 3; c++) {
        row->sun[c] = light->sun_rgb[c] * SV_LIGHT_EXPOSURE / 255;
        row->ground[c] = light->ground_rgb[c] * SV_LIGHT_EXPOSURE / 32767;
        row->ground_sky[c] = (light->sky_rgb[c] - light->ground_rgb[c]) * SV_LIGHT_EXPOSURE / 32767;
        row->mirror[c] = options->specular * row->sun[c];
    }
    row->specular = options->has_viewer && options->specular > 0;
    row->faint = row->specular ? faint(row) : 0;
    to_frame(&options->frame, sv_sub(options->eye, options->frame.origin), row->eye, 1);
    row->pitch[0] = (float)sv_length(options->frame.a);
    row->pitch[1] = (float)sv_length(options->frame.b);
}

/* (n.h)^shininess of a texel, h half way between sun and viewer (Blinn); 0 where sun or viewer is behind. */
static float mirror(const struct sv_relief_light_row *light, const float n[3], float u, float v, float displ)
{
    const float *l = light->sun_unit;
    float e[3] = {light->eye[0] - u * light->pitch[0], light->eye[1] - v * light->pitch[1],
                  light->eye[2] - displ};
    float distance = sqrtf(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    if (!(distance > 0) || !isfinite(distance) || !(n[0] * e[0] + n[1] * e[1] + n[2] * e[2] > 0))
        return 0;
    float h[3] = {l[0] + e[0] / distance, l[1] + e[1] / distance, l[2] + e[2] / distance};
    float length = sqrtf(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    float n_h = (n[0] * h[0] + n[1] * h[1] + n[2] * h[2]) / length;
    return n_h > 0 ? powf(fminf(n_h, 1), light->shininess) : 0;
}

static void light_texel(const struct sv_relief_light_row *light, const struct sv_relief_light_sheet *sheet,
                        int row, int column)
{
    size_t i = (size_t)row * (size_t)sheet->width + (size_t)column;
    memcpy(sheet->rgba[i], sheet->color[i], 4);
    if (sheet->color[i][3] < 128) /* empty */
        return;
    float m[4];
    for (int c = 0; c < 4; c++)
        m[c] = sheet->plane[0] ? sheet->plane[c][i] : sheet->normal[i][c];
    const float n[3] = {m[0], m[1], m[2]};
    float open = m[3], lit = sheet->lit ? sheet->lit[i] : 255, shine = 0;
    float n_l = n[0] * light->to_sun[0] + n[1] * light->to_sun[1] + n[2] * light->to_sun[2];
    float up = 0.5f + (n[0] * light->up[0] + n[1] * light->up[1] + n[2] * light->up[2]);
    float sun = fmaxf(0, n_l) * lit;
    if (light->specular && n_l > 0 && lit > 0) {
        const float unit[3] = {n[0] / 32767, n[1] / 32767, n[2] / 32767};
        shine = lit * mirror(light, unit, (float)column + 0.5f, (float)row + 0.5f, sheet->displ[i]);
    }
    for (int c = 0; c < 3; c++) {
        float ambient = (light->ground[c] + light->ground_sky[c] * up) * open;
        float exposed = sv_linear_from_srgb8[sheet->color[i][c]] * (light->sun[c] * sun + ambient);
        sheet->rgba[i][c] = sv_srgb8_from_linear(sv_light_tone(exposed + light->mirror[c] * shine));
    }
}

void sv_relief_light_scalar(const struct sv_relief_light_row *light,
                            const struct sv_relief_light_sheet *sheet, const struct sv_relief_eight *list,
                            int count)
{
    for (int k = 0; k < count; k++) {
        int end = list[k].column + 8 < sheet->width ? list[k].column + 8 : sheet->width;
        for (int i = list[k].column; i < end; i++)
            light_texel(light, sheet, list[k].row, i);
    }
}

/* Those of one row that are needed, without a branch on it. */
static int list_row(const uint8_t *groups, int width, int row, struct sv_relief_eight *list)
{
    const int last = width > 8 ? width - 8 : 0;
    int n = 0;
    for (int i = 0; i < last; i += 8) {
        list[n] = (struct sv_relief_eight){row, i};
        n += groups[i / 8];
    }
    list[n] = (struct sv_relief_eight){row, last};
    return n + groups[(width - 1) / 8];
}

int sv_relief_list_eights(const uint8_t *groups, int width, int height, int *row,
                          struct sv_relief_eight list[SV_RELIEF_LIST_ROOM])
{
    const size_t stride = ((size_t)width + 7) / 8;
    static const uint8_t ALL[SV_RELIEF_SIDE_MAX / 8] = {[0 ... SV_RELIEF_SIDE_MAX / 8 - 1] = 1};
    int n = 0;
    for (; *row < height && n < SV_RELIEF_LIST; ++*row)
        n += list_row(groups ? groups + (size_t)*row * stride : ALL, width, *row, list + n);
    return n;
}

void sv_relief_light(const struct sv_relief *relief, const struct sv_relief_light *options,
                     uint8_t (*rgba)[4])
{
    struct sv_relief_light_row light;
    const size_t texels = (size_t)relief->width * (size_t)relief->height;
    struct sv_relief_light_sheet sheet = {.width = relief->width,
                                          .color = (const uint8_t(*)[4])relief->color,
                                          .normal = (const int16_t(*)[4])relief->normal,
                                          .displ = relief->displ,
                                          .lit = options->lit,
                                          .rgba = rgba};
    void (*kernel)(const struct sv_relief_light_row *, const struct sv_relief_light_sheet *,
                   const struct sv_relief_eight *, int) =
        relief->width >= 8 && sv_simd_level() >= SV_SIMD_AVX2 ? sv_relief_light_avx2 : sv_relief_light_scalar;
    for (size_t c = 0; options->planes && c < 4; c++)
        sheet.plane[c] = options->planes + c * texels;
    prepare(options, &light);
    sv_color_init();
    struct sv_relief_eight list[SV_RELIEF_LIST_ROOM];
    for (int row = 0; row < relief->height;) {
        int n = sv_relief_list_eights(options->groups, relief->width, relief->height, &row, list);
        kernel(&light, &sheet, list, n);
    }
}
