/* queue.h - work that waits for a worker: bounded, first come first served within a class, resolve before
 * view.
 *
 * The queue knows neither views nor workers. Items live in their owner's struct. What has been admitted once
 * and comes back (a resolved view that now wants its drawing, a view whose worker died) is put in without
 * asking for room. It also keeps the recent service time, from which it tells a client that was refused when
 * to come again. */
#ifndef SV_SERVER_QUEUE_H
#define SV_SERVER_QUEUE_H

#include <stdbool.h>
#include <stddef.h>

enum sv_queue_class { SV_QUEUE_RESOLVE, SV_QUEUE_VIEW, SV_QUEUE_CLASS_COUNT };

struct sv_queue_item {
    struct sv_queue_item *next, *previous;
    enum sv_queue_class class_;
    bool queued;
    double since_ms;
};

struct sv_queue {
    struct sv_queue_item *first[SV_QUEUE_CLASS_COUNT], *last[SV_QUEUE_CLASS_COUNT];
    size_t count, limit;
    double service_ms; /* moving average of drawing one view; 0: none seen yet */
};

void sv_queue_init(struct sv_queue *queue, size_t limit);
/* False when the queue is full: the item is not in it. */
bool sv_queue_admit(struct sv_queue *queue, struct sv_queue_item *item, enum sv_queue_class class_,
                    double now_ms);
/* Puts back what was admitted before; front: ahead of its class. */
void sv_queue_return(struct sv_queue *queue, struct sv_queue_item *item, enum sv_queue_class class_,
                     bool front, double now_ms);
/* The next one, still in the queue; NULL when empty. */
struct sv_queue_item *sv_queue_first(const struct sv_queue *queue);
/* Takes an item out, wherever it stands; nothing happens when it is not in. */
void sv_queue_remove(struct sv_queue *queue, struct sv_queue_item *item);
bool sv_queue_full(const struct sv_queue *queue);

/* A view took that long on a worker. */
void sv_queue_served(struct sv_queue *queue, double ms);
/* Whole seconds, 1 .. 3600, after which `workers` of them have worked off what waits now. */
int sv_queue_retry_after_s(const struct sv_queue *queue, size_t workers);

#endif
