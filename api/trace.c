/* trace.c - see trace.h. */
#include "api/trace.h"

#include <stdio.h>
#include <string.h>

static const char hex_digits[] = "0123456789abcdef";
static const char id_letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";

static bool is_hex(const char *p, size_t n)
{
    return strspn(p, hex_digits) >= n;
}

static bool is_zero(const char *p, size_t n)
{
    return strspn(p, "0") >= n;
}

/* version 2 hex, trace id 32, parent id 16, flags 2 (section 3.2); ids of zeros and version ff are not legal.
 */
bool sv_api_traceparent_valid(const char *p)
{
    size_t n = strnlen(p, 256);
    if (n < 55 || n > 255 || p[2] != '-' || p[35] != '-' || p[52] != '-')
        return false;
    if (!is_hex(p, 2) || !is_hex(p + 3, 32) || !is_hex(p + 36, 16) || !is_hex(p + 53, 2))
        return false;
    if (memcmp(p, "ff", 2) == 0 || is_zero(p + 3, 32) || is_zero(p + 36, 16))
        return false;
    return memcmp(p, "00", 2) == 0 ? n == 55 : n == 55 || p[55] == '-';
}

static void write_hex(const uint8_t *bytes, size_t n, char *out)
{
    for (size_t k = 0; k < n; k++) {
        out[2 * k] = hex_digits[bytes[k] >> 4];
        out[2 * k + 1] = hex_digits[bytes[k] & 15];
    }
    out[2 * n] = '\0';
}

void sv_api_trace(const char *request_id, const char *traceparent,
                  const uint8_t random[SV_TRACE_RANDOM_BYTES], struct sv_trace *trace)
{
    char trace_id[33], span_id[17], flags[3] = "00";
    size_t n = request_id ? strspn(request_id, id_letters) : 0;
    if (n >= 1 && n < SV_REQUEST_ID_BUFFER && request_id[n] == '\0')
        memcpy(trace->request_id, request_id, n + 1);
    else
        write_hex(random, 16, trace->request_id);
    trace->continued = traceparent && sv_api_traceparent_valid(traceparent);
    write_hex(random + 16, 16, trace_id);
    write_hex(random + 32, 8, span_id);
    if (is_zero(trace_id, 32)) /* never in practice; zeros are not legal ids */
        trace_id[31] = '1';
    if (is_zero(span_id, 16))
        span_id[15] = '1';
    if (trace->continued) {
        memcpy(trace_id, traceparent + 3, 32);
        flags[1] =
            memchr("13579bdf", traceparent[54], 8) ? '1' : '0'; /* of the flags only "sampled" is known */
    }
    snprintf(trace->traceparent, sizeof trace->traceparent, "00-%s-%s-%s", trace_id, span_id, flags);
}
