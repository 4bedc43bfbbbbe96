/* number.c - see number.h. Conversion is glibc's, which rounds correctly; the syntax is checked before it. */
#include "api/number.h"

#include <locale.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/vec.h"

/* strtod in the C locale, whatever locale the program runs in. Where no locale object can be had the
 * program's own is used: it is the C locale unless the program calls setlocale. */
static double read_double(const char *text)
{
    static locale_t c_locale;
    if (!c_locale)
        c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return c_locale ? strtod_l(text, NULL, c_locale) : strtod(text, NULL);
}

static size_t digits(const char *p, const char *end)
{
    size_t n = 0;
    while (p + n < end && p[n] >= '0' && p[n] <= '9')
        n++;
    return n;
}

static bool is_decimal(const char *p, const char *end)
{
    if (p < end && *p == '-')
        p++;
    size_t whole = digits(p, end), fraction = 0;
    p += whole;
    if (p < end && *p == '.') {
        p++;
        fraction = digits(p, end);
        p += fraction;
    }
    if (whole + fraction == 0)
        return false;
    if (p < end && (*p == 'e' || *p == 'E')) {
        p++;
        if (p < end && (*p == '+' || *p == '-'))
            p++;
        size_t exponent = digits(p, end);
        if (exponent == 0)
            return false;
        p += exponent;
    }
    return p == end;
}

bool sv_api_number_parse(const char *text, size_t n, double *value)
{
    char copy[SV_API_NUMBER_TEXT_MAX + 1];
    if (n > SV_API_NUMBER_TEXT_MAX || !is_decimal(text, text + n))
        return false;
    memcpy(copy, text, n);
    copy[n] = '\0';
    double v = read_double(copy);
    *value = v == 0 ? 0 : v;
    return true;
}

/* Whole numbers below 1e15, which most are, without printf: it costs a microsecond. */
static const char *format_whole(double value, char out[SV_API_NUMBER_BUFFER])
{
    char digits_back[16];
    int64_t rest = (int64_t)fabs(value);
    size_t n = 0, used = 0;
    do {
        digits_back[n++] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest > 0);
    if (value < 0)
        out[used++] = '-';
    while (n > 0)
        out[used++] = digits_back[--n];
    out[used] = '\0';
    return out;
}

const char *sv_api_number_format(double value, char out[SV_API_NUMBER_BUFFER])
{
    if (fabs(value) < 1e15 && value == floor(value))
        return format_whole(value, out);
    /* Two decimals of up to 15 digits never share a normal double, so %.15g is the shortest one where it
     * reads back. */
    for (int precision = 15; precision <= 17; precision++) {
        snprintf(out, SV_API_NUMBER_BUFFER, "%.*g", precision, value);
        char *comma = strchr(out, ',');
        if (comma)
            *comma = '.';
        if (read_double(out) == value)
            break;
    }
    return out;
}

/* One rounding lies between degrees and radians: what was written with up to 15 digits is found by rounding
 * the quotient, anything else lies within a few steps of it. */
double sv_api_degrees(double radians)
{
    double degrees = sv_degrees(radians);
    if (!isfinite(degrees))
        return degrees;
    double thousandth = nearbyint(degrees * 1e3) / 1e3; /* the double nearest to a decimal of three places */
    if (sv_radians(thousandth) == radians)
        return thousandth == 0 ? 0 : thousandth;
    for (int digits = 12; digits <= 17; digits++) {
        char text[SV_API_NUMBER_BUFFER];
        double rounded;
        snprintf(text, sizeof text, "%.*g", digits, degrees);
        if (sv_api_number_parse(text, strlen(text), &rounded) && sv_radians(rounded) == radians)
            return rounded;
    }
    double low = degrees, high = degrees;
    for (int k = 0; k < 8; k++) {
        low = nextafter(low, -INFINITY);
        high = nextafter(high, INFINITY);
        if (sv_radians(low) == radians)
            return low;
        if (sv_radians(high) == radians)
            return high;
    }
    return degrees;
}
