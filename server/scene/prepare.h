/* prepare.h - species and objects built side by side, in forked children, while the scene process loads the
 * terrain.
 *
 * Each child takes one species or model after the other off a shared counter, builds its mesh and bakes its
 * impostor or its reliefs (these by a GL context of the child's own), and leaves all in the store;
 * sv_scene_load and sv_renderer_create then find them there. Nothing depends on it: what a child does not
 * finish, because it died or failed, is built again by whoever needs it, and the reason for a failure is told
 * there. */
#ifndef SV_SERVER_SCENE_PREPARE_H
#define SV_SERVER_SCENE_PREPARE_H

#include "core/base/store.h"
#include "core/scene/scene_file.h"

struct sv_prepare;

/* Forks at most `processes` children for the species that some part of the forest may plant and the models of
 * objects. Borrows spec and
 * store until it is destroyed. NULL, and nothing forked, when there is no store, fewer than two processes are
 * allowed, or nothing needs building. Only while no thread runs, and before any GL context is made. */
struct sv_prepare *sv_prepare_start(const struct sv_scene_spec *spec, struct sv_store *store, int processes);
/* Waits until all children are done. NULL is legal. */
void sv_prepare_wait(struct sv_prepare *prepare);
/* Ends the children that still run, and reaps them. NULL is legal. */
void sv_prepare_destroy(struct sv_prepare *prepare);

#endif
