/* scenes.h - the scene processes: the one that serves, one that may be loading, and old ones that finish
 * their work.
 *
 * Each version of the scene is a process of its own (silvista-scene, by fork and exec) with its own crew of
 * workers. A load that succeeds takes the serving one's place, which is dismissed; one that fails leaves
 * everything as it is and says why. A patch makes the serving process fork its successor, which changes the
 * scene in its own memory and then takes the place; the patches are lost with a process that dies, since the
 * scene file does not have them. When the serving process dies, its workers die with it and it is started
 * again, at once and then with growing pauses. All children die with the daemon (PDEATHSIG); as the subreaper
 * it reaps what they leave behind. One thread. */
#ifndef SV_SERVER_SCENES_H
#define SV_SERVER_SCENES_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "server/cells_memory.h"
#include "server/daemon/settings.h"
#include "server/daemon/workers.h"

struct sv_scene_process {
    struct sv_scene_process *next;
    struct sv_scenes *all;
    pid_t pid; /* 0: not known yet (a successor, which the serving process forks) */
    int control_fd;
    struct sv_watch *watch;
    bool ready, failed, leaving;
    uint64_t version;
    int epsg;
    double relief_distance_m;
    char *facts; /* JSON text, heap */
    struct sv_cells_memory cells; /* panels that its workers share; the cache is NULL where there are none */
    uint64_t cells_generation;    /* that they had when it began to serve */
    double started_ms, load_ms;
    struct sv_errors reasons;
    struct sv_crew crew;
    /* Of one that follows another by a patch: */
    uint64_t patch;                 /* its number; 0: the scene was loaded */
    struct sv_scene_change *change; /* heap, when it is made; NULL: everything may be other than before */
    double patch_ms;
};

struct sv_scenes_events {
    /* A scene now serves (scenes->serving). */
    void (*serving)(void *context);
    /* A load or a patch failed; reasons (borrowed) are never empty. first: no scene has served yet, and the
     * file is to blame. */
    void (*failed)(void *context, const struct sv_errors *reasons, bool first);
    /* The serving process died; what its workers had in hand has been given back before. */
    void (*lost)(void *context);
};

struct sv_scenes {
    struct sv_loop *loop;
    struct sv_metrics *metrics;
    const struct sv_settings *settings;
    struct sv_scenes_events events; /* context as for the crew's */
    struct sv_crew_options crew;
    struct sv_scene_process *serving, *loading; /* NULL: none; both are in the list, too */
    struct sv_scene_process *processes;
    struct sv_timer restart;
    unsigned early_deaths;
    uint64_t patches; /* asked for so far */
    bool has_served, stopping;
    char program[SV_SETTING_TEXT_MAX];
    char last_failure[sizeof(struct sv_error)]; /* for /readyz; "" */
};

/* Finds the scene program (setting, or silvista-scene beside this program's file). SV_ENOENT names
 * scene_program. */
SV_MUST_CHECK enum sv_status sv_scenes_find_program(const struct sv_settings *settings,
                                                    char program[SV_SETTING_TEXT_MAX],
                                                    struct sv_error *error);

/* crew's size and marks come from the settings. Makes this process the subreaper. */
SV_MUST_CHECK enum sv_status sv_scenes_init(struct sv_scenes *scenes, struct sv_loop *loop,
                                            struct sv_metrics *metrics, const struct sv_settings *settings,
                                            const struct sv_scenes_events *events,
                                            const struct sv_crew_events *crew_events, void *context,
                                            struct sv_error *error);
/* Starts to load the scene file. SV_ELIMIT when a load is under way; SV_EIO. The outcome is an event. */
SV_MUST_CHECK enum sv_status sv_scenes_load(struct sv_scenes *scenes, struct sv_error *error);
/* Starts to make the serving scene's successor by a patch (the body of a request). SV_ELIMIT when a load or a
 * patch is under way; SV_ENOENT when no scene serves; SV_EIO. The outcome is an event. */
SV_MUST_CHECK enum sv_status sv_scenes_patch(struct sv_scenes *scenes, const char *body, size_t bytes,
                                             struct sv_error *error);
/* Reaps every child that has ended. To be called on SIGCHLD. */
void sv_scenes_reap(struct sv_scenes *scenes);
/* Kills the worker of whatever process that has this work. */
void sv_scenes_kill_work(struct sv_scenes *scenes, const void *work, const char *why);
/* Kills all processes and waits until they are gone. */
void sv_scenes_finish(struct sv_scenes *scenes);
/* The environment that a scene process needs: what keeps libraries from starting threads. Called in the
 * child. */
void sv_scenes_child_environment(void);

#endif
