#include "server/daemon/queue.h"

#include <math.h>
#include <string.h>

/* Share of the newest service time in the average: about the last ten views count. */
static const double newest_share = 0.1;

void sv_queue_init(struct sv_queue *queue, size_t limit)
{
    memset(queue, 0, sizeof *queue);
    queue->limit = limit;
}

bool sv_queue_full(const struct sv_queue *queue)
{
    return queue->count >= queue->limit;
}

void sv_queue_return(struct sv_queue *queue, struct sv_queue_item *item, enum sv_queue_class class_,
                     bool front, double now_ms)
{
    *item = (struct sv_queue_item){.class_ = class_, .queued = true, .since_ms = now_ms};
    struct sv_queue_item **first = &queue->first[class_], **last = &queue->last[class_];
    if (front) {
        item->next = *first;
        *(*first ? &(*first)->previous : last) = item;
        *first = item;
    } else {
        item->previous = *last;
        *(*last ? &(*last)->next : first) = item;
        *last = item;
    }
    queue->count++;
}

bool sv_queue_admit(struct sv_queue *queue, struct sv_queue_item *item, enum sv_queue_class class_,
                    double now_ms)
{
    if (sv_queue_full(queue))
        return false;
    sv_queue_return(queue, item, class_, false, now_ms);
    return true;
}

struct sv_queue_item *sv_queue_first(const struct sv_queue *queue)
{
    for (int c = 0; c < SV_QUEUE_CLASS_COUNT; c++)
        if (queue->first[c])
            return queue->first[c];
    return NULL;
}

void sv_queue_remove(struct sv_queue *queue, struct sv_queue_item *item)
{
    if (!item->queued)
        return;
    *(item->previous ? &item->previous->next : &queue->first[item->class_]) = item->next;
    *(item->next ? &item->next->previous : &queue->last[item->class_]) = item->previous;
    item->next = item->previous = NULL;
    item->queued = false;
    queue->count--;
}

void sv_queue_served(struct sv_queue *queue, double ms)
{
    queue->service_ms =
        queue->service_ms > 0 ? queue->service_ms + newest_share * (ms - queue->service_ms) : ms;
}

int sv_queue_retry_after_s(const struct sv_queue *queue, size_t workers)
{
    double wait_s = ceil((double)queue->count * queue->service_ms / (double)(workers ? workers : 1) * 1e-3);
    return wait_s < 1 ? 1 : wait_s > 3600 ? 3600 : (int)wait_s;
}
