/* fake_backend.c - a scene process's backend (server/scene/backend.h) that needs no GL, GDAL or real scene.
 *
 * The scene file is JSON with the keys of a real one; its name and bytes make the version. The ground is flat
 * at height 0. A "picture" is a text that tells what was asked, and filler in proportion to the pixels: the
 * same bytes for the same view. Loading fails with a reason for each thing that is wrong. */
#include "server/scene/backend.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/canonical.h"
#include "api/scene_doc.h"
#include "core/base/hash.h"

struct sv_backend {
    uint64_t version;
    char *document;
};

static char *read_text(const char *path, struct sv_errors *errors)
{
    enum { ROOM = 1 << 20 };
    FILE *file = fopen(path, "re");
    char *text = file ? calloc(1, ROOM) : NULL;
    if (!text || fread(text, 1, ROOM - 1, file) == 0) {
        sv_errors_add(errors, SV_ENOENT, path, "%s", strerror(errno));
        free(text);
        text = NULL;
    }
    if (file)
        fclose(file);
    return text;
}

static void check(const cJSON *root, struct sv_errors *errors)
{
    static const char *const known[] = {"name", "terrain", "species", "forest", "objects", "sun", "relief"};
    const cJSON *item;
    cJSON_ArrayForEach(item, root)
    {
        bool found = false;
        for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
            found = found || strcmp(known[i], item->string) == 0;
        if (!found)
            sv_errors_add(errors, SV_EINVAL, item->string, "no such key");
    }
    if (!cJSON_IsString(cJSON_GetObjectItemCaseSensitive(root, "name")))
        sv_errors_add(errors, SV_EINVAL, "name", "a text is needed");
}

enum sv_status sv_backend_load(const struct sv_backend_options *options, struct sv_backend **backend,
                               struct sv_errors *errors)
{
    char *text = read_text(options->scene_path, errors);
    cJSON *root = text ? cJSON_Parse(text) : NULL;
    if (text && !cJSON_IsObject(root))
        sv_errors_add(errors, SV_EFORMAT, options->scene_path, "not a JSON object");
    else if (text)
        check(root, errors);
    struct sv_backend *b = errors->total ? NULL : calloc(1, sizeof *b);
    if (b) {
        struct sv_scene_facts facts = {.name = cJSON_GetObjectItemCaseSensitive(root, "name")->valuestring,
                                       .crs_name = "local",
                                       .x_max = 1000,
                                       .y_max = 1000,
                                       .terrain_width = 2,
                                       .terrain_height = 2,
                                       .relief_distance_m = 100,
                                       .pixels_max = options->pixels_max,
                                       .sample_pixels_max = options->sample_pixels_max,
                                       .load_s = -1};
        size_t bytes;
        b->version = sv_hash_done(sv_hash_string(SV_HASH_INIT, text));
        facts.version = b->version;
        b->document = sv_api_scene_doc(&facts, &bytes);
        *backend = b;
    }
    cJSON_Delete(root);
    free(text);
    return b ? SV_OK : errors->count ? errors->items[0].code : SV_ENOMEM;
}

/* Anything that is an object is a patch; its bytes make the version. "outside" among its keys: there is no
 * room. */
enum sv_status sv_backend_patch(struct sv_backend *backend, const char *text, size_t bytes,
                                struct sv_scene_change *change, struct sv_errors *errors)
{
    cJSON *root = cJSON_ParseWithLength(text, bytes);
    enum sv_status status = !cJSON_IsObject(root)                  ? SV_EINVAL
                            : cJSON_HasObjectItem(root, "outside") ? SV_EOUTSIDE
                                                                   : SV_OK;
    if (cJSON_HasObjectItem(root, "die"))
        abort();
    cJSON_Delete(root);
    if (status != SV_OK) {
        sv_errors_add(errors, status, "trees.add[0]", "not like that");
        return status;
    }
    backend->version = sv_hash_done(sv_hash_bytes(sv_hash_u64(SV_HASH_INIT, backend->version), text, bytes));
    char version[24];
    char *told = strstr(backend->document, "\"version\":\"");
    snprintf(version, sizeof version, "%016llx", (unsigned long long)backend->version);
    if (told)
        memcpy(told + strlen("\"version\":\""), version, strlen(version));
    *change = (struct sv_scene_change){.trees_added = 1};
    return SV_OK;
}

void sv_backend_facts(const struct sv_backend *backend, struct sv_backend_facts *facts)
{
    *facts = (struct sv_backend_facts){
        .version = backend->version, .relief_distance_m = 100, .document = backend->document};
}

const struct sv_cells_memory *sv_backend_cells(const struct sv_backend *backend)
{
    static const struct sv_cells_memory none = {.fd = -1};
    (void)backend;
    return &none;
}

void sv_backend_use_slot(struct sv_backend *backend, int slot)
{
    (void)backend;
    (void)slot;
}

enum sv_status sv_backend_ahead(struct sv_backend *backend, const struct sv_view_request *request, uint32_t most,
                                uint32_t *built, uint32_t *left, struct sv_error *error)
{
    struct sv_resolved_view view;
    bool has_ground;
    double ground_z;
    (void)most;
    *built = *left = 0;
    return sv_backend_resolve(backend, request, &view, &has_ground, &ground_z, error);
}

enum sv_status sv_backend_refine(struct sv_backend *backend, const struct sv_view_request *request,
                                 const struct sv_backend_refine_options *options, uint32_t *refined,
                                 uint32_t *left, struct sv_error *error)
{
    (void)backend;
    (void)request;
    (void)options;
    (void)error;
    *refined = *left = 0;
    return SV_OK;
}

int sv_backend_lacks(const struct sv_backend *backend, const struct sv_resolved_view *view)
{
    (void)backend;
    (void)view;
    return 0;
}

void sv_backend_build(const struct sv_backend *backend, int form)
{
    (void)backend;
    (void)form;
}

bool sv_backend_renew_document(struct sv_backend *backend)
{
    (void)backend;
    return true;
}

enum sv_status sv_backend_resolve(struct sv_backend *backend, const struct sv_view_request *request,
                                  struct sv_resolved_view *view, bool *has_ground, double *ground_z,
                                  struct sv_error *error)
{
    const struct sv_place *eye = request->eye.form == SV_PLACE_NONE ? &request->target : &request->eye;
    (void)backend;
    if (eye->form == SV_PLACE_LONLAT || request->crs_epsg)
        return sv_fail(error, SV_EINVAL, "eye", "the scene has no place on Earth");
    double z = eye->has_z ? eye->z : eye->agl;
    if (z < 0) {
        *has_ground = true;
        *ground_z = 0;
        return sv_fail(error, SV_EUNDERGROUND, "eye", "the eye is at %g m, the ground at 0 m", z);
    }
    memset(view, 0, sizeof *view);
    view->camera.eye = view->cell = (struct sv_vec3){eye->x, eye->y, z};
    view->camera.right = (struct sv_vec3){1, 0, 0};
    view->camera.up = (struct sv_vec3){0, 0, 1};
    view->camera.forward = (struct sv_vec3){0, 1, 0};
    view->camera.projection = request->projection;
    view->camera.vfov_rad = request->vfov_rad;
    view->camera.ortho_height_m = request->ortho_height_m;
    view->camera.width = request->width;
    view->camera.height = request->height;
    view->camera.near_m = 0.1;
    view->camera.far_m = 1000;
    view->plan.samples = request->samples ? request->samples : 1;
    return SV_OK;
}

/* Rows of dots, of which the text's filler is made. */
enum sv_status sv_backend_draw_band(struct sv_backend *backend, const struct sv_view_request *request,
                                    const struct sv_resolved_view *view, const struct sv_backend_band *band,
                                    struct sv_picture *picture, struct sv_bands_part *part, struct sv_error *error)
{
    (void)backend;
    (void)request;
    *picture = (struct sv_picture){0};
    struct sv_image *color = &picture->layer[SV_LAYER_COLOR];
    enum sv_status status = sv_image_alloc(view->camera.width, band->row_count, 4, SV_PIXEL_U8, color, error);
    if (status != SV_OK)
        return status;
    memset(color->data, '.', sv_image_bytes(color));
    part->timings.ms[SV_STAGE_NEAR] = 0.1;
    part->stats.terrain_triangles = 1;
    return SV_OK;
}

enum sv_status sv_backend_encode(struct sv_backend *backend, const struct sv_view_request *request,
                                 const struct sv_resolved_view *view, const struct sv_picture *picture, int epsg,
                                 struct sv_bands_part *part, void **bytes, size_t *size, struct sv_error *error)
{
    const char *dots = picture->layer[SV_LAYER_COLOR].data;
    enum sv_status status =
        sv_backend_draw(backend, request, view, epsg, bytes, size, &part->timings, &part->stats, error);
    size_t filler = (size_t)view->camera.width * (size_t)view->camera.height / 4;
    for (size_t k = 0; k < filler && status == SV_OK && dots; k++)
        ((char *)*bytes)[*size - filler + k] = dots[16 * k];
    return status;
}

enum sv_status sv_backend_draw(struct sv_backend *backend, const struct sv_view_request *request,
                               const struct sv_resolved_view *view, int epsg, void **bytes, size_t *size,
                               struct sv_timings *timings, struct sv_draw_stats *stats,
                               struct sv_error *error)
{
    char canonical[SV_API_CANONICAL_MAX];
    size_t filler = (size_t)view->camera.width * (size_t)view->camera.height / 4;
    (void)epsg;
    sv_api_canonical(request, canonical);
    char *text = malloc(sizeof canonical + 64 + filler);
    if (!text)
        return sv_fail(error, SV_ENOMEM, "", "out of memory");
    size_t head = (size_t)snprintf(text, sizeof canonical + 64, "FAKE %016llx %s\n",
                                   (unsigned long long)backend->version, canonical);
    memset(text + head, '.', filler);
    *bytes = text;
    *size = head + filler;
    timings->ms[SV_STAGE_NEAR] = 0.1;
    timings->ms[SV_STAGE_ENCODE] = 0.1;
    stats->terrain_triangles = 2;
    return SV_OK;
}
