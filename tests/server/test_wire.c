/* test_wire.c - messages arrive whole with their descriptor; what is not one is refused and leaks nothing. */
#include "server/wire.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

static int open_pair(void **state)
{
    static int pair[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, pair), 0);
    *state = pair;
    return 0;
}

static int close_pair(void **state)
{
    int *pair = *state;
    close(pair[0]);
    close(pair[1]);
    return 0;
}

static void every_type_arrives_as_it_was_sent(void **state)
{
    int *pair = *state, fd;
    for (unsigned type = 0; type < SV_WIRE_TYPE_COUNT; type++) {
        union sv_wire_message sent, got;
        sv_wire_init(&sent, (enum sv_wire_type)type, 7 + type);
        /* Every byte behind the head but the texts' last ones, which must stay NUL. */
        if (type != SV_WIRE_REASON && type != SV_WIRE_RESOLVED && type != SV_WIRE_DRAWN &&
            type != SV_WIRE_BUILT && type != SV_WIRE_REFINED)
            memset((char *)&sent + sizeof sent.head, 0x5A, sent.head.size - sizeof sent.head);
        assert_int_equal(sv_wire_send(pair[0], &sent, -1, NULL), SV_OK);
        assert_int_equal(sv_wire_receive(pair[1], &got, &fd, NULL), SV_OK);
        assert_int_equal(fd, -1);
        assert_memory_equal(&sent, &got, sent.head.size);
    }
}

static void a_descriptor_comes_along_closed_on_exec(void **state)
{
    int *pair = *state, fd = -1;
    union sv_wire_message message;
    char text[6] = "";
    int file = memfd_create("x", 0);
    assert_int_equal(write(file, "hello", 5), 5);
    sv_wire_init(&message, SV_WIRE_VIEW, 1);
    assert_int_equal(sv_wire_send(pair[0], &message, file, NULL), SV_OK);
    close(file);
    assert_int_equal(sv_wire_receive(pair[1], &message, &fd, NULL), SV_OK);
    assert_int_equal(pread(fd, text, 5, 0), 5);
    assert_string_equal(text, "hello");
    assert_true(fcntl(fd, F_GETFD) & FD_CLOEXEC);
    close(fd);
}

static void nothing_and_the_end_are_told_apart(void **state)
{
    int *pair = *state, fd;
    union sv_wire_message message;
    assert_int_equal(sv_wire_receive(pair[1], &message, &fd, NULL), SV_ETIMEOUT);
    shutdown(pair[0], SHUT_RDWR);
    assert_int_equal(sv_wire_receive(pair[1], &message, &fd, NULL), SV_ENOENT);
    sv_wire_init(&message, SV_WIRE_FORK, 1);
    assert_int_equal(sv_wire_send(pair[1], &message, -1, NULL), SV_EIO); /* and no SIGPIPE */
}

static void a_full_socket_says_so(void **state)
{
    int *pair = *state;
    union sv_wire_message message;
    enum sv_status status = SV_OK;
    sv_wire_init(&message, SV_WIRE_DRAWN, 1);
    for (int i = 0; i < 100000 && status == SV_OK; i++)
        status = sv_wire_send(pair[0], &message, -1, NULL);
    assert_int_equal(status, SV_ETIMEOUT);
}

static int count_descriptors(void)
{
    int count = 0;
    for (int fd = 0; fd < 256; fd++)
        count += fcntl(fd, F_GETFD) >= 0;
    return count;
}

/* Sends n bytes of the message with a descriptor, past sv_wire_send. */
static void send_bytes(int fd, const void *bytes, size_t n, int passed)
{
    char control[CMSG_SPACE(sizeof(int))] = {0};
    struct iovec part = {.iov_base = (void *)(uintptr_t)bytes, .iov_len = n};
    struct msghdr header = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    struct cmsghdr *c = CMSG_FIRSTHDR(&header);
    *c = (struct cmsghdr){
        .cmsg_len = CMSG_LEN(sizeof(int)), .cmsg_level = SOL_SOCKET, .cmsg_type = SCM_RIGHTS};
    memcpy(CMSG_DATA(c), &passed, sizeof passed);
    assert_int_equal(sendmsg(fd, &header, 0), n);
}

static void what_is_no_message_is_refused_and_its_descriptor_closed(void **state)
{
    int *pair = *state, fd = -1;
    union sv_wire_message good, bad, got;
    struct sv_error error;
    sv_wire_init(&good, SV_WIRE_VIEW, 1);
    int before = count_descriptors();
    for (int fault = 0; fault < 7; fault++) {
        char large[sizeof bad + 64];
        size_t n = good.head.size;
        bad = good;
        bad.head.magic ^= fault == 0;
        bad.head.version += fault == 1;
        bad.head.type = fault == 2 ? 999 : bad.head.type;
        bad.head.size -= fault == 3;
        n = fault == 4 ? n - 1 : fault == 5 ? 3 : fault == 6 ? sizeof large : n;
        memset(large, 0, sizeof large);
        memcpy(large, &bad, sizeof bad);
        send_bytes(pair[0], large, n, STDERR_FILENO);
        assert_int_equal(sv_wire_receive(pair[1], &got, &fd, &error), SV_EFORMAT);
        assert_int_equal(fd, -1);
        assert_int_equal(count_descriptors(), before);
    }
}

static void texts_are_terminated(void **state)
{
    int *pair = *state, fd;
    union sv_wire_message message;
    sv_wire_init(&message, SV_WIRE_REASON, 1);
    memset(&message.reason.error, 'x', sizeof message.reason.error);
    assert_int_equal(sv_wire_send(pair[0], &message, -1, NULL), SV_OK);
    assert_int_equal(sv_wire_receive(pair[1], &message, &fd, NULL), SV_OK);
    assert_int_equal(strlen(message.reason.error.field), sizeof message.reason.error.field - 1);
    assert_int_equal(strlen(message.reason.error.message), sizeof message.reason.error.message - 1);
}

static void a_foreign_status_is_made_legal(void **state)
{
    (void)state;
    assert_int_equal(sv_wire_status(SV_EOUTSIDE), SV_EOUTSIDE);
    assert_int_equal(sv_wire_status(SV_STATUS_COUNT), SV_EINTERNAL);
    assert_int_equal(sv_wire_status(UINT32_MAX), SV_EINTERNAL);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, open_pair, close_pair)
    const struct CMUnitTest tests[] = {
        TEST(every_type_arrives_as_it_was_sent),
        TEST(a_descriptor_comes_along_closed_on_exec),
        TEST(nothing_and_the_end_are_told_apart),
        TEST(a_full_socket_says_so),
        TEST(what_is_no_message_is_refused_and_its_descriptor_closed),
        TEST(texts_are_terminated),
        cmocka_unit_test(a_foreign_status_is_made_legal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
