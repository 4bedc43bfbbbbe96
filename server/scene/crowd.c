#include "server/scene/crowd.h"

#include <errno.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/log.h"

_Noreturn static void be_child(pid_t parent, void (*call)(void *context, int i), void *context, int i)
{
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != parent)
        _exit(1);
    call(context, i);
    _exit(0);
}

static void wait_one(void)
{
    int status;
    pid_t pid;
    do {
        pid = wait(&status);
    } while (pid < 0 && errno == EINTR);
    if (pid > 0 && !(WIFEXITED(status) && WEXITSTATUS(status) == 0))
        sv_log(SV_LOG_WARNING, "crowd", "child %d ended with wait status %d: its work is done again",
               (int)pid, status);
}

void sv_crowd_run(int count, int processes, void (*call)(void *context, int i), void *context)
{
    pid_t parent = getpid();
    int running = 0;
    if (count < 2 || processes < 2)
        return;
    for (int i = 0; i < count; i++) {
        if (running == processes) {
            wait_one();
            running--;
        }
        pid_t pid = fork();
        if (pid == 0)
            be_child(parent, call, context, i);
        if (pid < 0)
            sv_log(SV_LOG_WARNING, "crowd", "fork: %s", strerror(errno));
        else
            running++;
    }
    for (; running > 0; running--)
        wait_one();
}
