#include "server/scene/control.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/log.h"
#include "server/scene/worker.h"
#include "server/wire.h"

static void send_or_leave(int control_fd, const union sv_wire_message *message, int passed_fd)
{
    struct sv_error error;
    if (sv_wire_send(control_fd, message, passed_fd, &error) == SV_OK)
        return;
    sv_log(SV_LOG_ERROR, "control", "%s", error.message);
    _exit(1);
}

void sv_control_failed(int control_fd, enum sv_status status, const struct sv_errors *errors)
{
    union sv_wire_message message;
    for (size_t i = 0; i < errors->count; i++) {
        sv_wire_init(&message, SV_WIRE_REASON, 0);
        message.reason.error = errors->items[i];
        send_or_leave(control_fd, &message, -1);
    }
    sv_wire_init(&message, SV_WIRE_FAILED, 0);
    message.failed.status = (uint32_t)status;
    message.failed.total = (uint32_t)errors->total;
    send_or_leave(control_fd, &message, -1);
}

unsigned sv_control_threads(void)
{
    unsigned count = 0;
    DIR *tasks = opendir("/proc/self/task");
    const struct dirent *entry;
    while (tasks && (entry = readdir(tasks)))
        count += entry->d_name[0] != '.';
    if (tasks)
        closedir(tasks);
    return count;
}

/* The text in a sealed memfd; -1 with errno. */
static int text_descriptor(const char *text, size_t bytes)
{
    int fd = memfd_create("silvista-facts", MFD_CLOEXEC | MFD_ALLOW_SEALING);
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

static bool say_ready(int control_fd, struct sv_backend *backend, unsigned threads)
{
    union sv_wire_message message;
    struct sv_backend_facts facts;
    sv_backend_facts(backend, &facts);
    sv_wire_init(&message, SV_WIRE_READY, 0);
    message.ready.scene_version = facts.version;
    message.ready.facts_bytes = strlen(facts.document);
    message.ready.relief_distance_m = facts.relief_distance_m;
    message.ready.epsg = facts.epsg;
    unsigned now = sv_control_threads();
    message.ready.new_threads = now > threads ? now - threads : 0;
    int fd = text_descriptor(facts.document, message.ready.facts_bytes);
    if (fd < 0) {
        sv_log(SV_LOG_ERROR, "control", "facts: %s", strerror(errno));
        return false;
    }
    send_or_leave(control_fd, &message, fd);
    close(fd);
    return true;
}

/* Forks a worker that lives on the socket, and tells its pidfd: it is opened here, before anybody can reap
 * the child, so that it can mean no other process. */
static void fork_worker(struct sv_backend *backend, int control_fd, int signal_fd, uint64_t id, int socket)
{
    union sv_wire_message message;
    pid_t parent = getpid();
    pid_t pid = fork();
    if (pid == 0) {
        close(control_fd);
        close(signal_fd);
        sv_worker_live(backend, socket, parent);
    }
    int fork_error = errno;
    int pidfd = pid > 0 ? (int)syscall(SYS_pidfd_open, pid, 0) : -1;
    sv_wire_init(&message, SV_WIRE_FORKED, id);
    message.forked.pid = (int32_t)pid;
    message.forked.error_number = pid < 0 ? fork_error : pidfd < 0 ? errno : 0;
    if (pid > 0 && pidfd < 0)
        kill(pid, SIGKILL);
    send_or_leave(control_fd, &message, pidfd);
    if (pidfd >= 0)
        close(pidfd);
}

static void reap(int control_fd, int signal_fd)
{
    struct signalfd_siginfo info;
    union sv_wire_message message;
    int status;
    pid_t pid;
    while (read(signal_fd, &info, sizeof info) == (ssize_t)sizeof info)
        ;
    while ((pid = waitpid(-1, &status, WNOHANG)) > 0) {
        sv_wire_init(&message, SV_WIRE_EXITED, 0);
        message.exited.pid = (int32_t)pid;
        message.exited.wait_status = status;
        send_or_leave(control_fd, &message, -1);
    }
}

/* False when the daemon has closed. */
static bool take_order(struct sv_backend *backend, int control_fd, int signal_fd)
{
    union sv_wire_message message;
    struct sv_error error;
    int socket = -1;
    enum sv_status status = sv_wire_receive(control_fd, &message, &socket, &error);
    if (status == SV_ENOENT)
        return false;
    if (status == SV_OK && message.head.type == SV_WIRE_FORK && socket >= 0) {
        fork_worker(backend, control_fd, signal_fd, message.head.id, socket);
        close(socket);
        return true;
    }
    if (socket >= 0)
        close(socket);
    sv_log(SV_LOG_ERROR, "control", "%s", status == SV_OK ? "an order that is none" : error.message);
    return false;
}

int sv_control_serve(int control_fd, struct sv_backend *backend, unsigned threads)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGCHLD);
    sigprocmask(SIG_BLOCK, &set, NULL);
    int signal_fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    if (signal_fd < 0 || !say_ready(control_fd, backend, threads))
        return EXIT_FAILURE;
    struct pollfd polled[2] = {{.fd = control_fd, .events = POLLIN}, {.fd = signal_fd, .events = POLLIN}};
    for (;;) {
        if (poll(polled, 2, -1) < 0 && errno != EINTR)
            return EXIT_FAILURE;
        if (polled[1].revents)
            reap(control_fd, signal_fd);
        if (polled[0].revents && !take_order(backend, control_fd, signal_fd))
            return EXIT_SUCCESS;
    }
}
