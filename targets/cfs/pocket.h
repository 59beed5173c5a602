/* SPDX-License-Identifier: Apache-2.0 */
/* What a program does to host apps on the pocket cFE:
 *
 *     static const PocketApp apps[] = {{"NAV_AppMain", NAV_AppMain}};
 *
 *     pocket_boot(".", apps, 1);
 *     pocket_run_script("/cf/cfe_es_startup.scr");     or pocket_start_app(...), without files
 *     pocket_operational(10000);
 *     while (pocket_running()) { ... pocket_ingest(packet, n) ... }
 *     pocket_stop(1000);
 *
 * The thread that boots may use the bus, the tables and the semaphores like an app, as "HOST". */
#ifndef TARGETS_CFS_POCKET_H
#define TARGETS_CFS_POCKET_H

#include "cfe.h"

/** An app that is linked with the program. */
typedef struct PocketApp {
    const char *entry_name; ///< as start-up scripts know it
    void (*entry)(void);
} PocketApp;

/** What went wrong and what was refused, since the boot. */
typedef struct PocketCounts {
    uint32 sent;          ///< messages that reached a pipe
    uint32 no_subscriber; ///< messages without a subscriber
    uint32 overflow;      ///< not delivered: too many of one id wait in the pipe
    uint32 pipe_full;     ///< not delivered: the pipe is full
    uint32 no_buffer;     ///< not delivered: no room for the message
    uint32 bad_checksum;  ///< commands; delivered nevertheless, as by the real one
    uint32 short_command; ///< shorter than the header of a command; delivered nevertheless
    uint32 no_packet;     ///< what pocket_ingest refused
    uint32 events;        ///< that went out
    uint32 filtered;      ///< that did not
    uint32 errors;        ///< events of ERROR or CRITICAL, the pocket's own included
    uint32 table_commands;
    uint32 table_errors; ///< commands to the tables that were refused
    uint32 apps_failed;  ///< that ended with CFE_ES_RunStatus_APP_ERROR
} PocketCounts;

/** Once per program, or again after pocket_stop. */
void pocket_boot(const char *root, const PocketApp *apps, uint32 n_apps);
/** Start one app. */
CFE_Status_t pocket_start_app(const char *entry_name, const char *name, uint32 priority, size_t stack_size);
/** Start what a start-up script lists. The number of apps, or an error; what a line gets wrong goes
 *  to the console with its number, and then nothing is started. */
int32 pocket_run_script(const char *path);
/** Wait until every app has come to its first CFE_ES_RunLoop or CFE_ES_WaitForStartupSync, then let
 *  those go on. False: one has not, in that time. */
bool pocket_operational(uint32 timeout_ms);
/** How many apps run. */
uint32 pocket_running(void);
/** Ask an app to end and start anew: its next call of RunLoop returns that. */
CFE_Status_t pocket_restart_app(const char *name);
/** Ask all apps to end. False: one has not, in that time. */
bool pocket_stop(uint32 timeout_ms);

/** A packet from outside, as it came over a link. False: it is no packet, and was counted. */
bool pocket_ingest(const void *bytes, size_t n);
PocketCounts pocket_counts(void);
/** No lines on the console of events and of CFE_ES_WriteToSysLog. */
void pocket_quiet(bool quiet);

#endif
