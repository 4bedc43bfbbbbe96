/* backend.h - what the scene process needs from whoever loads and draws. backend.c is the real one
 * (core/scene, core/view); tests/server/fake_backend.c is a double that draws nothing. Chosen when the
 * program is linked.
 *
 * load once, in the scene process; resolve and draw in forked workers, one call at a time. No thread may be
 * running when load returns. */
#ifndef SV_SERVER_BACKEND_H
#define SV_SERVER_BACKEND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/scene/change.h"
#include "core/view/request.h"
#include "core/view/resolved.h"
#include "core/view/timings.h"
#include "server/bands.h"
#include "server/cells_memory.h"

struct sv_backend;

struct sv_backend_options {
    const char *scene_path;
    const char *cache_dir; /* NULL: nothing is kept */
    uint64_t cache_budget_bytes;
    int processes;                          /* that may build side by side while loading */
    bool one_picture;                       /* is drawn, in this process: nothing is warmed up for workers */
    uint64_t pixels_max, sample_pixels_max; /* for the scene's document */
    uint64_t cells_bytes;                   /* of relief panels that workers share; 0: none */
};

/* Everything that is told of a loaded scene. */
struct sv_backend_facts {
    uint64_t version;
    int epsg; /* 0: none */
    double relief_distance_m;
    const char *document; /* of GET /v1/scene, borrowed from the backend */
};

/* On failure errors is not empty. */
SV_MUST_CHECK enum sv_status sv_backend_load(const struct sv_backend_options *options,
                                             struct sv_backend **backend, struct sv_errors *errors);
/* Changes the scene as the body of a PATCH says (api/patch_parse.h), in the process that it is called in,
 * which no worker is forked from yet. On failure errors is not empty, and the process ends. */
SV_MUST_CHECK enum sv_status sv_backend_patch(struct sv_backend *backend, const char *text, size_t bytes,
                                              struct sv_scene_change *change, struct sv_errors *errors);
void sv_backend_facts(const struct sv_backend *backend, struct sv_backend_facts *facts);
/* The relief panels that workers share; its cache is NULL where there are none. Borrowed. */
const struct sv_cells_memory *sv_backend_cells(const struct sv_backend *backend);
/* In a worker that was just forked: its slot of that cache, negative: none. */
void sv_backend_use_slot(struct sv_backend *backend, int slot);
/* Builds at most `most` of the panels that the view would be drawn from: *built of them; *left: still missing. */
SV_MUST_CHECK enum sv_status sv_backend_ahead(struct sv_backend *backend, const struct sv_view_request *request,
                                              uint32_t most, uint32_t *built, uint32_t *left,
                                              struct sv_error *error);
/* Refines one of the panels that the view is drawn from (core/view/cells_refine.h), or goes on with one: *refined: 1 when
 * it is whole; *left: panels to be refined still. */
struct sv_backend_refine_options {
    int samples;                 /* a texel */
    bool (*stop)(void *context); /* polled after each row */
    void *context;
};
SV_MUST_CHECK enum sv_status sv_backend_refine(struct sv_backend *backend, const struct sv_view_request *request,
                                               const struct sv_backend_refine_options *options, uint32_t *refined,
                                               uint32_t *left, struct sv_error *error);
/* The form of trees that drawing the view has to build first, for seconds, and that could be built beside it:
 * 0: none. */
int sv_backend_lacks(const struct sv_backend *backend, const struct sv_resolved_view *view);
/* Builds that form of all species, for workers to find. In a process forked for it. */
void sv_backend_build(const struct sv_backend *backend, int form);
/* Writes the document anew. False when that failed: the old one stands. */
bool sv_backend_renew_document(struct sv_backend *backend);
/* *has_ground with SV_EUNDERGROUND. */
SV_MUST_CHECK enum sv_status sv_backend_resolve(struct sv_backend *backend,
                                                const struct sv_view_request *request,
                                                struct sv_resolved_view *view, bool *has_ground,
                                                double *ground_z, struct sv_error *error);
/* Rows of a view for one of several workers that draw it (server/bands.h). */
struct sv_backend_band {
    int row_first, row_count;
    struct sv_bands shared;
};
/* Heap layers of these rows; sv_image_free them. Timings start as "did not run". */
SV_MUST_CHECK enum sv_status sv_backend_draw_band(struct sv_backend *backend, const struct sv_view_request *request,
                                                  const struct sv_resolved_view *view,
                                                  const struct sv_backend_band *band, struct sv_picture *picture,
                                                  struct sv_bands_part *part, struct sv_error *error);
/* Heap bytes of the picture that bands were put together to; part: what all of them told, to which it adds. */
SV_MUST_CHECK enum sv_status sv_backend_encode(struct sv_backend *backend, const struct sv_view_request *request,
                                               const struct sv_resolved_view *view, const struct sv_picture *picture,
                                               int epsg, struct sv_bands_part *part, void **bytes, size_t *size,
                                               struct sv_error *error);
/* Heap bytes of the encoded picture. Timings start as "did not run". */
SV_MUST_CHECK enum sv_status sv_backend_draw(struct sv_backend *backend,
                                             const struct sv_view_request *request,
                                             const struct sv_resolved_view *view, int epsg, void **bytes,
                                             size_t *size, struct sv_timings *timings,
                                             struct sv_draw_stats *stats, struct sv_error *error);

#endif
