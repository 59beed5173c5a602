/* SPDX-License-Identifier: Apache-2.0 */
/* The interface of a program that hosts apps on the pocket cFE.
 *
 * The thread that calls pocket_boot may use the bus, the tables and the semaphores as an app does. Its name is "HOST".
 *
 * Example:
 *
 *     void NAV_AppMain(void);
 *     static const PocketApp apps[] = {{"NAV_AppMain", NAV_AppMain}};
 *
 *     static void host(const void *packet, size_t n)
 *     {
 *         pocket_boot(".", apps, 1);
 *         pocket_run_script("/cf/cfe_es_startup.scr"); // or, without files, pocket_start_app()
 *         pocket_operational(10000);
 *         while (pocket_running()) {
 *             pocket_ingest(packet, n);
 *         }
 *         pocket_stop(1000);
 *     }
 */
#ifndef TARGETS_CFS_POCKET_H
#define TARGETS_CFS_POCKET_H

#include "targets/cfs/inc/cfe.h"

/** An app that is linked with the program. A restart leaves its static data as they are. */
typedef struct PocketApp {
    const char *entry_name; ///< its name in start-up scripts
    void (*entry)(void);
} PocketApp;

/** Counters since the boot. */
typedef struct PocketCounts {
    uint32 sent;          ///< messages that at least one pipe took
    uint32 no_subscriber; ///< messages without a subscriber
    uint32 overflow;      ///< not delivered: too many of one id wait in the pipe
    uint32 pipe_full;     ///< not delivered: the pipe is full
    uint32 no_buffer;     ///< not delivered: no room for the message
    uint32 bad_checksum;  ///< commands; the bus delivers them, as NASA's does
    uint32 short_command; ///< commands shorter than their header; the bus delivers them
    uint32 no_packet;     ///< packets that pocket_ingest refused
    uint32 events;        ///< events sent
    uint32 filtered;      ///< events that a filter stopped
    uint32 errors;        ///< events of type ERROR or CRITICAL, those of the pocket included
    uint32 table_commands;
    uint32 table_errors; ///< commands that the table service refused
    uint32 apps_failed;  ///< apps that ended with CFE_ES_RunStatus_APP_ERROR
} PocketCounts;

/** Call it once, and again only after pocket_stop. `root` is the folder that holds cf and ram. */
void pocket_boot(const char *root, const PocketApp *apps, uint32 n_apps);
/** Start one app. file: its name below /cf without .so, if it is not linked with the program. */
CFE_Status_t pocket_start_app(const char *file, const char *entry_name, const char *name, uint32 priority,
                              size_t stack_size);
/** Start the apps of a start-up script. Returns their number, or an error: then the console names the wrong lines, and
 *  no app runs. */
int32 pocket_run_script(const char *path);
/** Wait until every app has called CFE_ES_RunLoop or CFE_ES_WaitForStartupSync, then let those that wait continue.
 *  False: timeout. */
bool pocket_operational(uint32 timeout_ms);
/** The number of running apps. */
uint32 pocket_running(void);
/** Restart an app: its next call of RunLoop returns false, and the pocket starts it again when it has ended. */
CFE_Status_t pocket_restart_app(const char *name);

/** Set the mission elapsed time. */
void pocket_set_met(uint32 seconds);
/** End all apps: their next call of RunLoop returns false. False: timeout. */
bool pocket_stop(uint32 timeout_ms);

/** Send a packet that the host received over a link. False: the bytes are not a packet (counted). */
bool pocket_ingest(const void *bytes, size_t n);
PocketCounts pocket_counts(void);
/** Whether to print no events and no lines of CFE_ES_WriteToSysLog on the console. */
void pocket_quiet(bool quiet);

#endif
