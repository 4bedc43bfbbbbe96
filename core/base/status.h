/* status.h - what a call that can fail returns.
 *
 * One X-macro list gives the enum, its names and the HTTP meaning that the wire contract derives from it.
 * Every function that can fail returns enum sv_status and is must-check; details go to struct sv_error (error.h). */
#ifndef SV_BASE_STATUS_H
#define SV_BASE_STATUS_H

#define SV_STATUS_LIST(X)                                                                                    \
    X(SV_OK, "ok")                                                                                           \
    X(SV_EINVAL, "invalid value")          /* caller's input is malformed or out of range */                 \
    X(SV_ENOENT, "not found")              /* a file, layer, key or id is not there */                       \
    X(SV_EFORMAT, "bad format")            /* a file is there, but is not what it should be */               \
    X(SV_ELIMIT, "limit exceeded")         /* legal, but over a stated size limit */                         \
    X(SV_EUNSUPPORTED, "not supported")    /* known, but not built yet or not possible here */               \
    X(SV_EUNDERGROUND, "eye under ground") /* the eye lies below the terrain */                              \
    X(SV_EOUTSIDE, "outside the scene")    /* a place that needs terrain where there is none */              \
    X(SV_EIO, "input/output error")                                                                          \
    X(SV_ENOMEM, "out of memory")                                                                            \
    X(SV_ETIMEOUT, "deadline passed")                                                                        \
    X(SV_EINTERNAL, "internal error") /* our own bug, or a library that failed for no reason it gives */

enum sv_status {
#define X(name, text) name,
    SV_STATUS_LIST(X)
#undef X
        SV_STATUS_COUNT
};

#define SV_MUST_CHECK __attribute__((warn_unused_result))
#define SV_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))

/* The status's text, never NULL; "unknown status" for a value that is none. */
const char *sv_status_text(enum sv_status status);

#endif
