/* import_texture.c - textures of an imported model: found, decoded, made fit for masks.
 *
 * Authors name textures by the paths of their own machines. They are sought as written beside the model, then
 * by their last part beside it and in the folders where exporters put textures, at last without regard to
 * case. */
#include "core/tree/import_parts.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "core/image/encode.h"

enum { PATH_BYTES = 4096 };

static bool is_file(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

/* folder/name, false when it does not fit. */
static bool join(char *out, const char *folder, const char *name)
{
    return snprintf(out, PATH_BYTES, "%s%s", folder, name) < PATH_BYTES;
}

/* A file of that name in folder (which ends with a slash or is empty), whatever its case. */
static bool find_in(const char *folder, const char *name, char *out)
{
    if (join(out, folder, name) && is_file(out))
        return true;
    DIR *dir = opendir(*folder ? folder : ".");
    bool found = false;
    for (struct dirent *e; dir && !found && (e = readdir(dir));)
        found = strcasecmp(e->d_name, name) == 0 && join(out, folder, e->d_name) && is_file(out);
    if (dir)
        closedir(dir);
    return found;
}

static bool find_file(const char *model_path, const char *name, char *out)
{
    char folder[PATH_BYTES] = "", wanted[PATH_BYTES], sub[PATH_BYTES];
    const char *slash = strrchr(model_path, '/');
    if (slash && (size_t)(slash - model_path) + 2 < sizeof folder)
        snprintf(folder, sizeof folder, "%.*s", (int)(slash - model_path) + 1, model_path);
    if (strncmp(name, "file://", 7) == 0)
        name += 7;
    snprintf(wanted, sizeof wanted, "%s", name);
    for (char *p = wanted; *p; p++)
        *p = *p == '\\' ? '/' : *p;
    if (wanted[0] == '/' ? (snprintf(out, PATH_BYTES, "%s", wanted), is_file(out))
                         : join(out, folder, wanted) && is_file(out))
        return true;
    const char *last = strrchr(wanted, '/') ? strrchr(wanted, '/') + 1 : wanted;
    static const char *const folders[] = {"",        "textures/", "Textures/",   "texture/",
                                          "images/", "maps/",     "../textures/"};
    for (size_t i = 0; *last && i < sizeof folders / sizeof *folders; i++)
        if (join(sub, folder, folders[i]) && find_in(sub, last, out))
            return true;
    return false;
}

/* Reads one texture; a failure is a note, not an error. */
static bool read_source(const struct raw_texture_source *source, struct sv_image *image, bool *has_alpha,
                        struct sv_errors *notes)
{
    struct sv_error e = {0};
    char path[PATH_BYTES];
    enum sv_status status;
    if (source->bgra.data) {
        status = sv_image_alloc(source->bgra.width, source->bgra.height, 4, SV_PIXEL_U8, image, &e);
        const unsigned char *from = source->bgra.data;
        *has_alpha = true;
        for (size_t i = 0; status == SV_OK && i < sv_image_bytes(image); i += 4) {
            unsigned char *to = (unsigned char *)image->data + i;
            to[0] = from[i + 2], to[1] = from[i + 1], to[2] = from[i], to[3] = from[i + 3];
        }
    } else if (source->bytes) {
        status = sv_image_decode_bytes(source->bytes, source->size, source->extension,
                                       SV_TREE_TEXTURE_SIDE_MAX, image, has_alpha, &e);
    } else if (find_file(source->model_path, source->name, path)) {
        status = sv_image_decode_file(path, SV_TREE_TEXTURE_SIDE_MAX, image, has_alpha, &e);
    } else {
        status = sv_fail(&e, SV_ENOENT, NULL, "not found");
    }
    if (status != SV_OK && notes)
        sv_errors_add(notes, status, source->model_path,
                      "texture '%.120s' of material '%.60s': %.200s; the plain colour is used", source->name,
                      source->material, e.message);
    return status == SV_OK;
}

static float luminance(const unsigned char *p)
{
    return 0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2];
}

/* Writes the opacity map (its alpha if it has one, else its grey) into the alpha of rgba, nearest texel. */
static void put_opacity(struct sv_image *rgba, const struct sv_image *opacity, bool from_alpha)
{
    for (int y = 0; y < rgba->height; y++)
        for (int x = 0; x < rgba->width; x++) {
            int64_t ox = (2 * (int64_t)x + 1) * opacity->width / (2 * rgba->width);
            int64_t oy = (2 * (int64_t)y + 1) * opacity->height / (2 * rgba->height);
            const unsigned char *p = (const unsigned char *)opacity->data + 4 * (oy * opacity->width + ox);
            unsigned char *to = (unsigned char *)rgba->data + 4 * ((int64_t)y * rgba->width + x);
            to[3] = from_alpha ? p[3] : (unsigned char)(luminance(p) + 0.5f);
        }
}

static void make_white(struct sv_image *rgba)
{
    for (size_t i = 0; i < sv_image_bytes(rgba); i++)
        if (i % 4 != 3)
            ((unsigned char *)rgba->data)[i] = 255;
}

/* The colour texture with its opacity map; empty image when there is neither. */
static enum sv_status load_pair(const struct raw_texture_source *color,
                                const struct raw_texture_source *opacity, struct raw_texture *texture,
                                struct sv_errors *notes, struct sv_error *error)
{
    bool have = color && read_source(color, &texture->image, &texture->has_alpha, notes);
    bool same = color && opacity && strcmp(color->name, opacity->name) == 0;
    if (!opacity || (same && (!have || texture->has_alpha)))
        return SV_OK;
    struct sv_image map = {0};
    bool map_alpha = false;
    if (!read_source(opacity, &map, &map_alpha, notes))
        return SV_OK;
    if (!have) {
        enum sv_status status = sv_image_alloc(map.width, map.height, 4, SV_PIXEL_U8, &texture->image, error);
        if (status != SV_OK) {
            sv_image_free(&map);
            return status;
        }
        make_white(&texture->image);
    }
    put_opacity(&texture->image, &map, map_alpha);
    texture->has_alpha = true;
    sv_image_free(&map);
    return SV_OK;
}

static char *make_key(const struct raw_texture_source *color, const struct raw_texture_source *opacity)
{
    const char *a = color ? color->name : "", *b = opacity ? opacity->name : "";
    size_t size = strlen(a) + strlen(b) + 2;
    char *key = malloc(size);
    if (key)
        snprintf(key, size, "%s\n%s", a, b);
    return key;
}

enum sv_status raw_texture_load(struct raw_model *raw, const struct raw_texture_source *color,
                                const struct raw_texture_source *opacity, int *texture,
                                struct sv_errors *notes, struct sv_error *error)
{
    *texture = RAW_NO_TEXTURE;
    if (!color && !opacity)
        return SV_OK;
    struct raw_texture t = {.key = make_key(color, opacity)};
    struct raw_texture *grown = realloc(raw->textures, ((size_t)raw->texture_count + 1) * sizeof *grown);
    raw->textures = grown ? grown : raw->textures;
    if (!t.key || !grown) {
        free(t.key);
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for texture %d", raw->texture_count);
    }
    int at = 0;
    while (at < raw->texture_count && strcmp(raw->textures[at].key, t.key) != 0)
        at++;
    if (at < raw->texture_count) {
        free(t.key);
    } else {
        enum sv_status status = load_pair(color, opacity, &t, notes, error);
        if (status != SV_OK) {
            free(t.key);
            return status;
        }
        raw->textures[raw->texture_count++] = t; /* an unreadable one, too: noted once */
    }
    *texture = raw->textures[at].image.data ? at : RAW_NO_TEXTURE;
    return SV_OK;
}

float raw_texture_alpha(const struct raw_texture *texture, const float uv[2])
{
    if (!texture || !texture->image.data)
        return 1;
    int size[2] = {texture->image.width, texture->image.height}, at[2];
    for (int a = 0; a < 2; a++) {
        float f = uv[a] - floorf(uv[a]);
        at[a] = (int)(f * (float)size[a]);
        at[a] = at[a] < 0 ? 0 : at[a] >= size[a] ? size[a] - 1 : at[a];
    }
    const unsigned char *p = texture->image.data;
    return p[4 * ((size_t)at[1] * (size_t)size[0] + (size_t)at[0]) + 3] / 255.0f;
}

/* One level of the pyramid: sums of colour weighted by alpha. */
struct level {
    int width, height;
    float *rgba;
};

/* Halves a level (odd sides round up), adding up to four cells into one. */
static bool halve(const struct level *from, struct level *to)
{
    to->width = (from->width + 1) / 2, to->height = (from->height + 1) / 2;
    to->rgba = calloc((size_t)to->width * (size_t)to->height, 4 * sizeof *to->rgba);
    if (!to->rgba)
        return false;
    for (int y = 0; y < from->height; y++)
        for (int x = 0; x < from->width; x++)
            for (int c = 0; c < 4; c++)
                to->rgba[4 * ((y / 2) * to->width + x / 2) + c] += from->rgba[4 * (y * from->width + x) + c];
    return true;
}

/* Below this alpha a texel's own colour is what an author's editor left there; it is out of every mask's
 * reach. */
enum { BLEED_ALPHA = 32 };

static bool first_level(const struct sv_image *rgba, struct level *level)
{
    size_t count = (size_t)rgba->width * (size_t)rgba->height;
    *level = (struct level){rgba->width, rgba->height, malloc(count * 4 * sizeof(float))};
    const unsigned char *p = rgba->data;
    for (size_t i = 0; level->rgba && i < count; i++) {
        float a = p[4 * i + 3] >= BLEED_ALPHA ? p[4 * i + 3] / 255.0f : 0;
        for (int c = 0; c < 3; c++)
            level->rgba[4 * i + (size_t)c] = a * p[4 * i + (size_t)c];
        level->rgba[4 * i + 3] = a;
    }
    return level->rgba;
}

/* Pull-push (Gortler et al. 1996, "The Lumigraph", section 3.4) with the coarser level's mean where the finer
 * has none. Means are of encoded values: what is made up here is never seen, only filtered against. */
void raw_texture_bleed(struct sv_image *rgba)
{
    struct level levels[20] = {{0}};
    int n = first_level(rgba, &levels[0]) ? 1 : 0;
    while (n > 0 && n < 20 && (levels[n - 1].width > 1 || levels[n - 1].height > 1) &&
           halve(&levels[n - 1], &levels[n]))
        n++;
    for (int k = n - 2; k >= 0; k--) {
        struct level *fine = &levels[k], *coarse = &levels[k + 1];
        for (int y = 0; y < fine->height; y++)
            for (int x = 0; x < fine->width; x++) {
                float *f = fine->rgba + 4 * (y * fine->width + x);
                if (f[3] <= 0)
                    memcpy(f, coarse->rgba + 4 * ((y / 2) * coarse->width + x / 2), 4 * sizeof *f);
            }
    }
    unsigned char *p = rgba->data;
    size_t count = n > 0 ? (size_t)rgba->width * (size_t)rgba->height : 0;
    for (size_t i = 0; i < count; i++) {
        const float *f = levels[0].rgba + 4 * i;
        if (p[4 * i + 3] < BLEED_ALPHA && f[3] > 0)
            for (int c = 0; c < 3; c++)
                p[4 * i + (size_t)c] = (unsigned char)(f[c] / f[3] + 0.5f);
    }
    for (int k = 0; k < 20; k++)
        free(levels[k].rgba);
}
