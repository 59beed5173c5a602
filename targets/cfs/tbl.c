/* SPDX-License-Identifier: Apache-2.0 */
/* Tables. A load first goes into a buffer. After validation, the table's owner copies it into the table: at once with
 * CFE_TBL_Load, or in its next CFE_TBL_Manage with commands.
 *
 * A file has 64 bytes of cFE's header and 52 bytes of the table's header, both big-endian. Then follow bytes of the
 * table as in memory, beginning at the offset that the header states. */
#include "targets/cfs/core.h"

#include <stdio.h>
#include <string.h>

#define NONE UINT32_MAX
#define FILE_HEADER 64
#define TABLE_HEADER 52
#define CONTENT 0x63464531u /* "cFE1" */
#define TABLE_IMAGE 8u

enum {
    LOADED_EVENT = 12,
    VALID_EVENT = 13,
    UPDATED_EVENT = 14,
    NOOP_EVENT = 10,
    REFUSED_EVENT = 50,
    INVALID_EVENT = 51
};

typedef struct Table {
    char name[CFE_MISSION_TBL_MAX_FULL_NAME_LEN];
    uint32 app;
    uint32 at;   ///< in the pool of bytes
    uint32 room; ///< [bytes] that it has there
    uint32 size;
    uint32 locks;
    uint32 load; ///< the buffer of its load, or NONE
    CFE_TBL_CallbackFuncPtr_t validate;
    bool used;
    bool loaded;
    bool updated; ///< since the last CFE_TBL_GetAddress
    bool busy;    ///< its owner validates it, or a load is in progress
    bool good;    ///< the load passed validation
    bool validate_pending;
    bool active; ///< 1: validate the table itself, not its load
    bool update_pending;
} Table;

typedef union Bytes {
    uint8 bytes[POCKET_TABLE_MAX];
    long double align;
    long long int align_int;
} Bytes;

static struct {
    Table tables[POCKET_TABLES];
    union {
        uint8 bytes[POCKET_TABLE_BYTES];
        long double align;
    } pool;
    uint32 n_bytes;
    Bytes loads[POCKET_LOADS];
    bool loading[POCKET_LOADS];
} tbl;

void pocket_tbl_start(void)
{
    memset(&tbl, 0, sizeof tbl);
}

static Table *table_of_locked(CFE_TBL_Handle_t handle)
{
    if (handle < 0 || (uint32)handle >= POCKET_TABLES || !tbl.tables[handle].used ||
        tbl.tables[handle].app != pocket_self_app_locked()) {
        return NULL;
    }
    return &tbl.tables[handle];
}

static Table *table_named_locked(const char *name)
{
    for (uint32 i = 0; i < POCKET_TABLES; i++) {
        if (tbl.tables[i].used && strncmp(tbl.tables[i].name, name, sizeof tbl.tables[i].name) == 0) {
            return &tbl.tables[i];
        }
    }
    return NULL;
}

/* ---- registering */

/* A free entry that has enough bytes already, or a new one with bytes of its own. */
static Table *place_locked(uint32 size)
{
    Table *empty = NULL;
    for (uint32 i = 0; i < POCKET_TABLES; i++) {
        Table *table = &tbl.tables[i];
        if (!table->used && table->room >= size) {
            return table;
        }
        if (!table->used && table->room == 0u && empty == NULL) {
            empty = table;
        }
    }
    const uint32 room = (size + 15u) & ~15u;
    if (empty == NULL || room > POCKET_TABLE_BYTES - tbl.n_bytes) {
        return NULL;
    }
    empty->at = tbl.n_bytes;
    empty->room = room;
    tbl.n_bytes += room;
    return empty;
}

CFE_Status_t CFE_TBL_Register(CFE_TBL_Handle_t *TblHandlePtr, const char *Name, size_t Size, uint16 TblOptionFlags,
                              CFE_TBL_CallbackFuncPtr_t TblValidationFuncPtr)
{
    char name[CFE_MISSION_TBL_MAX_FULL_NAME_LEN];
    char short_name[CFE_MISSION_TBL_MAX_NAME_LENGTH];
    CFE_Status_t status = CFE_SUCCESS;
    if (TblHandlePtr == NULL || Name == NULL) {
        return CFE_TBL_BAD_ARGUMENT;
    }
    *TblHandlePtr = CFE_TBL_BAD_TABLE_HANDLE;
    if (!pocket_name(short_name, sizeof short_name, Name)) {
        return CFE_TBL_ERR_INVALID_NAME;
    }
    if (Size == 0u || Size > POCKET_TABLE_MAX) {
        return CFE_TBL_ERR_INVALID_SIZE;
    }
    if ((TblOptionFlags & ~CFE_TBL_OPT_DBL_BUFFER) != 0) {
        return CFE_TBL_ERR_INVALID_OPTIONS; /* dump only, critical, and user-defined addresses */
    }
    pocket_lock();
    const uint32 app = pocket_self_app_locked();
    (void)snprintf(name, sizeof name, "%s.%s", pocket_core.apps[app].name, short_name);
    Table *table = table_named_locked(name);
    if (table != NULL) {
        status = table->size == Size ? CFE_TBL_WARN_DUPLICATE : CFE_TBL_ERR_DUPLICATE_DIFF_SIZE;
    } else {
        table = place_locked((uint32)Size);
        if (table == NULL) {
            status = CFE_TBL_ERR_REGISTRY_FULL;
        } else {
            const Table fresh = {.app = app,
                                 .at = table->at,
                                 .room = table->room,
                                 .size = (uint32)Size,
                                 .load = NONE,
                                 .validate = TblValidationFuncPtr,
                                 .used = true};
            *table = fresh;
            memcpy(table->name, name, sizeof name);
            memset(tbl.pool.bytes + table->at, 0, Size);
        }
    }
    if (status == CFE_SUCCESS || status == CFE_TBL_WARN_DUPLICATE) {
        *TblHandlePtr = (CFE_TBL_Handle_t)(table - tbl.tables);
    }
    pocket_unlock();
    return status;
}

static void drop_load_locked(Table *table)
{
    if (table->load != NONE) {
        tbl.loading[table->load] = false;
        table->load = NONE;
    }
    table->good = table->validate_pending = table->update_pending = false;
}

static void forget_locked(Table *table)
{
    drop_load_locked(table);
    table->used = false;
}

CFE_Status_t CFE_TBL_Unregister(CFE_TBL_Handle_t TblHandle)
{
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    if (table != NULL) {
        forget_locked(table);
    }
    pocket_unlock();
    return table != NULL ? CFE_SUCCESS : CFE_TBL_ERR_INVALID_HANDLE;
}

void pocket_tbl_app_ended_locked(uint32 app)
{
    for (uint32 i = 0; i < POCKET_TABLES; i++) {
        if (tbl.tables[i].used && tbl.tables[i].app == app) {
            forget_locked(&tbl.tables[i]);
        }
    }
}

/* ---- using */

CFE_Status_t CFE_TBL_GetAddress(void **TblPtr, CFE_TBL_Handle_t TblHandle)
{
    CFE_Status_t status = CFE_SUCCESS;
    if (TblPtr == NULL) {
        return CFE_TBL_BAD_ARGUMENT;
    }
    *TblPtr = NULL;
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    if (table == NULL) {
        status = CFE_TBL_ERR_INVALID_HANDLE;
    } else {
        *TblPtr = tbl.pool.bytes + table->at;
        table->locks++;
        status = !table->loaded ? CFE_TBL_ERR_NEVER_LOADED : table->updated ? CFE_TBL_INFO_UPDATED : CFE_SUCCESS;
        table->updated = false;
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_TBL_ReleaseAddress(CFE_TBL_Handle_t TblHandle)
{
    CFE_Status_t status = CFE_TBL_ERR_INVALID_HANDLE;
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    if (table != NULL) {
        table->locks -= table->locks > 0u ? 1u : 0u;
        status = !table->loaded ? CFE_TBL_ERR_NEVER_LOADED : CFE_SUCCESS;
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_TBL_Modified(CFE_TBL_Handle_t TblHandle)
{
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    if (table != NULL) {
        table->updated = true;
    }
    pocket_unlock();
    return table != NULL ? CFE_SUCCESS : CFE_TBL_ERR_INVALID_HANDLE;
}

CFE_Status_t CFE_TBL_GetStatus(CFE_TBL_Handle_t TblHandle)
{
    CFE_Status_t status = CFE_TBL_ERR_INVALID_HANDLE;
    pocket_lock();
    const Table *table = table_of_locked(TblHandle);
    if (table != NULL) {
        status = table->validate_pending ? CFE_TBL_INFO_VALIDATION_PENDING
                 : table->update_pending ? CFE_TBL_INFO_UPDATE_PENDING
                                         : CFE_SUCCESS;
    }
    pocket_unlock();
    return status;
}

CFE_Status_t CFE_TBL_Validate(CFE_TBL_Handle_t TblHandle)
{
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    if (table == NULL || !table->validate_pending) {
        pocket_unlock();
        return table == NULL ? CFE_TBL_ERR_INVALID_HANDLE : CFE_TBL_INFO_NO_VALIDATION_PENDING;
    }
    table->validate_pending = false;
    table->busy = true;
    const bool active = table->active;
    void *bytes = active ? tbl.pool.bytes + table->at : tbl.loads[table->load].bytes;
    pocket_unlock();
    const int32 verdict = table->validate != NULL ? table->validate(bytes) : CFE_SUCCESS;
    pocket_lock();
    table->busy = false;
    table->good = active ? table->good : verdict == CFE_SUCCESS;
    pocket_unlock();
    const char *part = active ? "table" : "load";
    if (verdict == CFE_SUCCESS) {
        pocket_event("CFE_TBL", VALID_EVENT, CFE_EVS_EventType_INFORMATION, "%s: the %s is valid", table->name, part);
    } else {
        pocket_event("CFE_TBL", INVALID_EVENT, CFE_EVS_EventType_ERROR, "%s: the %s is not valid: 0x%08X", table->name,
                     part, (unsigned)verdict);
    }
    return CFE_SUCCESS;
}

/* Copy the load into the table, and release its buffer. */
static void activate_locked(Table *table)
{
    memcpy(tbl.pool.bytes + table->at, tbl.loads[table->load].bytes, table->size);
    drop_load_locked(table);
    table->loaded = table->updated = true;
}

CFE_Status_t CFE_TBL_Update(CFE_TBL_Handle_t TblHandle)
{
    CFE_Status_t status = CFE_SUCCESS;
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    if (table == NULL) {
        status = CFE_TBL_ERR_INVALID_HANDLE;
    } else if (!table->update_pending) {
        status = CFE_TBL_INFO_NO_UPDATE_PENDING;
    } else if (table->locks > 0u) {
        status = CFE_TBL_INFO_TABLE_LOCKED;
    } else {
        activate_locked(table);
    }
    pocket_unlock();
    if (status == CFE_SUCCESS) {
        pocket_event("CFE_TBL", UPDATED_EVENT, CFE_EVS_EventType_INFORMATION, "%s is updated", table->name);
    }
    return status;
}

CFE_Status_t CFE_TBL_Manage(CFE_TBL_Handle_t TblHandle)
{
    CFE_Status_t status = CFE_TBL_GetStatus(TblHandle);
    if (status == CFE_TBL_INFO_VALIDATION_PENDING) {
        (void)CFE_TBL_Validate(TblHandle);
        status = CFE_TBL_GetStatus(TblHandle);
    }
    return status == CFE_TBL_INFO_UPDATE_PENDING ? CFE_TBL_Update(TblHandle) : status;
}

/* ---- loading */

static uint32 big_endian(const uint8 *p)
{
    return (uint32)p[0] << 24 | (uint32)p[1] << 16 | (uint32)p[2] << 8 | p[3];
}

/* An open file, and the part of a table that it holds. */
typedef struct Image {
    osal_id_t file;
    uint32 offset;
    uint32 size;
    char table[CFE_MISSION_TBL_MAX_FULL_NAME_LEN];
} Image;

static CFE_Status_t open_image(const char *path, Image *image)
{
    uint8 header[FILE_HEADER + TABLE_HEADER];
    if (OS_OpenCreate(&image->file, path, OS_FILE_FLAG_NONE, OS_READ_ONLY) != OS_SUCCESS) {
        return CFE_TBL_ERR_ACCESS;
    }
    const int32 n = OS_read(image->file, header, sizeof header);
    CFE_Status_t status = CFE_SUCCESS;
    if (n < FILE_HEADER) {
        status = CFE_TBL_ERR_NO_STD_HEADER;
    } else if (big_endian(header) != CONTENT) {
        status = CFE_TBL_ERR_BAD_CONTENT_ID;
    } else if (big_endian(header + 4) != TABLE_IMAGE) {
        status = CFE_TBL_ERR_BAD_SUBTYPE_ID;
    } else if (n < FILE_HEADER + TABLE_HEADER) {
        status = CFE_TBL_ERR_NO_TBL_HEADER;
    } else {
        image->offset = big_endian(header + FILE_HEADER + 4);
        image->size = big_endian(header + FILE_HEADER + 8);
        memcpy(image->table, header + FILE_HEADER + 12, sizeof image->table);
        image->table[sizeof image->table - 1u] = '\0';
    }
    if (status != CFE_SUCCESS) {
        (void)OS_close(image->file);
    }
    return status;
}

/* Read the data of an open file, and close it. Bytes outside of the part that it holds do not change. */
static CFE_Status_t read_image(const Image *image, uint8 *bytes, uint32 size, bool whole)
{
    CFE_Status_t status = CFE_SUCCESS;
    uint8 more;
    /* NOLINTNEXTLINE(bugprone-branch-clone): a file may be too large by its header or by its data */
    if (image->offset > size || image->size > size - image->offset) {
        status = CFE_TBL_ERR_FILE_TOO_LARGE;
    } else if (whole && (image->offset > 0u || image->size < size)) {
        status = CFE_TBL_ERR_PARTIAL_LOAD;
    } else if (OS_read(image->file, bytes + image->offset, image->size) != (int32)image->size) {
        status = CFE_TBL_ERR_LOAD_INCOMPLETE;
    } else if (OS_read(image->file, &more, 1) != 0) {
        status = CFE_TBL_ERR_FILE_TOO_LARGE;
    } else if (image->offset > 0u) {
        status = CFE_TBL_WARN_PARTIAL_LOAD;
    } else if (image->size < size) {
        status = CFE_TBL_WARN_SHORT_FILE;
    }
    (void)OS_close(image->file);
    return status;
}

/* Give a table a buffer that holds a copy of its content. */
static CFE_Status_t begin_load_locked(Table *table, bool ground)
{
    if (table->busy || (table->load != NONE && !ground)) {
        return CFE_TBL_ERR_LOAD_IN_PROGRESS;
    }
    drop_load_locked(table); /* a new load of the ground replaces one that is not active yet */
    for (uint32 i = 0; i < POCKET_LOADS; i++) {
        if (!tbl.loading[i]) {
            tbl.loading[i] = true;
            table->load = i;
            table->busy = true;
            memcpy(tbl.loads[i].bytes, tbl.pool.bytes + table->at, table->size);
            return CFE_SUCCESS;
        }
    }
    return CFE_TBL_ERR_NO_BUFFER_AVAIL;
}

static CFE_Status_t read_source(const Table *table, CFE_TBL_SrcEnum_t type, const void *source, uint8 *bytes)
{
    Image image;
    if (type == CFE_TBL_SRC_ADDRESS) {
        memcpy(bytes, source, table->size);
        return CFE_SUCCESS;
    }
    const CFE_Status_t status = open_image(source, &image);
    if (status != CFE_SUCCESS) {
        return status;
    }
    if (strcmp(image.table, table->name) != 0) {
        (void)OS_close(image.file);
        return CFE_TBL_ERR_FILE_FOR_WRONG_TABLE;
    }
    return read_image(&image, bytes, table->size, !table->loaded);
}

CFE_Status_t CFE_TBL_Load(CFE_TBL_Handle_t TblHandle, CFE_TBL_SrcEnum_t SrcType, const void *SrcDataPtr)
{
    if (SrcDataPtr == NULL) {
        return CFE_TBL_BAD_ARGUMENT;
    }
    if (SrcType != CFE_TBL_SRC_FILE && SrcType != CFE_TBL_SRC_ADDRESS) {
        return CFE_TBL_ERR_ILLEGAL_SRC_TYPE;
    }
    pocket_lock();
    Table *table = table_of_locked(TblHandle);
    CFE_Status_t status = table == NULL ? CFE_TBL_ERR_INVALID_HANDLE : begin_load_locked(table, false);
    pocket_unlock();
    if (status != CFE_SUCCESS) {
        return status;
    }
    uint8 *bytes = tbl.loads[table->load].bytes;
    status = read_source(table, SrcType, SrcDataPtr, bytes);
    if (status >= CFE_SUCCESS && table->validate != NULL) {
        const int32 verdict = table->validate(bytes);
        /* NASA's cFE takes a positive result of the validation for a warning; the pocket takes it for a failure. */
        status = verdict != CFE_SUCCESS ? (verdict < 0 ? verdict : -1) : status;
    }
    pocket_lock();
    table->busy = false;
    if (status < CFE_SUCCESS) {
        drop_load_locked(table);
    } else if (table->locks > 0u) {
        table->good = table->update_pending = true;
        status = CFE_TBL_INFO_TABLE_LOCKED;
    } else {
        activate_locked(table);
    }
    pocket_unlock();
    if (status < CFE_SUCCESS) {
        pocket_event("CFE_TBL", REFUSED_EVENT, CFE_EVS_EventType_ERROR, "%s: load refused: 0x%08X", table->name,
                     (unsigned)status);
    }
    return status;
}

/* ---- commands */

static CFE_Status_t load_command(const char *path)
{
    Image image;
    CFE_Status_t status = open_image(path, &image);
    if (status != CFE_SUCCESS) {
        return status;
    }
    pocket_lock();
    Table *table = table_named_locked(image.table);
    status = table == NULL ? CFE_TBL_ERR_FILE_FOR_WRONG_TABLE : begin_load_locked(table, true);
    pocket_unlock();
    if (status != CFE_SUCCESS) {
        (void)OS_close(image.file);
        return status;
    }
    status = read_image(&image, tbl.loads[table->load].bytes, table->size, !table->loaded);
    pocket_lock();
    table->busy = false;
    if (status < CFE_SUCCESS) {
        drop_load_locked(table);
    }
    pocket_unlock();
    return status;
}

static CFE_Status_t request(const char *name, bool update, bool active)
{
    CFE_Status_t status = CFE_SUCCESS;
    pocket_lock();
    Table *table = table_named_locked(name);
    if (table == NULL) {
        status = CFE_TBL_ERR_INVALID_NAME;
    } else if (table->load == NONE && !active) {
        status = CFE_TBL_INFO_NO_UPDATE_PENDING;
    } else if (update && !table->good) {
        status = CFE_TBL_INFO_VALIDATION_PENDING;
    } else if (update) {
        table->update_pending = true;
    } else {
        table->validate_pending = true;
        table->active = active;
    }
    pocket_unlock();
    return status;
}

/* Write a table, or its load, into a file that can be loaded again. */
static CFE_Status_t dump(const char *name, const char *path, bool active)
{
    const uint32 head[] = {CONTENT, TABLE_IMAGE, FILE_HEADER, 0, 0, 0, 0, 0};
    uint8 header[FILE_HEADER + TABLE_HEADER] = {0};
    static Bytes copy; /* only one task dumps */
    CFE_Status_t status = CFE_TBL_ERR_ACCESS;
    osal_id_t file;
    pocket_lock();
    const Table *table = table_named_locked(name);
    const uint32 size = table != NULL ? table->size : 0u;
    if (table != NULL && (active || table->load != NONE)) {
        memcpy(copy.bytes, active ? tbl.pool.bytes + table->at : tbl.loads[table->load].bytes, size);
    }
    const bool there = table != NULL && (active || table->load != NONE);
    pocket_unlock();
    for (uint32 i = 0; i < 32u; i++) {
        header[i] = (uint8)(head[i / 4u] >> (24u - 8u * (i % 4u)));
    }
    for (uint32 i = 0; i < 4u; i++) {
        header[FILE_HEADER + 8u + i] = (uint8)(size >> (24u - 8u * i));
    }
    (void)pocket_name((char *)header + FILE_HEADER + 12, 40, name);
    if (!there) {
        return table == NULL ? CFE_TBL_ERR_INVALID_NAME : CFE_TBL_INFO_NO_UPDATE_PENDING;
    }
    if (OS_OpenCreate(&file, path, OS_FILE_FLAG_CREATE | OS_FILE_FLAG_TRUNCATE, OS_WRITE_ONLY) == OS_SUCCESS) {
        const bool whole = OS_write(file, header, sizeof header) == (int32)sizeof header &&
                           OS_write(file, copy.bytes, size) == (int32)size;
        status = OS_close(file) == OS_SUCCESS && whole ? CFE_SUCCESS : CFE_TBL_ERR_ACCESS;
    }
    return status;
}

void pocket_tbl_command(const CFE_MSG_Message_t *message, size_t size)
{
    const uint8 *p = (const uint8 *)message;
    char text[40 + CFE_MISSION_MAX_PATH_LEN + 1] = {0};
    CFE_MSG_FcnCode_t code = 0;
    bool valid = false;
    static const struct {
        size_t size;
        uint32 text;
    } commands[] = {{8, 0}, {8, 0}, {8 + 64, 8}, {8 + 2 + 40 + 64, 10}, {8 + 2 + 40, 10}, {8 + 40, 8}};
    CFE_Status_t status = CFE_STATUS_WRONG_MSG_LENGTH;
    (void)CFE_MSG_ValidateChecksum(message, &valid);
    (void)CFE_MSG_GetFcnCode(message, &code);
    if (size >= sizeof(CFE_MSG_CommandHeader_t) && valid) {
        if (code >= sizeof commands / sizeof commands[0] || commands[code].size == 0u) {
            status = CFE_STATUS_BAD_COMMAND_CODE;
        } else if (size == commands[code].size) {
            const uint32 start = commands[code].text;
            if (start > 0u) {
                memcpy(text, p + start, size - start);
            }
            const bool active = p[8] != 0u || p[9] != 0u;
            status = code == CFE_TBL_LOAD_CC       ? load_command(text)
                     : code == CFE_TBL_DUMP_CC     ? dump(text, text + 40, active)
                     : code == CFE_TBL_VALIDATE_CC ? request(text, false, active)
                     : code == CFE_TBL_ACTIVATE_CC ? request(text, true, false)
                                                   : CFE_SUCCESS;
        }
    }
    /* A file that holds only a part of the table is accepted. */
    const bool done = status == CFE_SUCCESS || status == CFE_TBL_WARN_PARTIAL_LOAD || status == CFE_TBL_WARN_SHORT_FILE;
    pocket_lock();
    pocket_core.counts.table_commands += done ? 1u : 0u;
    pocket_core.counts.table_errors += done ? 0u : 1u;
    if (done && code == CFE_TBL_RESET_COUNTERS_CC) {
        pocket_core.counts.table_commands = pocket_core.counts.table_errors = 0;
    }
    pocket_unlock();
    if (!done) {
        pocket_event("CFE_TBL", REFUSED_EVENT, CFE_EVS_EventType_ERROR, "Command %u refused: 0x%08X %s", (unsigned)code,
                     (unsigned)status, text);
    } else {
        pocket_event("CFE_TBL", code == CFE_TBL_LOAD_CC ? LOADED_EVENT : NOOP_EVENT, CFE_EVS_EventType_INFORMATION,
                     "Command %u accepted %s", (unsigned)code, text);
    }
}
