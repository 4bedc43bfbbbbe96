#include "server/daemon/metrics.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* From a cache hit to the slowest reference picture. */
static const double bounds_s[SV_METRIC_BUCKETS] = {0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05,
                                                   0.1,    0.25,  0.5,    1,     2.5,  10,    60};

static void observe(struct sv_histogram *h, double seconds)
{
    size_t i = 0;
    while (i < SV_METRIC_BUCKETS && seconds > bounds_s[i])
        i++;
    h->bucket[i]++;
    h->sum_s += seconds;
}

void sv_metrics_stages(struct sv_metrics *m, const struct sv_timings *timings)
{
    for (int s = 0; s < SV_STAGE_COUNT; s++)
        if (timings->ms[s] >= 0)
            observe(&m->stage[s], timings->ms[s] * 1e-3);
}

void sv_metrics_request(struct sv_metrics *m, const char *route, unsigned status, double seconds,
                        uint64_t bytes)
{
    observe(&m->request, seconds);
    m->response_bytes += bytes;
    for (size_t i = 0; i < m->request_kinds; i++)
        if (m->requests[i].status == status && strcmp(m->requests[i].route, route) == 0) {
            m->requests[i].count++;
            return;
        }
    if (m->request_kinds < SV_METRIC_REQUEST_KINDS)
        m->requests[m->request_kinds++] = (struct sv_request_count){route, status, 1};
}

static void print_histogram(FILE *out, const char *name, const char *label, const struct sv_histogram *h)
{
    uint64_t below = 0;
    const char *comma = label[0] ? "," : "";
    for (size_t i = 0; i < SV_METRIC_BUCKETS; i++) {
        below += h->bucket[i];
        fprintf(out, "silvista_%s_bucket{%s%sle=\"%g\"} %llu\n", name, label, comma, bounds_s[i],
                (unsigned long long)below);
    }
    below += h->bucket[SV_METRIC_BUCKETS];
    fprintf(out, "silvista_%s_bucket{%s%sle=\"+Inf\"} %llu\n", name, label, comma, (unsigned long long)below);
    const char *open = label[0] ? "{" : "", *close = label[0] ? "}" : "";
    fprintf(out, "silvista_%s_sum%s%s%s %.9g\n", name, open, label, close, h->sum_s);
    fprintf(out, "silvista_%s_count%s%s%s %llu\n", name, open, label, close, (unsigned long long)below);
}

static void print_head(FILE *out, const char *name, const char *type, const char *help)
{
    fprintf(out, "# HELP silvista_%s %s\n# TYPE silvista_%s %s\n", name, help, name, type);
}

static void print_numbers(FILE *out, const struct sv_metrics *m)
{
#define X(id, name, help)                   \
    print_head(out, name, "counter", help); \
    fprintf(out, "silvista_%s %llu\n", name, (unsigned long long)m->counter[id]);
    SV_COUNTER_LIST(X)
#undef X
#define X(id, name, help)                 \
    print_head(out, name, "gauge", help); \
    fprintf(out, "silvista_%s %.15g\n", name, m->gauge[id]);
    SV_GAUGE_LIST(X)
#undef X
}

static void print_histograms(FILE *out, const struct sv_metrics *m)
{
    static const char *const stages[] = {
#define X(id, name) [id] = name,
        SV_STAGE_LIST(X)
#undef X
    };
    print_head(out, "stage_seconds", "histogram", "time of each stage of the views that ran it");
    for (int s = 0; s < SV_STAGE_COUNT; s++) {
        char label[48];
        snprintf(label, sizeof label, "stage=\"%s\"", stages[s]);
        print_histogram(out, "stage_seconds", label, &m->stage[s]);
    }
    print_head(out, "request_seconds", "histogram", "from a request's first line to the end of its answer");
    print_histogram(out, "request_seconds", "", &m->request);
}

char *sv_metrics_text(const struct sv_metrics *m, const char *build)
{
    char *text = NULL;
    size_t bytes = 0;
    FILE *out = open_memstream(&text, &bytes);
    if (!out)
        return NULL;
    print_head(out, "build_info", "gauge", "1, labelled with the version that runs");
    fprintf(out, "silvista_build_info{version=\"%s\"} 1\n", build);
    print_numbers(out, m);
    print_head(out, "http_requests_total", "counter", "requests answered, by route and status");
    for (size_t i = 0; i < m->request_kinds; i++)
        fprintf(out, "silvista_http_requests_total{route=\"%s\",code=\"%u\"} %llu\n", m->requests[i].route,
                m->requests[i].status, (unsigned long long)m->requests[i].count);
    print_head(out, "http_response_bytes_total", "counter", "bytes of bodies sent");
    fprintf(out, "silvista_http_response_bytes_total %llu\n", (unsigned long long)m->response_bytes);
    print_histograms(out, m);
    if (fclose(out)) {
        free(text);
        return NULL;
    }
    return text;
}
