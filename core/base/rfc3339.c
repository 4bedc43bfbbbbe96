/* rfc3339.c - date-time of RFC 3339 section 5.6, strictly: no missing parts, no blanks around it.
 *
 * "T" and "Z" may be lower case, and a blank may stand for the "T" (the RFC's own note). Days are counted by
 * Hinnant's days_from_civil. A leap second is legal only where one can be: at 23:59:60 UTC on the last day of
 * a month. */
#include "core/base/rfc3339.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

struct parts {
    int year, month, day, hour, minute, second;
    double fraction;
    int offset_min;
};

/* Reads exactly `digits` digits. */
static bool number(const char **p, int digits, int *value)
{
    int v = 0;
    for (int k = 0; k < digits; k++) {
        char c = (*p)[k];
        if (c < '0' || c > '9')
            return false;
        v = v * 10 + (c - '0');
    }
    *p += digits;
    *value = v;
    return true;
}

static bool letter(const char **p, const char *any)
{
    for (; *any; any++)
        if (**p == *any) {
            (*p)++;
            return true;
        }
    return false;
}

static bool fraction(const char **p, double *value)
{
    *value = 0;
    if (!letter(p, "."))
        return true;
    const char *first = *p;
    double scale = 0.1;
    for (; **p >= '0' && **p <= '9'; (*p)++, scale *= 0.1)
        *value += (**p - '0') * scale;
    return *p > first;
}

static bool offset(const char **p, int *minutes)
{
    int h, m;
    *minutes = 0;
    if (letter(p, "Zz"))
        return true;
    int sign = **p == '-' ? -1 : 1;
    if (!letter(p, "+-") || !number(p, 2, &h) || !letter(p, ":") || !number(p, 2, &m) || h > 23 || m > 59)
        return false;
    *minutes = sign * (h * 60 + m);
    return true;
}

static bool split(const char *p, struct parts *t)
{
    return number(&p, 4, &t->year) && letter(&p, "-") && number(&p, 2, &t->month) && letter(&p, "-") &&
           number(&p, 2, &t->day) && letter(&p, "Tt ") && number(&p, 2, &t->hour) && letter(&p, ":") &&
           number(&p, 2, &t->minute) && letter(&p, ":") && number(&p, 2, &t->second) &&
           fraction(&p, &t->fraction) && offset(&p, &t->offset_min) && *p == '\0';
}

static int days_in_month(int year, int month)
{
    static const int days[] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    bool leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    return month == 2 && leap ? 29 : days[month - 1];
}

/* Days since 1970-01-01 in the proleptic Gregorian calendar. */
static int64_t days_from_civil(int64_t y, int m, int d)
{
    y -= m <= 2;
    int64_t era = (y >= 0 ? y : y - 399) / 400;
    int64_t yoe = y - era * 400, doy = (153 * (m + (m > 2 ? -3 : 9)) + 2) / 5 + d - 1;
    return era * 146097 + yoe * 365 + yoe / 4 - yoe / 100 + doy - 719468;
}

/* Does a month begin (UTC) at this moment? year: one that is off by at most one. */
static bool begins_month(int64_t unix_s, int year)
{
    for (int month = -11; month <= 24; month++) /* from the January before to the December after */
        if (unix_s == days_from_civil(year + (month + 11) / 12 - 1, (month + 11) % 12 + 1, 1) * 86400)
            return true;
    return false;
}

enum sv_status sv_rfc3339_parse(const char *text, double *unix_s, struct sv_error *error)
{
    struct parts t;
    if (!text || !split(text, &t))
        return sv_fail(error, SV_EINVAL, NULL, "is not a date and time");
    if (t.year < 1)
        return sv_fail(error, SV_EINVAL, NULL, "has year %04d, outside 0001..9999", t.year);
    if (t.month < 1 || t.month > 12)
        return sv_fail(error, SV_EINVAL, NULL, "has month %02d, outside 01..12", t.month);
    if (t.day < 1 || t.day > days_in_month(t.year, t.month))
        return sv_fail(error, SV_EINVAL, NULL, "has day %02d, outside 01..%d of that month", t.day,
                       days_in_month(t.year, t.month));
    if (t.hour > 23 || t.minute > 59 || t.second > 60)
        return sv_fail(error, SV_EINVAL, NULL, "has time %02d:%02d:%02d, outside 00:00:00..23:59:60", t.hour,
                       t.minute, t.second);
    int64_t minute = days_from_civil(t.year, t.month, t.day) * 86400 + t.hour * 3600 + t.minute * 60 -
                     (int64_t)t.offset_min * 60;
    if (t.second == 60) {
        if (!begins_month(minute + 60, t.year))
            return sv_fail(error, SV_EINVAL, NULL,
                           "has second 60, legal only at 23:59:60 UTC at the end of a month");
        *unix_s = nextafter((double)(minute + 60), -INFINITY);
        return SV_OK;
    }
    *unix_s = (double)(minute + t.second) + t.fraction;
    return SV_OK;
}
