/* SPDX-License-Identifier: Apache-2.0 */
/* The port to POSIX: each task is a thread with its own condition variable. */
#define _POSIX_C_SOURCE 200809L

#include "targets/cfs/config.h"
#include "targets/cfs/port.h"

#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t conditions[POCKET_TASKS];
static pthread_key_t self_key, end_key;
static pthread_once_t once = PTHREAD_ONCE_INIT;
static void (*entries[POCKET_TASKS])(uint32);
static char folder[256] = ".";

static void make_once(void)
{
    pthread_condattr_t attributes;
    (void)pthread_key_create(&self_key, NULL);
    (void)pthread_key_create(&end_key, NULL);
    (void)pthread_condattr_init(&attributes);
    (void)pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    for (uint32 i = 0; i < POCKET_TASKS; i++) {
        (void)pthread_cond_init(&conditions[i], &attributes);
    }
    (void)pthread_condattr_destroy(&attributes);
}

void port_start(const char *root)
{
    (void)pthread_once(&once, make_once);
    (void)pthread_setspecific(self_key, NULL);
    if (strlen(root) < sizeof folder) {
        (void)strcpy(folder, root);
    }
}

void port_lock(void)
{
    (void)pthread_mutex_lock(&lock);
}

void port_unlock(void)
{
    (void)pthread_mutex_unlock(&lock);
}

static void *run(void *slot)
{
    const uint32 number = (uint32)(uintptr_t)slot;
    jmp_buf end;
    (void)pthread_setspecific(self_key, slot);
    (void)pthread_setspecific(end_key, &end);
    port_lock();
    void (*entry)(uint32) = entries[number];
    port_unlock();
    if (setjmp(end) == 0) {
        entry(number);
    }
    return NULL;
}

int port_task_start(uint32 slot, void (*entry)(uint32 slot), void *stack, size_t stack_size, uint32 priority)
{
    pthread_attr_t attributes;
    pthread_t thread;
    (void)priority; /* POSIX lets only privileged users set priorities */
    entries[slot] = entry;
    if (pthread_attr_init(&attributes) != 0) {
        return 1;
    }
    (void)pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    /* This machine's C library needs a larger stack than that of a flight computer. */
    if (stack != NULL) {
        (void)pthread_attr_setstack(&attributes, stack, stack_size);
    } else {
        const size_t least = 256u * 1024u;
        (void)pthread_attr_setstacksize(&attributes, stack_size < least ? least : stack_size);
    }
    const int failed = pthread_create(&thread, &attributes, run, (void *)(uintptr_t)slot);
    (void)pthread_attr_destroy(&attributes);
    return failed;
}

void port_task_end(void)
{
    longjmp(*(jmp_buf *)pthread_getspecific(end_key), 1); /* pthread_exit reads code that is unloaded by now */
}

uint32 port_task_self(void)
{
    return (uint32)(uintptr_t)pthread_getspecific(self_key);
}

void port_block(int64 until_ns)
{
    pthread_cond_t *condition = &conditions[port_task_self()];
    if (until_ns < 0) {
        (void)pthread_cond_wait(condition, &lock);
    } else {
        struct timespec t;
        t.tv_sec = (time_t)(until_ns / 1000000000);
        t.tv_nsec = (long)(until_ns % 1000000000);
        (void)pthread_cond_timedwait(condition, &lock, &t);
    }
}

void port_unblock(uint32 slot)
{
    (void)pthread_cond_signal(&conditions[slot]);
}

int64 port_now(void)
{
    struct timespec t = {0, 0};
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64)t.tv_sec * 1000000000 + (int64)t.tv_nsec;
}

void port_console(const char *text, size_t n)
{
    (void)fwrite(text, 1, n, stdout);
    (void)fflush(stdout);
}

/* /cf/x is the file x in the folder cf below the root; /ram likewise. Other paths are refused. */
static int translate(const char *path, char *to, size_t room)
{
    if ((strncmp(path, "/cf/", 4) != 0 && strncmp(path, "/ram/", 5) != 0) || strstr(path, "..") != NULL) {
        return 0;
    }
    const int n = snprintf(to, room, "%s%s", folder, path);
    return n > 0 && (size_t)n < room;
}

void *port_load(const char *name, const char *entry_name, void (**entry)(void))
{
    char path[512];
    const int n = snprintf(path, sizeof path, "%s/cf/%s.so", folder, name);
    void *code = n > 0 && (size_t)n < sizeof path && name[0] != '\0' ? dlopen(path, RTLD_NOW | RTLD_LOCAL) : NULL;
    *(void **)entry = code != NULL ? dlsym(code, entry_name) : NULL;
    return code;
}

void port_unload(void *code)
{
    (void)dlclose(code);
}

int32 port_file_open(const char *path, int access, int create, int truncate)
{
    static const int modes[3] = {O_RDONLY, O_WRONLY, O_RDWR};
    char name[512];
    if (access < 0 || access > 2 || !translate(path, name, sizeof name)) {
        return -1;
    }
    return open(name, modes[access] | (create ? O_CREAT : 0) | (truncate ? O_TRUNC : 0) | O_CLOEXEC, 0644);
}

int32 port_file_read(int32 file, void *bytes, size_t n)
{
    return (int32)read(file, bytes, n < INT_MAX ? n : INT_MAX);
}

int32 port_file_write(int32 file, const void *bytes, size_t n)
{
    return (int32)write(file, bytes, n < INT_MAX ? n : INT_MAX);
}

int32 port_file_seek(int32 file, int32 offset, uint32 whence)
{
    static const int from[3] = {SEEK_SET, SEEK_CUR, SEEK_END};
    return whence > 2u ? -1 : (int32)lseek(file, offset, from[whence]);
}

int32 port_file_close(int32 file)
{
    return close(file);
}

int32 port_file_remove(const char *path)
{
    char name[512];
    return translate(path, name, sizeof name) ? unlink(name) : -1;
}

int32 port_file_rename(const char *from, const char *to)
{
    char old[512], new[512];
    return translate(from, old, sizeof old) && translate(to, new, sizeof new) ? rename(old, new) : -1;
}

int32 port_folder_make(const char *path)
{
    char name[512];
    return translate(path, name, sizeof name) ? mkdir(name, 0755) : -1;
}

int32 port_folder_remove(const char *path)
{
    char name[512];
    return translate(path, name, sizeof name) ? rmdir(name) : -1;
}

/* By their numbers. */
static DIR *folders[4];

int32 port_folder_open(const char *path)
{
    char name[512];
    for (int32 i = 0; i < (int32)(sizeof folders / sizeof folders[0]); i++) {
        if (folders[i] == NULL && translate(path, name, sizeof name)) {
            folders[i] = opendir(name);
            return folders[i] != NULL ? i : -1;
        }
    }
    return -1;
}

int32 port_folder_read(int32 number, char *name, size_t room)
{
    const struct dirent *entry = readdir(folders[number]);
    return entry != NULL && snprintf(name, room, "%s", entry->d_name) >= 0 ? 0 : -1;
}

int32 port_folder_close(int32 number)
{
    DIR *folder = folders[number];
    folders[number] = NULL;
    return closedir(folder);
}
