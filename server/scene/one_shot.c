#include "server/scene/one_shot.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "api/answer.h"
#include "api/canonical.h"
#include "api/describe.h"
#include "api/view_parse.h"

enum { VIEW_BYTES_MAX = 1 << 20, CELLS_BYTES = 1 << 30 /* address space; memory as panels are drawn */ };

static enum sv_status fail(struct sv_errors *errors, enum sv_status status, const char *field,
                           const char *text)
{
    sv_errors_add(errors, status, field, "%s", text);
    return status;
}

/* The format that a file's suffix names; SV_FORMAT_COUNT when it names none. */
static enum sv_format suffix_format(const char *suffix)
{
    for (int k = 0; k < SV_FORMAT_COUNT; k++)
        if (strcasecmp(suffix, sv_format_name((enum sv_format)k)) == 0)
            return (enum sv_format)k;
    return strcasecmp(suffix, "jpg") == 0   ? SV_FORMAT_JPEG
           : strcasecmp(suffix, "tif") == 0 ? SV_FORMAT_TIFF
                                            : SV_FORMAT_COUNT;
}

/* A file holds what its suffix says, or is not written: the suffix has the say that an Accept header has over
 * HTTP, and must not belie a format that the view asks for. */
static const char *suffix_media(const char *path)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    if (!dot)
        return NULL;
    enum sv_format format = suffix_format(dot + 1);
    return format < SV_FORMAT_COUNT ? sv_format_media(format) : "image/unknown";
}

static enum sv_status read_view(const struct sv_backend_options *options, const char *path, const char *out,
                                struct sv_api_view *view, struct sv_errors *errors)
{
    FILE *file = fopen(path, "re");
    char *text = file ? malloc(VIEW_BYTES_MAX) : NULL;
    if (!text) {
        enum sv_status status = fail(errors, file ? SV_ENOMEM : SV_ENOENT, path, strerror(errno));
        if (file)
            fclose(file);
        return status;
    }
    size_t bytes = fread(text, 1, VIEW_BYTES_MAX, file);
    fclose(file);
    struct sv_api_view_limits limits = {.pixels_max = options->pixels_max,
                                        .sample_pixels_max = options->sample_pixels_max};
    const char *media = suffix_media(out);
    enum sv_problem_kind kind = sv_api_view_parse_json(text, bytes, media, &limits, view, errors);
    free(text);
    if (kind == SV_PROBLEM_NOT_ACCEPTABLE || (kind == SV_PROBLEM_NONE && media && !view->request.describe &&
                                              strcmp(media, sv_format_media(view->request.format)) != 0))
        return fail(errors, SV_EINVAL, out,
                    "the suffix is not that of a format that can hold this view: use one of jpeg, png, webp, "
                    "tiff, exr, and the same as the view's own format, if it gives one");
    return kind == SV_PROBLEM_NONE ? SV_OK : SV_EINVAL;
}

static enum sv_status write_out(const char *path, const void *bytes, size_t size, struct sv_errors *errors)
{
    bool is_stdout = strcmp(path, "-") == 0;
    FILE *file = is_stdout ? stdout : fopen(path, "wbe");
    if (!file)
        return fail(errors, SV_EIO, path, strerror(errno));
    bool written = fwrite(bytes, 1, size, file) == size;
    bool closed = (is_stdout ? fflush(file) : fclose(file)) == 0;
    return written && closed ? SV_OK : fail(errors, SV_EIO, path, strerror(errno));
}

static enum sv_status make(struct sv_backend *backend, const struct sv_view_request *request, void **bytes,
                           size_t *size, struct sv_error *error)
{
    struct sv_backend_facts facts;
    struct sv_resolved_view view;
    struct sv_timings timings;
    struct sv_draw_stats stats;
    bool has_ground = false;
    double ground_z = 0;
    sv_backend_facts(backend, &facts);
    enum sv_status status = sv_backend_resolve(backend, request, &view, &has_ground, &ground_z, error);
    if (status != SV_OK || !request->describe) {
        if (status == SV_OK)
            status =
                sv_backend_draw(backend, request, &view, facts.epsg, bytes, size, &timings, &stats, error);
        return status;
    }
    char canonical[SV_API_CANONICAL_MAX], etag[SV_ETAG_BUFFER];
    struct sv_view_request picture = *request;
    picture.describe = false;
    sv_api_canonical(&picture, canonical);
    sv_api_etag_view(canonical, &view, facts.version, SV_VERSION, etag);
    struct sv_api_description description = {.request = request,
                                             .resolved = &view,
                                             .canonical = canonical,
                                             .etag = etag,
                                             .scene_version = facts.version,
                                             .relief_distance_m = facts.relief_distance_m};
    *bytes = sv_api_describe(&description, size);
    return *bytes ? SV_OK : sv_fail(error, SV_ENOMEM, "", "out of memory");
}

enum sv_status sv_one_shot(const struct sv_backend_options *options, const char *view_path,
                           const char *out_path, struct sv_errors *errors)
{
    struct sv_backend_options own = *options;
    struct sv_api_view view;
    struct sv_backend *backend;
    struct sv_error error;
    void *bytes = NULL;
    size_t size = 0;
    own.one_picture = true;
    own.processes = (int)sysconf(_SC_NPROCESSORS_ONLN);
    enum sv_status status = read_view(options, view_path, out_path, &view, errors);
    if (status == SV_OK && view.request.relief == SV_RELIEF_ON)
        own.cells_bytes = CELLS_BYTES;
    if (status == SV_OK)
        status = sv_backend_load(&own, &backend, errors);
    if (status != SV_OK)
        return status;
    status = make(backend, &view.request, &bytes, &size, &error);
    if (status != SV_OK) {
        sv_api_problem_name_keys(&view.request, &error);
        sv_errors_add(errors, status, error.field, "%s", error.message);
        return status;
    }
    status = write_out(out_path, bytes, size, errors);
    free(bytes);
    return status;
}
