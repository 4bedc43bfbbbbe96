/* wire.h - what the daemon, a scene process and its workers say to each other over SOCK_SEQPACKET
 * socketpairs.
 *
 * Every message is one fixed struct that begins with struct sv_wire_head: magic, version, type and its exact
 * size. Both programs are built together; a program of another build is refused by size or version at its
 * first message. A message may carry one descriptor (SCM_RIGHTS). Nothing here blocks longer than its socket
 * does.
 *
 * daemon -> scene   FORK (fd: the worker's end of a socketpair)
 * scene  -> daemon  CELLS (fd: memfd of relief panels, before READY), READY (fd: memfd with the facts as JSON),
 *                   or REASON ... REASON FAILED; FORKED (fd: pidfd), EXITED, FACTS (fd: memfd)
 * daemon -> worker  RESOLVE, VIEW (fd: slab), BUILD, REFINE, STOP
 * worker -> daemon  RESOLVED, DRAWN, BUILT, REFINED
 *
 * A patch: daemon -> scene PATCH (fd: the successor's end of a socketpair), which is forked from the scene
 * process and told of by FOLLOWED; daemon -> successor PATCH_TEXT (fd: memfd with the body) over its own
 * socket; there it answers PATCHED and READY, or REASON ... FAILED, and is a scene process from then on. */
#ifndef SV_SERVER_WIRE_H
#define SV_SERVER_WIRE_H

#include <stdint.h>

#include "core/base/error.h"
#include "core/scene/change.h"
#include "core/view/request.h"
#include "core/view/resolved.h"
#include "core/view/timings.h"

#define SV_WIRE_MAGIC UINT32_C(0x53565751)
enum { SV_WIRE_VERSION = 4 };

#define SV_WIRE_LIST(X)                                    \
    X(SV_WIRE_READY, struct sv_wire_ready, ready)          \
    X(SV_WIRE_REASON, struct sv_wire_reason, reason)       \
    X(SV_WIRE_FAILED, struct sv_wire_failed, failed)       \
    X(SV_WIRE_FORK, struct sv_wire_fork, fork)             \
    X(SV_WIRE_FORKED, struct sv_wire_forked, forked)       \
    X(SV_WIRE_EXITED, struct sv_wire_exited, exited)       \
    X(SV_WIRE_RESOLVE, struct sv_wire_resolve, resolve)    \
    X(SV_WIRE_RESOLVED, struct sv_wire_resolved, resolved) \
    X(SV_WIRE_VIEW, struct sv_wire_view, view)             \
    X(SV_WIRE_DRAWN, struct sv_wire_drawn, drawn)          \
    X(SV_WIRE_CELLS, struct sv_wire_cells, cells)          \
    X(SV_WIRE_BUILD, struct sv_wire_build, build)          \
    X(SV_WIRE_BUILT, struct sv_wire_built, built)          \
    X(SV_WIRE_REFINE, struct sv_wire_refine, refine)       \
    X(SV_WIRE_REFINED, struct sv_wire_refined, refined)    \
    X(SV_WIRE_STOP, struct sv_wire_stop, stop)             \
    X(SV_WIRE_PATCH, struct sv_wire_patch, patch)          \
    X(SV_WIRE_FOLLOWED, struct sv_wire_followed, followed) \
    X(SV_WIRE_PATCH_TEXT, struct sv_wire_patch_text, text) \
    X(SV_WIRE_PATCHED, struct sv_wire_patched, patched)    \
    X(SV_WIRE_FACTS, struct sv_wire_facts, facts)

enum sv_wire_type {
#define X(name, type, member) name,
    SV_WIRE_LIST(X)
#undef X
        SV_WIRE_TYPE_COUNT
};

struct sv_wire_head {
    uint32_t magic;
    uint16_t version, type;
    uint32_t size; /* of the whole struct, bytes */
    uint32_t reserved;
    uint64_t id; /* of the job or of the worker that the message is about */
};

struct sv_wire_ready {
    struct sv_wire_head head;
    uint64_t scene_version;
    uint64_t facts_bytes;     /* of JSON text in the memfd */
    double relief_distance_m; /* the scene's own: the size of a cell */
    int32_t epsg;             /* of the scene's coordinate system, 0 when it has no code */
    uint32_t new_threads;     /* that loading started and that still run: none may when workers are forked */
};

struct sv_wire_facts { /* with a memfd: what READY brought is out of date */
    struct sv_wire_head head;
    uint64_t facts_bytes;
};

struct sv_wire_cells { /* with a memfd (server/cells_memory.h): the panels that the workers to come share */
    struct sv_wire_head head;
    uint64_t bytes;
};

struct sv_wire_reason { /* one reason why a scene does not load */
    struct sv_wire_head head;
    struct sv_error error;
};

struct sv_wire_failed { /* after the reasons; the scene process leaves */
    struct sv_wire_head head;
    uint32_t status; /* enum sv_status */
    uint32_t total;  /* reasons found; at most SV_ERRORS_MAX of them were sent */
};

struct sv_wire_fork {
    struct sv_wire_head head;
};

struct sv_wire_forked { /* without a descriptor: the fork failed, error_number says why */
    struct sv_wire_head head;
    int32_t pid;
    int32_t error_number;
};

struct sv_wire_exited { /* a worker was reaped */
    struct sv_wire_head head;
    int32_t pid;
    int32_t wait_status; /* as waitpid gives it */
};

struct sv_wire_resolve {
    struct sv_wire_head head;
    struct sv_view_request request;
};

struct sv_wire_resolved {
    struct sv_wire_head head;
    uint32_t status; /* enum sv_status; error is set when it is not SV_OK */
    uint32_t has_ground;
    double ground_z; /* m, with SV_EUNDERGROUND */
    double plan_ms;
    struct sv_error error;
    struct sv_resolved_view view;
};

struct sv_wire_view {
    struct sv_wire_head head;
    struct sv_view_request request;
    struct sv_resolved_view view;
    int32_t epsg;
    int32_t band, bands;           /* of so many; 0, 1: all of the picture */
    int32_t band_first, band_rows; /* rows of the picture to draw; 0, height: all of it */
    uint32_t reserved;
};

struct sv_wire_drawn {
    struct sv_wire_head head;
    uint32_t status; /* enum sv_status; on SV_OK the slab is committed with the job's id, */
    uint32_t part;   /* unless this is not 0: the band is there, and others are not */
    uint64_t own_bytes; /* memory of the worker that it shares with nobody, after the job */
    struct sv_error error;
    struct sv_timings timings;
    struct sv_draw_stats stats;
};

struct sv_wire_build { /* panels that the view would be drawn from */
    struct sv_wire_head head;
    struct sv_view_request request;
    uint32_t most; /* panels to build at most */
    uint32_t reserved;
};

struct sv_wire_built {
    struct sv_wire_head head;
    uint32_t status; /* enum sv_status; error is set when it is not SV_OK */
    uint32_t built, left; /* panels; left: still missing */
    uint32_t reserved;
    uint64_t own_bytes; /* as in sv_wire_drawn */
    struct sv_error error;
};

struct sv_wire_refine { /* panels that the view is drawn from, again from the ray-cast truth, one of them at most */
    struct sv_wire_head head;
    struct sv_view_request request;
    int32_t samples; /* a texel */
    uint32_t reserved;
};

struct sv_wire_refined {
    struct sv_wire_head head;
    uint32_t status; /* enum sv_status; error is set when it is not SV_OK */
    uint32_t refined, left; /* panels; left: to be refined still */
    uint32_t reserved;
    uint64_t own_bytes; /* as in sv_wire_drawn */
    struct sv_error error;
};

struct sv_wire_stop { /* the worker is wanted for something better than refining; has no answer of its own */
    struct sv_wire_head head;
};

struct sv_wire_patch {
    struct sv_wire_head head;
};

struct sv_wire_followed { /* the successor was forked; it is a child of the daemon */
    struct sv_wire_head head;
    int32_t pid; /* 0: it could not be, error_number says why */
    int32_t error_number;
};

struct sv_wire_patch_text {
    struct sv_wire_head head;
    uint64_t bytes; /* in the memfd */
};

struct sv_wire_patched {
    struct sv_wire_head head;
    double ms; /* that the change took */
    struct sv_scene_change change;
};

union sv_wire_message {
    struct sv_wire_head head;
#define X(name, type, member) type member;
    SV_WIRE_LIST(X)
#undef X
};

/* A zeroed message of that type, head filled. */
void sv_wire_init(union sv_wire_message *message, enum sv_wire_type type, uint64_t id);

/* Sends one message; passed_fd (-1: none) is lent. On a blocking socket it waits; on a non-blocking one a
 * full buffer is SV_ETIMEOUT. SV_EIO when the peer is gone. */
SV_MUST_CHECK enum sv_status sv_wire_send(int fd, const union sv_wire_message *message, int passed_fd,
                                          struct sv_error *error);
/* Receives one message; *passed_fd is -1 or a close-on-exec descriptor that the caller now owns. SV_ENOENT:
 * the peer closed; SV_ETIMEOUT: nothing there (non-blocking); SV_EFORMAT: not a message of this build
 * (descriptors that came with it are closed). Texts in it are terminated. */
SV_MUST_CHECK enum sv_status sv_wire_receive(int fd, union sv_wire_message *message, int *passed_fd,
                                             struct sv_error *error);

/* A sealed memfd with the bytes; -1 with errno. */
int sv_wire_text_descriptor(const char *text, size_t bytes);
/* The text in one, with a NUL behind it, heap; NULL when it is not there or longer than most. */
char *sv_wire_read_text(int fd, uint64_t bytes, uint64_t most);

/* A status that came over the wire, made legal. */
enum sv_status sv_wire_status(uint32_t status);

#endif
