/* refine.h - panels of relief cells that views keep coming back to, drawn again from the ray-cast truth by a
 * worker that has nothing else to do (core/view/cells_refine.h): so places that are much looked at come ever
 * closer to the truth.
 *
 * A cell is in demand when SV_REFINE_DEMAND views were answered from it since it was refined, or is known at all, which are
 * the SV_REFINE_CELLS that were looked at last. The one that most want comes first; one panel is refined at a time, by one
 * worker. Views, and panels that are built ahead, go first: where there are several workers one is always left idle, and a
 * worker that is wanted is told to stop, which it does within a row of texels; what it has of its panel it keeps, and goes
 * on with it when it is idle again. One thread.
 */
#ifndef SV_SERVER_REFINE_H
#define SV_SERVER_REFINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/view/request.h"
#include "core/view/timings.h"
#include "server/daemon/loop.h"
#include "server/wire.h"

struct sv_service;

enum {
    SV_REFINE_CELLS = 32, /* looked at lately */
    SV_REFINE_DEMAND = 3, /* views of one cell: who moves on sees it once or twice */
};

struct sv_refine_cell {
    uint64_t id;                    /* 0: none */
    struct sv_view_request request; /* its last view */
    uint32_t wanted;                /* views since it was refined */
    uint32_t refined;               /* panels, meanwhile */
    uint64_t last;                  /* when, in views of all cells */
};

struct sv_refine {
    struct sv_refine_cell cells[SV_REFINE_CELLS];
    struct sv_refine_cell *running; /* NULL: nobody refines */
    uint64_t worker;                /* who refined last: it may have begun a panel */
    uint64_t views;
    struct sv_timer deadline; /* of a worker that was told to stop */
};

void sv_refine_init(struct sv_service *service);
/* A view was answered from those panels. */
void sv_refine_seen(struct sv_service *service, const struct sv_view_request *request,
                    const struct sv_cell_use *use);
/* Has an idle worker refine, or stops one that is wanted for better. */
void sv_refine_pump(struct sv_service *service);
/* Forgets all; nobody refines any more. */
void sv_refine_clear(struct sv_service *service);
/* Cells in demand. */
size_t sv_refine_count(const struct sv_refine *refine);

/* Outcomes (struct sv_crew_events); context is the service. */
void sv_refine_done(void *context, void *work, const struct sv_wire_refined *answer);
void sv_refine_lost(void *context, void *work);

/* Pure: which cell's turn it is; NULL: none is in demand. */
struct sv_refine_cell *sv_refine_next(struct sv_refine *refine);

#endif
