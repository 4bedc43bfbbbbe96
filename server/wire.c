#include "server/wire.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

static size_t message_bytes(unsigned type)
{
    static const size_t sizes[] = {
#define X(name, struct_type, member) [name] = sizeof(struct_type),
        SV_WIRE_LIST(X)
#undef X
    };
    return type < SV_WIRE_TYPE_COUNT ? sizes[type] : 0;
}

void sv_wire_init(union sv_wire_message *message, enum sv_wire_type type, uint64_t id)
{
    memset(message, 0, sizeof *message);
    message->head = (struct sv_wire_head){.magic = SV_WIRE_MAGIC,
                                          .version = SV_WIRE_VERSION,
                                          .type = (uint16_t)type,
                                          .size = (uint32_t)message_bytes(type),
                                          .id = id};
}

union control {
    struct cmsghdr head;
    char bytes[CMSG_SPACE(sizeof(int))];
};

enum sv_status sv_wire_send(int fd, const union sv_wire_message *message, int passed_fd,
                            struct sv_error *error)
{
    union sv_wire_message copy = *message;
    struct iovec part = {.iov_base = &copy, .iov_len = message->head.size};
    union control control = {.bytes = {0}};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    if (passed_fd >= 0) {
        header.msg_control = control.bytes;
        header.msg_controllen = sizeof control.bytes;
        struct cmsghdr *c = CMSG_FIRSTHDR(&header);
        c->cmsg_level = SOL_SOCKET;
        c->cmsg_type = SCM_RIGHTS;
        c->cmsg_len = CMSG_LEN(sizeof(int));
        memcpy(CMSG_DATA(c), &passed_fd, sizeof passed_fd);
    }
    ssize_t sent;
    do {
        sent = sendmsg(fd, &header, MSG_NOSIGNAL);
    } while (sent < 0 && errno == EINTR);
    if (sent == (ssize_t)message->head.size)
        return SV_OK;
    if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
        return sv_fail(error, SV_ETIMEOUT, "wire", "the socket's buffer is full");
    return sv_fail(error, SV_EIO, "wire", "send failed: %s", sent < 0 ? strerror(errno) : "short message");
}

/* Takes the one descriptor we expect; more of them are closed. */
static int take_descriptor(struct msghdr *header)
{
    int taken = -1;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(header); c; c = CMSG_NXTHDR(header, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS)
            continue;
        size_t count = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
        for (size_t i = 0; i < count; i++) {
            int got;
            memcpy(&got, CMSG_DATA(c) + i * sizeof got, sizeof got);
            if (taken < 0)
                taken = got;
            else
                close(got);
        }
    }
    return taken;
}

static void terminate_error(struct sv_error *e)
{
    e->field[sizeof e->field - 1] = '\0';
    e->message[sizeof e->message - 1] = '\0';
}

static void terminate_texts(union sv_wire_message *message)
{
    if (message->head.type == SV_WIRE_REASON)
        terminate_error(&message->reason.error);
    if (message->head.type == SV_WIRE_RESOLVED)
        terminate_error(&message->resolved.error);
    if (message->head.type == SV_WIRE_DRAWN)
        terminate_error(&message->drawn.error);
    if (message->head.type == SV_WIRE_BUILT)
        terminate_error(&message->built.error);
    if (message->head.type == SV_WIRE_REFINED)
        terminate_error(&message->refined.error);
}

static enum sv_status check(const union sv_wire_message *message, ssize_t got, int flags,
                            struct sv_error *error)
{
    const struct sv_wire_head *h = &message->head;
    if ((flags & (MSG_TRUNC | MSG_CTRUNC)) || got < (ssize_t)sizeof *h)
        return sv_fail(error, SV_EFORMAT, "wire", "a message of %zd bytes is truncated", got);
    if (h->magic != SV_WIRE_MAGIC || h->version != SV_WIRE_VERSION)
        return sv_fail(error, SV_EFORMAT, "wire",
                       "magic %08x version %u, expected %08x and %d: programs of different builds?", h->magic,
                       h->version, SV_WIRE_MAGIC, SV_WIRE_VERSION);
    if (message_bytes(h->type) == 0 || h->size != message_bytes(h->type) || got != (ssize_t)h->size)
        return sv_fail(error, SV_EFORMAT, "wire",
                       "type %u has %zd bytes, expected %zu: programs of different builds?", h->type, got,
                       message_bytes(h->type));
    return SV_OK;
}

enum sv_status sv_wire_receive(int fd, union sv_wire_message *message, int *passed_fd, struct sv_error *error)
{
    struct iovec part = {.iov_base = message, .iov_len = sizeof *message};
    union control control;
    struct msghdr header = {.msg_iov = &part,
                            .msg_iovlen = 1,
                            .msg_control = control.bytes,
                            .msg_controllen = sizeof control.bytes};
    ssize_t got;
    do {
        got = recvmsg(fd, &header, MSG_CMSG_CLOEXEC);
    } while (got < 0 && errno == EINTR);
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
        return sv_fail(error, SV_ETIMEOUT, "wire", "nothing to receive");
    if (got == 0 || (got < 0 && errno == ECONNRESET))
        return sv_fail(error, SV_ENOENT, "wire", "the peer has closed");
    if (got < 0)
        return sv_fail(error, SV_EIO, "wire", "receive failed: %s", strerror(errno));
    int taken = take_descriptor(&header);
    enum sv_status status = check(message, got, header.msg_flags, error);
    if (status != SV_OK) {
        if (taken >= 0)
            close(taken);
        return status;
    }
    terminate_texts(message);
    *passed_fd = taken;
    return SV_OK;
}

enum sv_status sv_wire_status(uint32_t status)
{
    return status < SV_STATUS_COUNT ? (enum sv_status)status : SV_EINTERNAL;
}

int sv_wire_text_descriptor(const char *text, size_t bytes)
{
    int fd = memfd_create("silvista-text", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (fd < 0)
        return -1;
    for (size_t done = 0; done < bytes;) {
        ssize_t n = write(fd, text + done, bytes - done);
        if (n <= 0) {
            close(fd);
            return -1;
        }
        done += (size_t)n;
    }
    fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE);
    return fd;
}

char *sv_wire_read_text(int fd, uint64_t bytes, uint64_t most)
{
    char *text = bytes <= most ? malloc(bytes + 1) : NULL;
    if (!text || pread(fd, text, bytes, 0) != (ssize_t)bytes) {
        free(text);
        return NULL;
    }
    text[bytes] = '\0';
    return text;
}
