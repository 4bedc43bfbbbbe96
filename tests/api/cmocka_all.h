/* cmocka_all.h - cmocka and what it needs before it. */
#ifndef SV_TESTS_API_CMOCKA_ALL_H
#define SV_TESTS_API_CMOCKA_ALL_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#endif
