/* control.c - see control.h. Forms of trees that views ask for and that are not built yet are built by one
 * child at a time, of low priority, beside the workers: these tell by a pipe which form they lack, and take
 * from the store what is there by then. */
#include "server/scene/control.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "server/log.h"
#include "server/scene/hooks.h"
#include "server/scene/worker.h"
#include "server/wire.h"

/* The last slot is this process's own; a scene and its successor, who share the cache, take turns in the
 * halves of the rest. */
enum { BUILDER_NICE = 10, FORMS = 32, SLOTS = (SV_CELL_CACHE_SLOTS - 1) / 2 };

static unsigned half; /* of the slots; handed on by fork */

struct control {
    struct sv_backend *backend;
    int fd, signal_fd;
    int lacks[2];           /* pipe: forms that workers lack, a byte each */
    pid_t builder;          /* 0: none */
    pid_t slots[SLOTS];     /* workers that have a slot of the cells' cache; 0: nobody */
    uint32_t wanted, tried; /* forms to build; that a builder was started for: nothing is tried twice */
};

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

/* The document into a descriptor that is sent with the message; *bytes: its size. -1: logged. */
static int facts_descriptor(const struct sv_backend_facts *facts, uint64_t *bytes)
{
    *bytes = strlen(facts->document);
    int fd = sv_wire_text_descriptor(facts->document, *bytes);
    if (fd < 0)
        sv_log(SV_LOG_ERROR, "control", "facts: %s", strerror(errno));
    return fd;
}

/* Before READY, so that the daemon has it when views are drawn. */
static void say_cells(const struct control *c)
{
    union sv_wire_message message;
    const struct sv_cells_memory *cells = sv_backend_cells(c->backend);
    if (!cells->cache)
        return;
    sv_wire_init(&message, SV_WIRE_CELLS, 0);
    message.cells.bytes = cells->bytes;
    send_or_leave(c->fd, &message, cells->fd);
}

static bool say_ready(const struct control *c, unsigned threads)
{
    union sv_wire_message message;
    struct sv_backend_facts facts;
    sv_backend_facts(c->backend, &facts);
    sv_wire_init(&message, SV_WIRE_READY, 0);
    message.ready.scene_version = facts.version;
    message.ready.relief_distance_m = facts.relief_distance_m;
    message.ready.epsg = facts.epsg;
    unsigned now = sv_control_threads();
    message.ready.new_threads = now > threads ? now - threads : 0;
    int fd = facts_descriptor(&facts, &message.ready.facts_bytes);
    if (fd < 0)
        return false;
    say_cells(c);
    send_or_leave(c->fd, &message, fd);
    close(fd);
    return true;
}

static void say_facts(const struct control *c)
{
    union sv_wire_message message;
    struct sv_backend_facts facts;
    if (!sv_backend_renew_document(c->backend))
        return;
    sv_backend_facts(c->backend, &facts);
    sv_wire_init(&message, SV_WIRE_FACTS, 0);
    int fd = facts_descriptor(&facts, &message.facts.facts_bytes);
    if (fd < 0)
        return;
    send_or_leave(c->fd, &message, fd);
    close(fd);
}

/* Of whom (0: a free one); -1: there is none. */
static int find_slot(const struct control *c, pid_t pid)
{
    for (int slot = 0; slot < SLOTS; slot++)
        if (c->slots[slot] == pid)
            return slot;
    return -1;
}

/* The process is dead: what it held or was building is free. */
static void free_slot(struct control *c, pid_t pid)
{
    struct sv_cell_cache *cache = sv_backend_cells(c->backend)->cache;
    int slot = find_slot(c, pid);
    if (slot < 0)
        return;
    c->slots[slot] = 0;
    if (cache)
        sv_cell_cache_release(cache, half * SLOTS + (unsigned)slot);
}

/* Forks a worker that lives on the socket, and tells its pidfd: it is opened here, before anybody can reap
 * the child, so that it can mean no other process. */
static void fork_worker(struct control *c, uint64_t id, int socket)
{
    union sv_wire_message message;
    pid_t parent = getpid();
    int slot = find_slot(c, 0);
    struct sv_cell_cache *cache = sv_backend_cells(c->backend)->cache;
    if (cache && slot >= 0) /* the scene before the one before this had the same half */
        sv_cell_cache_release(cache, half * SLOTS + (unsigned)slot);
    pid_t pid = fork();
    if (pid == 0) {
        close(c->fd);
        close(c->signal_fd);
        close(c->lacks[0]);
        sv_backend_use_slot(c->backend, slot < 0 ? slot : (int)half * SLOTS + slot);
        sv_worker_live(c->backend, socket, c->lacks[1], parent);
    }
    if (pid > 0 && slot >= 0)
        c->slots[slot] = pid;
    int fork_error = errno;
    int pidfd = pid > 0 ? (int)syscall(SYS_pidfd_open, pid, 0) : -1;
    sv_wire_init(&message, SV_WIRE_FORKED, id);
    message.forked.pid = (int32_t)pid;
    message.forked.error_number = pid < 0 ? fork_error : pidfd < 0 ? errno : 0;
    if (pid > 0 && pidfd < 0)
        kill(pid, SIGKILL);
    send_or_leave(c->fd, &message, pidfd);
    if (pidfd >= 0)
        close(pidfd);
}

/* ---- building in the background ---- */

_Noreturn static void be_builder(const struct control *c, int form, pid_t parent)
{
    /* The parent may have died before prctl: then nobody will ever send the signal. */
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != parent)
        _exit(1);
    prctl(PR_SET_NAME, "silvista-build");
    close(c->fd);
    if (setpriority(PRIO_PROCESS, 0, BUILDER_NICE))
        sv_log(SV_LOG_WARNING, "build", "priority: %s", strerror(errno));
    sv_backend_build(c->backend, form);
    _exit(0);
}

static void start_builder(struct control *c)
{
    pid_t parent = getpid();
    int form = 0;
    if (c->builder || !c->wanted)
        return;
    while (!(c->wanted >> form & 1))
        form++;
    c->wanted &= ~(UINT32_C(1) << form);
    c->tried |= UINT32_C(1) << form;
    pid_t pid = fork();
    if (pid == 0)
        be_builder(c, form, parent);
    if (pid < 0)
        sv_log(SV_LOG_WARNING, "build", "fork: %s: workers build what they need", strerror(errno));
    else
        c->builder = pid;
}

static void hear_lacks(struct control *c)
{
    uint8_t forms[64];
    ssize_t count = read(c->lacks[0], forms, sizeof forms);
    for (ssize_t k = 0; k < count; k++)
        if (forms[k] < FORMS)
            c->wanted |= UINT32_C(1) << forms[k] & ~c->tried;
    start_builder(c);
}

/* ---- children and orders ---- */

static void reap(struct control *c)
{
    struct signalfd_siginfo info;
    union sv_wire_message message;
    int status;
    pid_t pid;
    while (read(c->signal_fd, &info, sizeof info) == (ssize_t)sizeof info)
        ;
    while ((pid = waitpid(-1, &status, WNOHANG)) > 0) {
        if (pid == c->builder) {
            c->builder = 0;
            say_facts(c);
            start_builder(c);
            continue;
        }
        free_slot(c, pid);
        sv_wire_init(&message, SV_WIRE_EXITED, 0);
        message.exited.pid = (int32_t)pid;
        message.exited.wait_status = status;
        send_or_leave(c->fd, &message, -1);
    }
}

/* ---- the successor ---- */

enum { PATCH_BYTES_MAX = 1 << 26 };

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Takes the patch and makes it. False after the daemon was told why not. */
static bool patch(struct sv_backend *backend, int control_fd)
{
    union sv_wire_message message;
    struct sv_errors errors;
    struct sv_error error;
    struct sv_scene_change change;
    int fd = -1;
    if (sv_wire_receive(control_fd, &message, &fd, &error) != SV_OK || fd < 0 ||
        message.head.type != SV_WIRE_PATCH_TEXT)
        return false; /* the daemon is gone */
    double start = now_ms();
    uint64_t bytes = message.text.bytes;
    char *text = sv_wire_read_text(fd, bytes, PATCH_BYTES_MAX);
    close(fd);
    sv_errors_init(&errors);
    enum sv_status status = SV_ENOMEM;
    if (text)
        status = sv_backend_patch(backend, text, bytes, &change, &errors);
    else
        sv_errors_add(&errors, status, "", "no memory to read the patch");
    if (status != SV_OK) {
        sv_control_failed(control_fd, status, &errors);
        return false;
    }
    free(text);
    sv_errors_finish(&errors);
    sv_hooks_after_patch();
    sv_wire_init(&message, SV_WIRE_PATCHED, 0);
    message.patched.ms = now_ms() - start;
    message.patched.change = change;
    send_or_leave(control_fd, &message, -1);
    return true;
}

/* middle: its parent at first, which ends at once, so that the daemon, as the subreaper, is its parent from
 * then on. */
_Noreturn static void be_successor(const struct control *c, int control_fd, pid_t middle, pid_t daemon)
{
    const struct timespec moment = {.tv_nsec = 100000};
    const int own[] = {c->fd, c->signal_fd, c->lacks[0], c->lacks[1]};
    for (size_t k = 0; k < sizeof own / sizeof own[0]; k++)
        close(own[k]);
    while (getppid() == middle)
        nanosleep(&moment, NULL);
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != daemon)
        _exit(1);
    unsigned threads = sv_control_threads();
    half = 1 - half;
    _exit(patch(c->backend, control_fd) ? sv_control_serve(control_fd, c->backend, threads) : EXIT_FAILURE);
}

/* Who was forked, or why nobody was. */
struct forked {
    pid_t pid;
    int error_number;
};

/* Forks the successor by a process in the middle. That one borrows this one's memory (vfork), as it only
 * forks and ends: tables of pages of hundreds of megabytes are copied once, not twice, and none are taken
 * down. While it is there this process stands still; what it wrote to `forked` is here afterwards. */
static pid_t fork_twice(const struct control *c, int socket, pid_t daemon, volatile struct forked *forked)
{
    pid_t first = vfork();
    if (first == 0) {
        pid_t middle = getpid(), pid = fork();
        if (pid == 0)
            be_successor(c, socket, middle, daemon);
        forked->error_number = pid < 0 ? errno : 0;
        forked->pid = pid;
        _exit(0);
    }
    return first;
}

/* Forks the process that serves the patched scene (copy on write); this one goes on as it is. */
static void fork_successor(const struct control *c, uint64_t id, int socket)
{
    union sv_wire_message message;
    volatile struct forked forked = {0, 0};
    pid_t middle = fork_twice(c, socket, getppid(), &forked);
    if (middle < 0)
        forked.error_number = errno;
    while (middle > 0 && waitpid(middle, NULL, 0) < 0 && errno == EINTR)
        ;
    sv_wire_init(&message, SV_WIRE_FOLLOWED, id);
    message.followed.pid = forked.pid > 0 ? (int32_t)forked.pid : 0;
    message.followed.error_number = forked.error_number;
    send_or_leave(c->fd, &message, -1);
}

/* False when the daemon has closed. */
static bool take_order(struct control *c)
{
    union sv_wire_message message;
    struct sv_error error;
    int socket = -1;
    enum sv_status status = sv_wire_receive(c->fd, &message, &socket, &error);
    if (status == SV_ENOENT)
        return false;
    bool fork_order = message.head.type == SV_WIRE_FORK, patch_order = message.head.type == SV_WIRE_PATCH;
    if (status == SV_OK && (fork_order || patch_order) && socket >= 0) {
        if (fork_order)
            fork_worker(c, message.head.id, socket);
        else
            fork_successor(c, message.head.id, socket);
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
    struct control c = {.backend = backend, .fd = control_fd};
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGCHLD);
    sigprocmask(SIG_BLOCK, &set, NULL);
    c.signal_fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    if (c.signal_fd < 0 || pipe2(c.lacks, O_CLOEXEC | O_NONBLOCK) || !say_ready(&c, threads))
        return EXIT_FAILURE;
    struct pollfd polled[3] = {{.fd = control_fd, .events = POLLIN},
                               {.fd = c.signal_fd, .events = POLLIN},
                               {.fd = c.lacks[0], .events = POLLIN}};
    for (;;) {
        if (poll(polled, 3, -1) < 0 && errno != EINTR)
            return EXIT_FAILURE;
        if (polled[2].revents)
            hear_lacks(&c);
        if (polled[1].revents)
            reap(&c);
        if (polled[0].revents && !take_order(&c))
            return EXIT_SUCCESS;
    }
}
