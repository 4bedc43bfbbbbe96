/* crowd.h - work done side by side in forked children before there are workers: what they make stays in the
 * store. */
#ifndef SV_SERVER_CROWD_H
#define SV_SERVER_CROWD_H

/* Calls call(context, i) for i in [0, count) in children of their own, at most `processes` at a time, and
 * waits for all. A child that dies costs time only: whoever needs its result makes it again. Children die
 * with this process and leave by _exit. Nothing is forked for processes < 2 or count < 2: then nothing is
 * called at all. */
void sv_crowd_run(int count, int processes, void (*call)(void *context, int i), void *context);

#endif
