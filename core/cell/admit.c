/* admit.c - means, and a table of recently wanted keys, four ways to a set. */
#include "core/cell/admit.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "core/base/rng.h"

void sv_cell_admit_init(struct sv_cell_admit *admit, const struct sv_cell_admit_options *options)
{
    memset(admit, 0, sizeof *admit);
    admit->options = *options;
    for (int kind = 0; kind < SV_CELL_ADMIT_KINDS; kind++) {
        admit->mean[kind].build_s = options->build_s;
        admit->mean[kind].saving_s = options->saving_s;
        admit->mean[kind].builds = admit->mean[kind].savings = 1;
    }
}

/* How often the key was wanted, this time included, without a pause longer than the window. */
static uint32_t note(struct sv_cell_admit *admit, uint64_t key, double now_s)
{
    int at = 0;
    uint64_t set = sv_mix64(key) % SV_CELL_ADMIT_SETS;
    for (int way = 0; way < SV_CELL_ADMIT_WAYS; way++) {
        if (admit->wanted[set][way].key == key) {
            at = way;
            break;
        }
        bool emptier = admit->wanted[set][way].key == 0 && admit->wanted[set][at].key != 0;
        bool older = admit->wanted[set][way].key != 0 && admit->wanted[set][at].key != 0 &&
                     admit->wanted[set][way].last_s < admit->wanted[set][at].last_s;
        at = emptier || older ? way : at;
    }
    bool again =
        admit->wanted[set][at].key == key && now_s - admit->wanted[set][at].last_s <= admit->options.window_s;
    uint32_t times = again ? admit->wanted[set][at].times : 0;
    times += times < UINT32_MAX;
    admit->wanted[set][at].key = key;
    admit->wanted[set][at].last_s = now_s;
    admit->wanted[set][at].times = times;
    return times;
}

bool sv_cell_admit(struct sv_cell_admit *admit, const struct sv_cell_admit_request *request)
{
    assert(request->kind >= 0 && request->kind < SV_CELL_ADMIT_KINDS);
    uint32_t times = note(admit, request->key, request->now_s);
    double *cost = &admit->mean[request->kind].build_s, *saving = &admit->mean[request->kind].saving_s;
    if (*saving > 0 && request->frames * *saving > *cost)
        return true;
    if (times < 2)
        return false;
    if (*saving > 0 && times * *saving >= admit->options.patience * *cost)
        return true;
    *cost += (admit->options.build_s - *cost) / 256;
    *saving += (admit->options.saving_s - *saving) / 256;
    return false;
}

static void move(double *mean, uint32_t *count, double sample)
{
    *count += *count < 8;
    *mean += (sample - *mean) / *count;
}

void sv_cell_admit_measured(struct sv_cell_admit *admit, int kind, double build_s, double saving_s)
{
    assert(kind >= 0 && kind < SV_CELL_ADMIT_KINDS);
    if (build_s >= 0 && build_s < INFINITY)
        move(&admit->mean[kind].build_s, &admit->mean[kind].builds, build_s);
    if (fabs(saving_s) < INFINITY)
        move(&admit->mean[kind].saving_s, &admit->mean[kind].savings, saving_s);
}
