/* SPDX-License-Identifier: Apache-2.0 */
/* For tests: the outside of an app's registers, called from Python. */
#include "registers/shared_file.h"
#include "targets/mission_io.h"

#define BOARDS 4
#define LATE 1
#define GONE 2

extern const MissionIo fledge_io; /* by -D, the mission's */

static RegisterFile file;
static RegisterWindow w[BOARDS];
static MissionIoCounts counts;

int outside_open(void);
void outside_put(uint32_t id, const void *message);
void outside_take(uint32_t id, void *message, int64_t t);
int outside_tick(int64_t t, int64_t dt, int64_t timeout_ns);
void outside_stop(void);
void outside_close(void);

/* The file's descriptor, or -1. */
int outside_open(void)
{
    return register_file_create(&file, NULL, fledge_io.boards, fledge_io.n_boards, w) == REGISTER_FILE_OK ? file.fd
                                                                                                          : -1;
}

void outside_put(uint32_t id, const void *message)
{
    mission_io_put(&fledge_io, w, id, message, &counts);
}

void outside_take(uint32_t id, void *message, int64_t t)
{
    mission_io_take(&fledge_io, w, id, message, t, &counts);
}

/* One exchange. */
int outside_tick(int64_t t, int64_t dt, int64_t timeout_ns)
{
    const RegisterWindow *clock = &w[mission_io_clock(&fledge_io)];
    const Tick tick = {t, dt};
    register_clock_start(clock, tick);
    while (!register_clock_is_done(clock)) {
        const RegisterFileStatus status = register_file_wait(&file, timeout_ns);
        if (status == REGISTER_FILE_TIMEOUT || status == REGISTER_FILE_GONE) {
            return status == REGISTER_FILE_TIMEOUT ? LATE : GONE;
        }
    }
    return 0;
}

void outside_stop(void)
{
    register_clock_stop(&w[mission_io_clock(&fledge_io)]);
}

void outside_close(void)
{
    register_file_close(&file);
}
