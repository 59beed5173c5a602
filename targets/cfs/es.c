/* SPDX-License-Identifier: Apache-2.0 */
#include "targets/cfs/core.h"

#include <stdio.h>
#include <string.h>

#define END_MS 10000 /* the time in which an app's child tasks must end */

typedef struct Store {
    char name[CFE_MISSION_MAX_API_LEN + CFE_MISSION_ES_CDS_MAX_NAME_LENGTH];
    uint32 at;
    uint32 size;
    uint32 crc;
    bool used;
    bool written;
} Store;

static struct {
    Store stores[POCKET_STORES];
    uint8 bytes[POCKET_STORE_BYTES];
    uint32 n_bytes;
} es;

void pocket_es_start(void)
{
    memset(&es, 0, sizeof es);
}

/* ---- the interface of the host: pocket.h */

void pocket_boot(const char *root, const PocketApp *apps, uint32 n_apps)
{
    port_start(root);
    port_lock();
    memset(&pocket_core, 0, sizeof pocket_core);
    pocket_core.programs = apps;
    pocket_core.n_programs = n_apps;
    pocket_core.start_ns = port_now();
    pocket_core.tasks[0].used = true;
    pocket_core.apps[0].used = true;
    pocket_core.apps[0].ready = true;
    (void)pocket_name(pocket_core.apps[0].name, sizeof pocket_core.apps[0].name, "HOST");
    pocket_es_start();
    pocket_sb_start();
    pocket_tbl_start();
    pocket_osal_start();
    port_unlock();
}

void pocket_quiet(bool quiet)
{
    pocket_lock();
    pocket_core.quiet = quiet;
    pocket_unlock();
}

PocketCounts pocket_counts(void)
{
    pocket_lock();
    const PocketCounts counts = pocket_core.counts;
    pocket_unlock();
    return counts;
}

static void main_task(void)
{
    pocket_lock();
    void (*entry)(void) = pocket_core.apps[pocket_self_app_locked()].entry;
    pocket_unlock();
    entry();
    CFE_ES_ExitApp(CFE_ES_RunStatus_APP_ERROR); /* an app must not return */
}

static bool start_main_locked(uint32 index)
{
    App *app = &pocket_core.apps[index];
    const uint32 slot = pocket_task_start_locked(index, app->name, main_task, NULL, app->stack_size, app->priority);
    app->main_task = slot;
    return slot < POCKET_TASKS;
}

/* Find the entry point of an app: linked with the program, or in a file. */
static bool find(App *app)
{
    for (uint32 i = 0; i < pocket_core.n_programs; i++) {
        if (strcmp(pocket_core.programs[i].entry_name, app->entry_name) == 0) {
            app->entry = pocket_core.programs[i].entry;
            return true;
        }
    }
    app->code = port_load(app->file, app->entry_name, &app->entry);
    return app->code != NULL && app->entry != NULL;
}

bool pocket_program(const char *file, const char *entry_name)
{
    App probe = {.priority = 0};
    const bool loaded = pocket_name(probe.file, sizeof probe.file, file) &&
                        pocket_name(probe.entry_name, sizeof probe.entry_name, entry_name) && find(&probe);
    if (probe.code != NULL) {
        port_unload(probe.code);
    }
    return loaded;
}

CFE_Status_t pocket_start_app(const char *file, const char *entry_name, const char *name, uint32 priority,
                              size_t stack_size)
{
    CFE_Status_t status = CFE_ES_NO_RESOURCE_IDS_AVAILABLE;
    App fresh = {.priority = priority, .stack_size = stack_size};
    (void)pocket_name(fresh.file, sizeof fresh.file, file);
    if (!pocket_name(fresh.name, sizeof fresh.name, name)) {
        return CFE_ES_BAD_ARGUMENT;
    }
    if (!pocket_name(fresh.entry_name, sizeof fresh.entry_name, entry_name) || !find(&fresh)) {
        return CFE_ES_ERR_NAME_NOT_FOUND;
    }
    pocket_lock();
    for (uint32 i = 1; i < POCKET_APPS; i++) {
        App *app = &pocket_core.apps[i];
        if (app->used) {
            if (strncmp(app->name, name, sizeof app->name) == 0) {
                status = CFE_ES_ERR_APP_CREATE;
                break;
            }
            continue;
        }
        fresh.generation = app->generation;
        *app = fresh;
        app->used = true;
        status = CFE_SUCCESS;
        if (!start_main_locked(i)) {
            app->used = false;
            status = CFE_ES_ERR_APP_CREATE;
        }
        break;
    }
    pocket_unlock();
    return status;
}

/* How many apps run, or how many of them are not ready yet. */
static uint32 count_locked(bool unready)
{
    uint32 n = 0;
    for (uint32 i = 1; i < POCKET_APPS; i++) {
        const App *app = &pocket_core.apps[i];
        n += app->used && !(unready && app->ready) ? 1u : 0u;
    }
    return n;
}

bool pocket_operational(uint32 timeout_ms)
{
    pocket_lock();
    const int64 until = pocket_until((int64)timeout_ms);
    while (count_locked(true) > 0u && pocket_sleep_locked(pocket_core.apps, until)) {
    }
    const bool ready = count_locked(true) == 0u;
    if (ready) {
        pocket_core.operational = true;
        pocket_wake_locked(&pocket_core.operational);
    }
    pocket_unlock();
    return ready;
}

uint32 pocket_running(void)
{
    pocket_lock();
    const uint32 n = count_locked(false);
    pocket_unlock();
    return n;
}

/* Wake the main task of an app, so that it calls RunLoop, which returns this status. */
static void request_locked(App *app, uint32 status)
{
    app->requested = status;
    pocket_core.tasks[app->main_task].woken = true;
    port_unblock(app->main_task);
}

CFE_Status_t pocket_restart_app(const char *name)
{
    CFE_Status_t status = CFE_ES_ERR_NAME_NOT_FOUND;
    pocket_lock();
    for (uint32 i = 1; i < POCKET_APPS; i++) {
        App *app = &pocket_core.apps[i];
        if (app->used && strcmp(app->name, name) == 0) {
            app->restart = true;
            app->ready = false;
            request_locked(app, CFE_ES_RunStatus_SYS_RESTART);
            status = CFE_SUCCESS;
        }
    }
    pocket_unlock();
    return status;
}

bool pocket_stop(uint32 timeout_ms)
{
    pocket_lock();
    const int64 until = pocket_until((int64)timeout_ms);
    for (uint32 i = 1; i < POCKET_APPS; i++) {
        if (pocket_core.apps[i].used) {
            pocket_core.apps[i].restart = false;
            request_locked(&pocket_core.apps[i], CFE_ES_RunStatus_SYS_DELETE);
        }
    }
    while (count_locked(false) > 0u && pocket_sleep_locked(pocket_core.apps, until)) {
    }
    const bool stopped = count_locked(false) == 0u;
    pocket_unlock();
    return stopped;
}

/* ---- the interface of apps */

bool CFE_ES_RunLoop(uint32 *RunStatus)
{
    pocket_lock();
    App *app = &pocket_core.apps[pocket_self_app_locked()];
    if (!app->ready) {
        app->ready = true;
        pocket_wake_locked(pocket_core.apps);
    }
    if (app->requested != 0u && RunStatus != NULL && *RunStatus == CFE_ES_RunStatus_APP_RUN) {
        *RunStatus = app->requested;
    }
    const bool on = app->requested == 0u && (RunStatus == NULL || *RunStatus == CFE_ES_RunStatus_APP_RUN);
    pocket_unlock();
    return on;
}

void CFE_ES_WaitForStartupSync(uint32 TimeOutMilliseconds)
{
    pocket_lock();
    const int64 until = pocket_until((int64)TimeOutMilliseconds);
    App *app = &pocket_core.apps[pocket_self_app_locked()];
    app->ready = true;
    pocket_wake_locked(pocket_core.apps);
    while (!pocket_core.operational && app->requested == 0u && pocket_sleep_locked(&pocket_core.operational, until)) {
    }
    pocket_unlock();
}

static bool others_locked(uint32 app, uint32 self)
{
    for (uint32 i = 1; i < POCKET_TASKS; i++) {
        if (i != self && pocket_core.tasks[i].used && pocket_core.tasks[i].app == app) {
            return true;
        }
    }
    return false;
}

void CFE_ES_ExitApp(uint32 ExitStatus)
{
    const uint32 self = port_task_self();
    pocket_lock();
    const uint32 index = pocket_self_app_locked();
    App *app = &pocket_core.apps[index];
    if (index == 0u || self != app->main_task) {
        pocket_unlock();
        (void)CFE_ES_WriteToSysLog("CFE_ES_ExitApp: not called by an app's main task\n");
        return;
    }
    for (uint32 i = 1; i < POCKET_TASKS; i++) {
        if (i != self && pocket_core.tasks[i].app == index) {
            pocket_task_delete_locked(i);
        }
    }
    const int64 until = pocket_until(END_MS);
    while (others_locked(index, self) && pocket_sleep_locked(pocket_core.tasks, until)) {
    }
    const bool stuck = others_locked(index, self);
    pocket_unlock();
    (void)CFE_ES_WriteToSysLog("CFE_ES_ExitApp: %s ends with status %u%s\n", app->name, (unsigned)ExitStatus,
                               stuck ? "; a child task still runs" : "");
    pocket_lock();
    pocket_sb_app_ended_locked(index);
    pocket_tbl_app_ended_locked(index);
    pocket_osal_app_ended_locked(index);
    pocket_core.counts.apps_failed += ExitStatus == CFE_ES_RunStatus_APP_ERROR ? 1u : 0u;
    app->events = false;
    app->n_filters = 0;
    app->generation++;
    bool again = app->restart && !stuck;
    if (app->code != NULL && !stuck) {
        port_unload(app->code);
        again = again && find(app); /* its static data begin anew */
    }
    app->restart = false;
    app->restarted = again;
    app->requested = 0;
    if (!again || !start_main_locked(index)) {
        app->used = false;
    }
    pocket_wake_locked(pocket_core.apps);
    pocket_task_end_locked();
}

int32 CFE_ES_GetResetType(uint32 *ResetSubtypePtr)
{
    pocket_lock();
    const bool restarted = pocket_core.apps[pocket_self_app_locked()].restarted;
    pocket_unlock();
    if (ResetSubtypePtr != NULL) {
        *ResetSubtypePtr = CFE_PSP_RST_SUBTYPE_POWER_CYCLE;
    }
    return restarted ? CFE_ES_APP_RESTART : CFE_PSP_RST_TYPE_POWERON;
}

CFE_Status_t CFE_ES_GetAppID(CFE_ES_AppId_t *AppIdPtr)
{
    if (AppIdPtr == NULL) {
        return CFE_ES_BAD_ARGUMENT;
    }
    pocket_lock();
    const uint32 index = pocket_self_app_locked();
    AppIdPtr->id = make_id(KIND_APP, pocket_core.apps[index].generation, index);
    pocket_unlock();
    return CFE_SUCCESS;
}

CFE_Status_t CFE_ES_GetAppName(char *AppName, CFE_ES_AppId_t AppId, size_t BufferLength)
{
    CFE_Status_t status = CFE_ES_ERR_RESOURCEID_NOT_VALID;
    if (AppName == NULL || BufferLength == 0u) {
        return CFE_ES_BAD_ARGUMENT;
    }
    pocket_lock();
    const uint32 i = index_of(AppId.id, KIND_APP, POCKET_APPS);
    if (i < POCKET_APPS && pocket_core.apps[i].used &&
        make_id(KIND_APP, pocket_core.apps[i].generation, i) == AppId.id) {
        (void)pocket_name(AppName, BufferLength, pocket_core.apps[i].name);
        status = CFE_SUCCESS;
    }
    pocket_unlock();
    return status;
}

/* ---- child tasks */

CFE_Status_t CFE_ES_CreateChildTask(CFE_ES_TaskId_t *TaskIdPtr, const char *TaskName,
                                    CFE_ES_ChildTaskMainFuncPtr_t FunctionPtr, CFE_ES_StackPointer_t StackPtr,
                                    size_t StackSize, CFE_ES_TaskPriority_Atom_t Priority, uint32 Flags)
{
    (void)Flags;
    if (TaskIdPtr == NULL || TaskName == NULL || FunctionPtr == NULL || StackSize == 0u || Priority > 255u) {
        return CFE_ES_BAD_ARGUMENT;
    }
    pocket_lock();
    const uint32 app = pocket_self_app_locked();
    /* As in NASA's cFE, only the main task creates child tasks. */
    const bool main = app == 0u || pocket_core.apps[app].main_task == port_task_self();
    const uint32 slot =
        main ? pocket_task_start_locked(app, TaskName, FunctionPtr, StackPtr, StackSize, Priority) : POCKET_TASKS;
    TaskIdPtr->id = slot < POCKET_TASKS ? pocket_task_id_locked(slot) : 0u;
    pocket_unlock();
    return slot < POCKET_TASKS ? CFE_SUCCESS : CFE_ES_ERR_CHILD_TASK_CREATE;
}

void CFE_ES_ExitChildTask(void)
{
    OS_TaskExit();
}

CFE_Status_t CFE_ES_DeleteChildTask(CFE_ES_TaskId_t TaskId)
{
    CFE_Status_t status = CFE_SUCCESS;
    pocket_lock();
    const uint32 slot = pocket_task_of_locked(TaskId.id);
    if (slot == POCKET_TASKS || slot == 0u) {
        status = CFE_ES_ERR_RESOURCEID_NOT_VALID;
    } else if (pocket_core.apps[pocket_core.tasks[slot].app].main_task == slot) {
        status = CFE_ES_ERR_CHILD_TASK_DELETE_MAIN_TASK;
    } else {
        pocket_task_delete_locked(slot);
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_ES_GetTaskID(CFE_ES_TaskId_t *TaskIdPtr)
{
    if (TaskIdPtr == NULL) {
        return CFE_ES_BAD_ARGUMENT;
    }
    TaskIdPtr->id = OS_TaskGetId();
    return CFE_SUCCESS;
}

/* ---- system log and CRC */

CFE_Status_t CFE_ES_WriteToSysLog(const char *SpecStringPtr, ...)
{
    va_list list;
    if (SpecStringPtr == NULL) {
        return CFE_ES_BAD_ARGUMENT;
    }
    pocket_lock();
    const bool quiet = pocket_core.quiet;
    pocket_unlock();
    if (!quiet) {
        va_start(list, SpecStringPtr);
        pocket_print(SpecStringPtr, list);
        va_end(list);
    }
    return CFE_SUCCESS;
}

void CFE_ES_PerfLogAdd(uint32 Marker, uint32 EntryExit)
{
    (void)Marker;
    (void)EntryExit;
}

uint32 CFE_ES_CalculateCRC(const void *DataPtr, size_t DataLength, uint32 InputCRC, CFE_ES_CrcType_Enum_t TypeCRC)
{
    const uint8 *p = DataPtr;
    uint32 crc = InputCRC & 0xffffu;
    if (DataPtr == NULL || TypeCRC != CFE_ES_CrcType_CRC_16) {
        return 0;
    }
    for (size_t i = 0; i < DataLength; i++) {
        crc ^= p[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc & 1u) != 0u ? (crc >> 1) ^ 0xa001u : crc >> 1;
        }
    }
    return crc;
}

/* ---- critical data store: data that outlive an app */

CFE_Status_t CFE_ES_RegisterCDS(CFE_ES_CDSHandle_t *CDSHandlePtr, size_t BlockSize, const char *Name)
{
    CFE_Status_t status = CFE_ES_NO_RESOURCE_IDS_AVAILABLE;
    char short_name[CFE_MISSION_ES_CDS_MAX_NAME_LENGTH];
    Store wanted;
    if (CDSHandlePtr == NULL || Name == NULL) {
        return CFE_ES_BAD_ARGUMENT;
    }
    CDSHandlePtr->id = 0;
    if (!pocket_name(short_name, sizeof short_name, Name)) {
        return CFE_ES_CDS_INVALID_NAME;
    }
    if (BlockSize == 0u || BlockSize > POCKET_STORE_BYTES) {
        return CFE_ES_CDS_INVALID_SIZE;
    }
    pocket_lock();
    memset(&wanted, 0, sizeof wanted);
    (void)snprintf(wanted.name, sizeof wanted.name, "%s.%s", pocket_core.apps[pocket_self_app_locked()].name,
                   short_name);
    for (uint32 i = 0; i < POCKET_STORES; i++) {
        Store *store = &es.stores[i];
        if (store->used && strcmp(store->name, wanted.name) == 0) {
            status = store->size == BlockSize ? CFE_ES_CDS_ALREADY_EXISTS : CFE_ES_CDS_INVALID_SIZE;
        } else if (!store->used) {
            status = CFE_ES_CDS_INSUFFICIENT_MEMORY;
            if (BlockSize <= POCKET_STORE_BYTES - es.n_bytes) {
                wanted.used = true;
                wanted.at = es.n_bytes;
                wanted.size = (uint32)BlockSize;
                *store = wanted;
                es.n_bytes += (uint32)BlockSize;
                status = CFE_SUCCESS;
            }
        } else {
            continue;
        }
        if (status == CFE_SUCCESS || status == CFE_ES_CDS_ALREADY_EXISTS) {
            CDSHandlePtr->id = make_id(KIND_STORE, 0, i);
        }
        break;
    }
    pocket_unlock();
    return status;
}

static Store *store_of(CFE_ES_CDSHandle_t handle)
{
    const uint32 i = index_of(handle.id, KIND_STORE, POCKET_STORES);
    return i < POCKET_STORES && es.stores[i].used ? &es.stores[i] : NULL;
}

CFE_Status_t CFE_ES_CopyToCDS(CFE_ES_CDSHandle_t Handle, const void *DataToCopy)
{
    if (DataToCopy == NULL) {
        return CFE_ES_BAD_ARGUMENT;
    }
    pocket_lock();
    Store *store = store_of(Handle);
    if (store != NULL) {
        memcpy(es.bytes + store->at, DataToCopy, store->size);
        store->crc = CFE_ES_CalculateCRC(DataToCopy, store->size, 0, CFE_MISSION_ES_DEFAULT_CRC);
        store->written = true;
    }
    pocket_unlock();
    return store != NULL ? CFE_SUCCESS : CFE_ES_ERR_RESOURCEID_NOT_VALID;
}

CFE_Status_t CFE_ES_RestoreFromCDS(void *RestoreToMemory, CFE_ES_CDSHandle_t Handle)
{
    CFE_Status_t status = CFE_SUCCESS;
    if (RestoreToMemory == NULL) {
        return CFE_ES_BAD_ARGUMENT;
    }
    pocket_lock();
    const Store *store = store_of(Handle);
    if (store == NULL) {
        status = CFE_ES_ERR_RESOURCEID_NOT_VALID;
    } else if (!store->written ||
               CFE_ES_CalculateCRC(es.bytes + store->at, store->size, 0, CFE_MISSION_ES_DEFAULT_CRC) != store->crc) {
        status = CFE_ES_CDS_BLOCK_CRC_ERR;
    } else {
        memcpy(RestoreToMemory, es.bytes + store->at, store->size);
    }
    pocket_unlock();
    return status;
}
