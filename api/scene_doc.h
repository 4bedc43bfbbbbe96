/* scene_doc.h - the document of GET /v1/scene. The scene process writes it after loading, and again when it
 * has built a form; the daemon sends it on. A species has `bytes`, what it takes in each form (of one that is
 * not built yet: what it will take, by its sizes), and `built`, the forms that are. */
#ifndef SV_API_SCENE_DOC_H
#define SV_API_SCENE_DOC_H

#include <stddef.h>

#include "core/scene/scene_facts.h"

/* Heap text (UTF-8 JSON; caller frees), NULL only when memory is out. Angles in degrees. Names may hold any
 * bytes. */
char *sv_api_scene_doc(const struct sv_scene_facts *facts, size_t *bytes);

#endif
