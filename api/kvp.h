/* kvp.h - the keys and values of a query string (application/x-www-form-urlencoded as in the WHATWG URL
 * standard, section 5.1, but strict: what cannot be decoded is a fault, not a guess).
 *
 * Walks the bytes without allocating. Pairs are split at '&', key and value at the first '='; '+' is a blank,
 * %XX a byte. Empty pairs ("a=1&&b=2") are passed over. */
#ifndef SV_API_KVP_H
#define SV_API_KVP_H

#include <stdbool.h>
#include <stddef.h>

enum { SV_API_KVP_KEY_MAX = 63, SV_API_KVP_VALUE_MAX = 255, SV_API_KVP_PAIRS_MAX = 256 };

#define SV_API_KVP_FAULT_LIST(X)                                                   \
    X(SV_API_KVP_OK, "")                                                           \
    X(SV_API_KVP_ESCAPE, "has a % that is not followed by two hexadecimal digits") \
    X(SV_API_KVP_NUL, "has a NUL byte (%00) in it")                                \
    X(SV_API_KVP_UTF8, "is not UTF-8")                                             \
    X(SV_API_KVP_LONG, "is too long (keys have at most 63 bytes, values 255)")     \
    X(SV_API_KVP_NO_VALUE, "has no value (write key=value)")                       \
    X(SV_API_KVP_NO_KEY, "a value without a key")

enum sv_api_kvp_fault {
#define X(name, text) name,
    SV_API_KVP_FAULT_LIST(X)
#undef X
        SV_API_KVP_FAULT_COUNT
};

struct sv_api_kvp {
    const char *at, *end; /* borrows the query */
    int pairs;            /* pairs seen so far */
    /* The pair that sv_api_kvp_next found: */
    enum sv_api_kvp_fault fault;
    char key[SV_API_KVP_KEY_MAX + 1];     /* decoded; as it can be shown when it is at fault */
    char value[SV_API_KVP_VALUE_MAX + 1]; /* decoded; "" when at fault */
    size_t value_bytes;
    bool has_key; /* key is usable (the fault, if any, is the value's) */
};

/* query need not end in NUL and may hold any bytes; NULL is legal with 0 bytes. */
void sv_api_kvp_init(struct sv_api_kvp *kvp, const char *query, size_t bytes);
/* false at the end. */
bool sv_api_kvp_next(struct sv_api_kvp *kvp);
/* What is wrong, to follow the key in a sentence. */
const char *sv_api_kvp_fault_text(enum sv_api_kvp_fault fault);

#endif
