/* hooks.h - how the project's own tests make a load wait and a worker wait or die, at a moment that they
 * choose.
 *
 * Off unless the environment says SILVISTA_TEST_HOOKS=1 and a folder is given. Files in that folder command:
 *   hold-load    the scene process waits before it loads, while the file is there
 *   hold         lists picture widths ("77 80" or "all"; "77/1": of pictures in bands that band alone): a worker that is to
 *                draw one writes held-PID and waits while it is listed
 *   hold-refine  a worker that refines panels writes held-PID and waits between two rows, while the file is there and
 *                nothing is said to the worker
 *   crash-patch  a successor kills itself when its patch is made, before it says so
 *   crash        lists picture widths likewise: a worker that is to draw one kills itself with SIGKILL
 *   crash-encode lists picture widths likewise: a worker that has put the last band of one there removes the file and kills
 *                itself
 */
#ifndef SV_SERVER_HOOKS_H
#define SV_SERVER_HOOKS_H

#include <stdbool.h>

/* folder is borrowed; NULL or "": none. */
void sv_hooks_init(const char *folder);
void sv_hooks_before_load(void);
/* band: 0 for a whole picture. */
void sv_hooks_before_draw(int width, int band);
void sv_hooks_before_encode(int width, int band);
void sv_hooks_after_patch(void);
/* Whether refining is held; takes a moment then. */
bool sv_hooks_refining_held(void);

#endif
