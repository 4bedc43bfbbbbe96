/* admit.c - means, and a table of recently wanted keys, four ways to a set. */
#include "core/cell/admit.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "core/base/rng.h"

enum { FIRST = 4, NEWEST = 8, DOUBT = 256 };

void sv_cell_admit_init(struct sv_cell_admit *admit, const struct sv_cell_admit_options *options)
{
    memset(admit, 0, sizeof *admit);
    admit->options = *options;
}

static double value_of(const struct sv_cell_admit_mean *mean, double believed)
{
    return mean->count >= FIRST ? mean->value : believed;
}

static void move(struct sv_cell_admit_mean *mean, double sample)
{
    if (mean->count < FIRST)
        mean->value = mean->count > 0 ? fmin(mean->value, sample) : sample;
    else
        mean->value += (sample - mean->value) / NEWEST;
    mean->count += mean->count < UINT32_MAX;
}

static void doubt(struct sv_cell_admit_mean *mean, double believed)
{
    if (mean->count > 0)
        mean->value += (believed - mean->value) / DOUBT;
}

static struct sv_cell_admit_mean *pictures_of(struct sv_cell_admit *admit, int64_t pixels)
{
    int n = pixels > 1 ? ilogb((double)pixels) : 0;
    return admit->picture_s[n < SV_CELL_ADMIT_SIZES ? n : SV_CELL_ADMIT_SIZES - 1];
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

/* The decision at hand. */
struct decision {
    struct sv_cell_admit *admit;
    const struct sv_cell_admit_request *request;
    struct sv_cell_admit_mean *picture_s; /* of that size, by level */
};

static double believed_s(const struct decision *d, int level)
{
    return d->picture_s[0].value * (1 - d->admit->options.share * level / d->request->rings);
}

static double picture_s(const struct decision *d, int level)
{
    return level > 0 ? value_of(&d->picture_s[level], believed_s(d, level)) : d->picture_s[0].value;
}

/* What is missing of the k-th ring costs. */
static double cost_of(const struct decision *d, int k)
{
    double believed = d->admit->options.build_s;
    return d->request->ring[k - 1].crowns * value_of(&d->admit->crowns_s[k - 1], believed) +
           d->request->ring[k - 1].ground * value_of(&d->admit->ground_s[k - 1], believed);
}

/* Its share of patience. */
static double wary(const struct decision *d, int k)
{
    double paid = d->admit->paid_s[k - 1], earned = d->admit->earned_s[k - 1];
    return paid <= earned ? 1 : earned * SV_CELL_ADMIT_WARY <= paid ? SV_CELL_ADMIT_WARY : paid / earned;
}

static bool is_missing(const struct sv_cell_admit_request *request, int k)
{
    return request->ring[k - 1].crowns > 0 || request->ring[k - 1].ground > 0;
}

static void doubt_level(struct decision *d, int level)
{
    doubt(&d->picture_s[level], believed_s(d, level));
    doubt(&d->admit->crowns_s[level - 1], d->admit->options.build_s);
    doubt(&d->admit->ground_s[level - 1], d->admit->options.build_s);
    d->admit->paid_s[level - 1] -= d->admit->paid_s[level - 1] / DOUBT;
}

/* What each ring costs and saves in the picture at hand. */
static void enter(struct decision *d, const struct sv_cell_admit_answer *answer)
{
    static const double older = 0.75; /* a dozen builds back counts for nothing */
    for (int k = 1; k <= answer->level; k++) {
        double *paid = &d->admit->paid_s[k - 1], *earned = &d->admit->earned_s[k - 1];
        if (is_missing(d->request, k)) {
            *paid = older * *paid + cost_of(d, k);
            *earned *= older;
        }
        *earned += picture_s(d, k - 1) - picture_s(d, k);
    }
}

/* The level of those whose panels are there that takes least. */
static int best_there(struct decision *d)
{
    int best = 0, there = 0;
    while (there < d->request->rings && !is_missing(d->request, there + 1))
        if (picture_s(d, ++there) <= picture_s(d, best))
            best = there;
    if (there > best)
        doubt_level(d, there);
    return best;
}

struct sv_cell_admit_answer sv_cell_admit(struct sv_cell_admit *admit,
                                          const struct sv_cell_admit_request *request)
{
    assert(request->rings >= 0 && request->rings <= SV_CELL_RINGS_MAX);
    struct decision d = {admit, request, pictures_of(admit, request->pixels)};
    struct sv_cell_admit_answer answer = {.level = best_there(&d)};
    double takes_s = picture_s(&d, answer.level), cost_s = 0;
    bool known = d.picture_s[0].count >= admit->options.direct, missing = false;
    for (int k = 1; k <= request->rings; k++) {
        cost_s += cost_of(&d, k) * wary(&d, k);
        missing = missing || is_missing(request, k);
        if (!missing)
            continue;
        double saves_s = takes_s - picture_s(&d, k);
        uint32_t times = note(admit, request->ring[k - 1].key, request->now_s);
        if (times < 2 || !known)
            continue;
        if (saves_s > 0 && times * saves_s >= admit->options.patience * cost_s)
            answer = (struct sv_cell_admit_answer){k, true};
        else
            doubt_level(&d, k);
    }
    enter(&d, &answer);
    return answer;
}

void sv_cell_admit_drawn(struct sv_cell_admit *admit, int64_t pixels, int level, double seconds)
{
    assert(level >= 0 && level <= SV_CELL_RINGS_MAX);
    struct sv_cell_admit_mean *of = pictures_of(admit, pixels);
    if (!(seconds > 0 && isfinite(seconds)))
        return;
    move(&of[level], seconds);
    if (level > 0)
        doubt(&of[0], seconds);
}

void sv_cell_admit_built(struct sv_cell_admit *admit, int k, bool ground, double panels, double seconds)
{
    assert(k >= 1 && k <= SV_CELL_RINGS_MAX);
    double each_s = seconds / panels;
    if (panels > 0 && each_s > 0 && isfinite(each_s))
        move(ground ? &admit->ground_s[k - 1] : &admit->crowns_s[k - 1], each_s);
}
