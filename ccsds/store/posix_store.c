/* SPDX-License-Identifier: Apache-2.0 */
#define _POSIX_C_SOURCE 200809L
#define _FILE_OFFSET_BITS 64

#include "ccsds/store/posix_store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int refusal(void)
{
    switch (errno) {
    case ENOENT: return CFDP_ABSENT;
    case ENOSPC:
    case EDQUOT:
    case EFBIG: return CFDP_FULL;
    case EIO: return CFDP_BROKEN;
    default: return CFDP_REFUSED;
    }
}

/* Open the directory that a name is in, step by step, so that no link is followed. *last: the name's last part. Returns
 * a descriptor, or a refusal. */
static int directory_of(const PosixStore *posix, const char *name, const char **last)
{
    int directory = dup(posix->root);
    while (directory >= 0) {
        const size_t n = strcspn(name, "/");
        char part[CFDP_NAME];
        if (n == 0 || n >= sizeof part || (name[0] == '.' && (n == 1 || (n == 2 && name[1] == '.')))) {
            close(directory);
            return CFDP_REFUSED;
        }
        if (name[n] == '\0') {
            *last = name;
            return directory;
        }
        memcpy(part, name, n);
        part[n] = '\0';
        const int next = openat(directory, part, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        const int why = next < 0 ? refusal() : 0;
        close(directory);
        if (next < 0) {
            return why;
        }
        directory = next;
        name += n + 1;
    }
    return CFDP_BROKEN;
}

/* A result of a call on a name in a directory, which ends here. */
static int ended(int directory, int result)
{
    const int fault = result < 0 ? refusal() : result;
    close(directory);
    return fault;
}

/* Whether there is room for n more bytes. Each write, and each file, may take a block of the disk for itself. */
static int take_room(PosixStore *posix, size_t n)
{
    enum { block = 4096 };
    const int there = n + block <= posix->room;
    posix->room -= !there || posix->room == UINT64_MAX ? 0 : n + block;
    return there;
}

static int open_named(void *user, const char *name, CfdpOpen how)
{
    if (how == CFDP_OPEN_NEW && !take_room(user, 0)) {
        return CFDP_FULL;
    }
    static const int flags[] = {O_RDONLY, O_RDWR, O_RDWR | O_CREAT | O_TRUNC};
    const char *last;
    const int directory = directory_of(user, name, &last);
    if (directory < 0) {
        return directory;
    }
    /* O_NONBLOCK: a pipe without a writer does not hold the entity */
    const int file = ended(directory, openat(directory, last, flags[how] | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0644));
    struct stat of;
    if (file >= 0 && (fstat(file, &of) != 0 || !S_ISREG(of.st_mode))) {
        close(file);
        return CFDP_REFUSED;
    }
    return file;
}

static void close_file(void *user, int file)
{
    (void)user;
    close(file);
}

static int64_t size_of(void *user, int file)
{
    (void)user;
    struct stat of;
    return fstat(file, &of) == 0 ? (int64_t)of.st_size : CFDP_BROKEN;
}

static int read_file(void *user, int file, uint64_t offset, uint8_t *bytes, size_t n)
{
    (void)user;
    while (n != 0) {
        const ssize_t got = pread(file, bytes, n, (off_t)offset);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            return CFDP_BROKEN;
        }
        bytes += got;
        offset += (uint64_t)got;
        n -= (size_t)got;
    }
    return 0;
}

static int write_file(void *user, int file, uint64_t offset, const uint8_t *bytes, size_t n)
{
    PosixStore *posix = user;
    if (offset > posix->limit || n > posix->limit - offset || !take_room(posix, n)) {
        return CFDP_FULL;
    }
    while (n != 0) {
        const ssize_t put = pwrite(file, bytes, n, (off_t)offset);
        if (put < 0 && errno == EINTR) {
            continue;
        }
        if (put < 0) {
            return refusal();
        }
        bytes += put;
        offset += (uint64_t)put;
        n -= (size_t)put;
    }
    return 0;
}

static int rename_file(void *user, const char *from, const char *to)
{
    const char *last_from, *last_to;
    const int old = directory_of(user, from, &last_from);
    if (old < 0) {
        return old;
    }
    const int target = directory_of(user, to, &last_to);
    if (target < 0) {
        close(old);
        return target;
    }
    const int result = ended(old, renameat(old, last_from, target, last_to));
    close(target);
    return result;
}

static int remove_as(void *user, const char *name, int flag)
{
    const char *last;
    const int directory = directory_of(user, name, &last);
    return directory < 0 ? directory : ended(directory, unlinkat(directory, last, flag));
}

static int remove_file(void *user, const char *name)
{
    return remove_as(user, name, 0);
}

static int remove_directory(void *user, const char *name)
{
    return remove_as(user, name, AT_REMOVEDIR);
}

static int make_directory(void *user, const char *name)
{
    const char *last;
    const int directory = directory_of(user, name, &last);
    return directory < 0 ? directory : ended(directory, mkdirat(directory, last, 0755));
}

static int list_directory(void *user, const char *name, CfdpEach each, void *to)
{
    const PosixStore *posix = user;
    const char *last = ".";
    const int parent = name[0] == '\0' ? dup(posix->root) : directory_of(posix, name, &last);
    if (parent < 0) {
        return parent;
    }
    const int directory = ended(parent, openat(parent, last, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    DIR *entries = directory < 0 ? NULL : fdopendir(directory);
    if (entries == NULL) {
        return directory < 0 ? directory : CFDP_BROKEN;
    }
    int result = 0;
    for (const struct dirent *entry; result >= 0 && (entry = readdir(entries)) != NULL;) {
        char line[300];
        struct stat of;
        if (entry->d_name[0] != '.' && fstatat(directory, entry->d_name, &of, AT_SYMLINK_NOFOLLOW) == 0) {
            snprintf(line, sizeof line, "%s%s", entry->d_name, S_ISDIR(of.st_mode) ? "/" : "");
            result = each(to, line);
        }
    }
    closedir(entries);
    return result;
}

int posix_store_open(PosixStore *posix, const char *folder, uint64_t limit, CfdpStore *store)
{
    posix->root = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    posix->limit = limit;
    posix->room = UINT64_MAX;
    *store = (CfdpStore){.open = open_named,
                         .close = close_file,
                         .size = size_of,
                         .read = read_file,
                         .write = write_file,
                         .rename = rename_file,
                         .remove = remove_file,
                         .make_directory = make_directory,
                         .remove_directory = remove_directory,
                         .list = list_directory,
                         .user = posix};
    return posix->root >= 0;
}

void posix_store_close(PosixStore *posix)
{
    close(posix->root);
}
