/* number.h - numbers as text on the wire: decimal, strict, the same in every locale. */
#ifndef SV_API_NUMBER_H
#define SV_API_NUMBER_H

#include <stdbool.h>
#include <stddef.h>

enum { SV_API_NUMBER_TEXT_MAX = 63, SV_API_NUMBER_BUFFER = 32 };

/* Reads all n bytes as a decimal number: an optional minus, digits with at most one point among or around
 * them, an optional exponent ("-12.5", ".5", "010", "1e3"). No plus sign, blank, hexadecimal, inf or nan; at
 * most SV_API_NUMBER_TEXT_MAX bytes. The nearest double is written, +-infinity when it is too large, 0 for
 * -0. */
bool sv_api_number_parse(const char *text, size_t n, double *value);

/* The shortest text of at least 15 digits' precision that reads back as value ("0.1", "500120", "1e+30");
 * finite values only. Returns out. */
const char *sv_api_number_format(double value, char out[SV_API_NUMBER_BUFFER]);

/* The degrees that were read as these radians (sv_radians): the decimal of fewest digits that gives the same
 * radians again, so that 30 deg goes out as 30 and not as 29.999999999999996. Not finite stays as it is. */
double sv_api_degrees(double radians);

#endif
