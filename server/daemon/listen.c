#include "server/daemon/listen.h"

#include <errno.h>
#include <stdbool.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { BACKLOG = 511 };

static enum sv_status split(const char *text, char host[256], char port[8], struct sv_error *error)
{
    const char *colon = strrchr(text, ':');
    char *end;
    if (!colon || !colon[1] || strlen(colon + 1) > 5 ||
        strspn(colon + 1, "0123456789") != strlen(colon + 1) || strtol(colon + 1, &end, 10) > 65535)
        return sv_fail(error, SV_EINVAL, "listen",
                       "\"%.200s\": expected ADDRESS:PORT with a port from 0 to 65535", text);
    size_t bytes = (size_t)(colon - text);
    bool bracketed = bytes >= 2 && text[0] == '[' && colon[-1] == ']';
    if (!bracketed && memchr(text, ':', bytes))
        return sv_fail(error, SV_EINVAL, "listen", "\"%.200s\": write an IPv6 address as [ADDRESS]:PORT",
                       text);
    snprintf(host, 256, "%.*s", (int)(bracketed ? bytes - 2 : bytes), bracketed ? text + 1 : text);
    snprintf(port, 8, "%s", colon + 1);
    return SV_OK;
}

/* A bound, listening socket, or -1 with errno. */
static int open_at(const struct addrinfo *at)
{
    int on = 1, off = 0;
    int fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return -1;
    if (at->ai_family == AF_INET6)
        setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
    if (setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
        bind(fd, at->ai_addr, at->ai_addrlen) == 0 && listen(fd, BACKLOG) == 0)
        return fd;
    int saved = errno;
    close(fd);
    errno = saved;
    return -1;
}

static unsigned port_of(int fd)
{
    struct sockaddr_storage address;
    socklen_t bytes = sizeof address;
    if (getsockname(fd, (struct sockaddr *)&address, &bytes))
        return 0;
    if (address.ss_family == AF_INET6)
        return ntohs(((struct sockaddr_in6 *)&address)->sin6_port);
    return ntohs(((struct sockaddr_in *)&address)->sin_port);
}

static int open_first(const char *host, const char *port, int *lookup)
{
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV},
                    *found = NULL;
    *lookup = getaddrinfo(host, port, &hints, &found);
    int fd = -1;
    for (struct addrinfo *at = *lookup ? NULL : found; at && fd < 0; at = at->ai_next)
        fd = open_at(at);
    int saved = errno;
    if (!*lookup)
        freeaddrinfo(found);
    errno = saved;
    return fd;
}

enum sv_status sv_listen(const char *text, int *fd, unsigned *port, struct sv_error *error)
{
    char host[256], service[8];
    enum sv_status status = split(text, host, service, error);
    if (status != SV_OK)
        return status;
    int lookup = 0, opened = open_first(host[0] ? host : "::", service, &lookup);
    if (opened < 0 && !host[0]) /* a machine without IPv6 */
        opened = open_first("0.0.0.0", service, &lookup);
    if (opened < 0)
        return sv_fail(error, SV_EIO, "listen", "\"%.200s\": %s", text,
                       lookup ? gai_strerror(lookup) : strerror(errno));
    *fd = opened;
    *port = port_of(opened);
    return SV_OK;
}
