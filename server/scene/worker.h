/* worker.h - the life of a forked worker: a job comes, its answer goes, until the daemon closes the socket.
 */
#ifndef SV_SERVER_WORKER_H
#define SV_SERVER_WORKER_H

#include <sys/types.h>

#include "server/scene/backend.h"

/* Never returns; leaves by _exit only (status 0 when the daemon closed the socket). parent: the scene
 * process, with which it dies. lacks_fd: where a byte goes for each view that has a form to build
 * (sv_backend_lacks), before it is drawn; a full pipe loses it. */
_Noreturn void sv_worker_live(struct sv_backend *backend, int fd, int lacks_fd, pid_t parent);

#endif
