/* fuzz_main.h - what a fuzz driver gives, and the seeded main that runs it without libFuzzer.
 *
 * DRIVER [RUNS [SEED]] or DRIVER --replay FILE...: feeds files as they are, or makes RUNS inputs by the
 * driver's own recipe, breaks most of them, and feeds them to LLVMFuzzerTestOneInput, which ends the program
 * on a broken promise. For libFuzzer leave fuzz_main.c out and link with -fsanitize=fuzzer. */
#ifndef SV_TESTS_FUZZ_FUZZ_MAIN_H
#define SV_TESTS_FUZZ_FUZZ_MAIN_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/rng.h"

enum { FUZZ_INPUT_MAX = 8192 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The driver's part: a well-formed input; words that are worth inserting; a line about what was seen. */
size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX]);
extern const char *const fuzz_words[]; /* ends in NULL */
void fuzz_report(void);

#endif
