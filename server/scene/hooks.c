#include "server/scene/hooks.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const char *hook_folder;
static const struct timespec look_again = {.tv_nsec = 2000000};

void sv_hooks_init(const char *folder)
{
    const char *on = getenv("SILVISTA_TEST_HOOKS");
    hook_folder = on && strcmp(on, "1") == 0 && folder && folder[0] ? folder : NULL;
}

static void path_of(const char *name, char path[1200])
{
    snprintf(path, 1200, "%s/%s", hook_folder, name);
}

static bool is_listed(const char *name, int width, int band)
{
    char path[1200], word[32];
    bool listed = false;
    path_of(name, path);
    FILE *file = fopen(path, "re");
    while (file && !listed && fscanf(file, "%31s", word) == 1)
    {
        const char *slash = strchr(word, '/');
        listed = strcmp(word, "all") == 0 || (atoi(word) == width && (!slash || atoi(slash + 1) == band));
    }
    if (file)
        fclose(file);
    return listed;
}

void sv_hooks_before_load(void)
{
    char path[1200];
    if (!hook_folder)
        return;
    path_of("hold-load", path);
    while (access(path, F_OK) == 0)
        nanosleep(&look_again, NULL);
}

static void tell_held(bool held)
{
    char path[1200], name[32];
    snprintf(name, sizeof name, "held-%d", (int)getpid());
    path_of(name, path);
    int fd = held ? open(path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600) : unlink(path);
    if (held && fd >= 0)
        close(fd);
}

void sv_hooks_before_draw(int width, int band)
{
    if (!hook_folder)
        return;
    if (is_listed("crash", width, band))
        raise(SIGKILL);
    if (!is_listed("hold", width, band))
        return;
    tell_held(true);
    while (is_listed("hold", width, band))
        nanosleep(&look_again, NULL);
    tell_held(false);
}

void sv_hooks_before_encode(int width, int band)
{
    char path[1200];
    if (!hook_folder || !is_listed("crash-encode", width, band))
        return;
    path_of("crash-encode", path);
    unlink(path);
    raise(SIGKILL);
}

void sv_hooks_after_patch(void)
{
    char path[1200];
    if (!hook_folder)
        return;
    path_of("crash-patch", path);
    if (access(path, F_OK) == 0)
        raise(SIGKILL);
}

bool sv_hooks_refining_held(void)
{
    char path[1200];
    if (!hook_folder)
        return false;
    path_of("hold-refine", path);
    bool held = access(path, F_OK) == 0;
    tell_held(held);
    if (held)
        nanosleep(&look_again, NULL);
    return held;
}
