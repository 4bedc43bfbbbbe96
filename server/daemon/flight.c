#include "server/daemon/flight.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"

static uint64_t hash_of(uint64_t scene_version, const char *canonical)
{
    return sv_hash_done(sv_hash_string(sv_hash_u64(SV_HASH_INIT, scene_version), canonical));
}

struct sv_flight *sv_flight_find(const struct sv_flights *flights, uint64_t scene_version,
                                 const char *canonical)
{
    uint64_t hash = hash_of(scene_version, canonical);
    struct sv_flight *f = flights->bucket[hash % SV_FLIGHT_BUCKETS];
    while (f &&
           (f->hash != hash || f->scene_version != scene_version || strcmp(f->canonical, canonical) != 0))
        f = f->chain;
    return f;
}

static void enter(struct sv_flights *flights, struct sv_flight *flight, uint64_t scene_version)
{
    flight->scene_version = scene_version;
    flight->hash = hash_of(scene_version, flight->canonical);
    struct sv_flight **bucket = &flights->bucket[flight->hash % SV_FLIGHT_BUCKETS];
    flight->chain = *bucket;
    *bucket = flight;
}

static void leave_bucket(struct sv_flights *flights, struct sv_flight *flight)
{
    struct sv_flight **at = &flights->bucket[flight->hash % SV_FLIGHT_BUCKETS];
    while (*at != flight)
        at = &(*at)->chain;
    *at = flight->chain;
}

struct sv_flight *sv_flight_create(struct sv_flights *flights, uint64_t scene_version, const char *canonical,
                                   const struct sv_view_request *request)
{
    size_t bytes = strlen(canonical);
    struct sv_flight *flight = bytes < SV_API_CANONICAL_MAX ? calloc(1, sizeof *flight) : NULL;
    if (!flight)
        return NULL;
    memcpy(flight->canonical, canonical, bytes + 1);
    flight->request = *request;
    flight->plan_ms = -1;
    flight->part_count = 1;
    for (int k = 0; k < SV_BANDS_MAX; k++)
        flight->parts[k].flight = flight;
    enter(flights, flight, scene_version);
    flight->previous = flights->last;
    *(flights->last ? &flights->last->next : &flights->first) = flight;
    flights->last = flight;
    flights->count++;
    return flight;
}

void sv_flight_destroy(struct sv_flights *flights, struct sv_flight *flight)
{
    leave_bucket(flights, flight);
    *(flight->previous ? &flight->previous->next : &flights->first) = flight->next;
    *(flight->next ? &flight->next->previous : &flights->last) = flight->previous;
    flights->count--;
    free(flight);
}

void sv_flight_rebind(struct sv_flights *flights, struct sv_flight *flight, uint64_t scene_version)
{
    leave_bucket(flights, flight);
    flight->stage = SV_FLIGHT_RESOLVE;
    flight->plan_ms = -1;
    enter(flights, flight, scene_version);
}

void sv_flight_join(struct sv_flight *flight, struct sv_waiter *waiter, double deadline_ms)
{
    *waiter = (struct sv_waiter){.previous = flight->last,
                                 .flight = flight,
                                 .deadline_ms = deadline_ms,
                                 .collapsed = flight->waiters > 0 || flight->running};
    *(flight->last ? &flight->last->next : &flight->first) = waiter;
    flight->last = waiter;
    flight->waiters++;
    if (deadline_ms > flight->deadline_ms)
        flight->deadline_ms = deadline_ms;
}

void sv_flight_leave(struct sv_waiter *waiter)
{
    struct sv_flight *flight = waiter->flight;
    if (!flight)
        return;
    *(waiter->previous ? &waiter->previous->next : &flight->first) = waiter->next;
    *(waiter->next ? &waiter->next->previous : &flight->last) = waiter->previous;
    waiter->next = waiter->previous = NULL;
    waiter->flight = NULL;
    flight->waiters--;
}
