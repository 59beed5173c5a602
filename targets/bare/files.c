/* SPDX-License-Identifier: Apache-2.0 */
/* Files of the pocket cFE on a board: those below /cf and /ram are in memory, and there are no folders. */
#include "targets/bare/tasks.h"
#include "targets/cfs/config.h"
#include "targets/cfs/port.h"

#include "osapi.h"

#include <string.h>

enum { FILES = 96, WRITTEN = 16, OPEN = POCKET_FILES, PATH = 64, LARGEST = 8192 };

static struct {
    char path[PATH]; ///< "": there is none
    const uint8 *bytes;
    size_t size;
    uint8 *own; ///< of a file that is written here: its room; else NULL
} files[FILES];

static struct {
    uint8 bytes[LARGEST];
    int taken;
} rooms[WRITTEN];

static struct {
    int32 file; ///< its index + 1; 0: not open
    int access;
    size_t at;
} opened[OPEN];

static int32 find(const char *path)
{
    for (int32 i = 0; i < FILES; i++) {
        if (strcmp(files[i].path, path) == 0) {
            return i;
        }
    }
    return -1;
}

void port_add_file(const char *path, const uint8 *bytes, size_t n)
{
    const int32 i = find("");
    if (i >= 0) {
        (void)strcpy(files[i].path, path);
        files[i].bytes = bytes;
        files[i].size = n;
    }
}

/* Give a file room of its own, with its content. Returns 0 if there is none. */
static int make_writable(int32 i)
{
    for (uint32 k = 0; k < WRITTEN && files[i].own == NULL && files[i].size <= LARGEST; k++) {
        if (!rooms[k].taken) {
            rooms[k].taken = 1;
            files[i].own = rooms[k].bytes;
            memcpy(files[i].own, files[i].bytes, files[i].size);
            files[i].bytes = files[i].own;
        }
    }
    return files[i].own != NULL;
}

static int32 add(const char *path)
{
    static const uint8 nothing[1];
    port_add_file(path, nothing, 0);
    return find(path);
}

static int is_path(const char *path)
{
    return (strncmp(path, "/cf/", 4) == 0 || strncmp(path, "/ram/", 5) == 0) && strlen(path) < PATH;
}

int32 port_file_open(const char *path, int access, int create, int truncate)
{
    if (!is_path(path)) {
        return -1;
    }
    int32 i = find(path);
    if (i < 0 && create) {
        i = add(path);
    }
    if (i >= 0 && access != OS_READ_ONLY && !make_writable(i)) {
        return -1;
    }
    for (int32 k = 0; i >= 0 && k < OPEN; k++) {
        if (opened[k].file == 0) {
            opened[k].file = i + 1;
            opened[k].access = access;
            opened[k].at = 0;
            files[i].size = truncate ? 0 : files[i].size;
            return k;
        }
    }
    return -1;
}

static int is_open(int32 k)
{
    return k >= 0 && k < OPEN && opened[k].file != 0;
}

int32 port_file_read(int32 k, void *bytes, size_t n)
{
    if (!is_open(k) || opened[k].access == OS_WRITE_ONLY) {
        return -1;
    }
    const size_t size = files[opened[k].file - 1].size, left = opened[k].at < size ? size - opened[k].at : 0;
    n = n < left ? n : left;
    memcpy(bytes, files[opened[k].file - 1].bytes + opened[k].at, n);
    opened[k].at += n;
    return (int32)n;
}

int32 port_file_write(int32 k, const void *bytes, size_t n)
{
    if (!is_open(k) || opened[k].access == OS_READ_ONLY || opened[k].at > LARGEST || n > LARGEST - opened[k].at) {
        return -1;
    }
    const int32 i = opened[k].file - 1;
    if (n == 0) {
        return 0;
    }
    if (opened[k].at > files[i].size) { /* nothing was written between */
        memset(files[i].own + files[i].size, 0, opened[k].at - files[i].size);
    }
    memcpy(files[i].own + opened[k].at, bytes, n);
    opened[k].at += n;
    files[i].size = opened[k].at > files[i].size ? opened[k].at : files[i].size;
    return (int32)n;
}

int32 port_file_seek(int32 k, int32 offset, uint32 whence)
{
    if (!is_open(k) || whence > OS_SEEK_END) {
        return -1;
    }
    const int64 from = whence == OS_SEEK_SET   ? 0
                       : whence == OS_SEEK_CUR ? (int64)opened[k].at
                                               : (int64)files[opened[k].file - 1].size;
    if (from + offset < 0 || from + offset > LARGEST) {
        return -1;
    }
    opened[k].at = (size_t)(from + offset);
    return (int32)opened[k].at;
}

int32 port_file_close(int32 k)
{
    if (!is_open(k)) {
        return -1;
    }
    opened[k].file = 0;
    return 0;
}

int32 port_file_remove(const char *path)
{
    const int32 i = find(path);
    for (int32 k = 0; k < OPEN; k++) {
        if (i < 0 || opened[k].file == i + 1) {
            return -1;
        }
    }
    for (uint32 k = 0; k < WRITTEN; k++) {
        rooms[k].taken = rooms[k].taken && files[i].own != rooms[k].bytes;
    }
    files[i].own = NULL;
    files[i].path[0] = '\0';
    return 0;
}

int32 port_file_rename(const char *from, const char *to)
{
    const int32 i = find(from), old = find(to);
    if (i < 0 || !is_path(to) || (old >= 0 && old != i && port_file_remove(to) != 0)) {
        return -1;
    }
    (void)strcpy(files[i].path, to);
    return 0;
}

/* ---- there are no folders */

int32 port_folder_make(const char *path)
{
    (void)path;
    return -1;
}

int32 port_folder_remove(const char *path)
{
    (void)path;
    return -1;
}

int32 port_folder_open(const char *path)
{
    (void)path;
    return -1;
}

int32 port_folder_read(int32 folder, char *name, size_t room)
{
    (void)folder;
    (void)name;
    (void)room;
    return -1;
}

int32 port_folder_close(int32 folder)
{
    (void)folder;
    return -1;
}
