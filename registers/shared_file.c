/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* locks of open files, futex, memfd_create */
#include "registers/shared_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#ifdef __linux__
#include <linux/futex.h>
#include <sys/syscall.h>
#endif

/* Locks end with the process. Locks of the open file also distinguish two ends in one process. */
#ifdef F_OFD_SETLK
#define SET_LOCK F_OFD_SETLK
#define GET_LOCK F_OFD_GETLK
#else
#define SET_LOCK F_SETLK
#define GET_LOCK F_GETLK
#endif

/* The file: a head of 64 bytes, then the boards, each from a multiple of 64. Words of the head: */
enum {
    MAGIC = 0,    /* 2 words, stored last */
    HASH = 2,     /* 2 words */
    RINGS = 4,    /* how often the creator, and the peer, has rung */
    ATTACHED = 6, /* 1: a peer has attached */
    HEAD_WORDS = 16
};

enum { CREATOR = 0, PEER = 1 };

#define POLL_NS 100000000 /* how often a waiting side checks that the other one lives */

/* The same bytes on machines of either byte order. The last one is the version. */
static const char MAGIC_BYTES[8] = {'F', 'L', 'E', 'D', 'G', 'R', 'S', '1'};

static size_t rounded(size_t n)
{
    return (n + 63u) / 64u * 64u;
}

static size_t size_of(const RegisterBoard *const *boards, uint32_t n)
{
    size_t size = HEAD_WORDS * 4u;
    for (uint32_t i = 0u; i < n; i++) {
        size += rounded(boards[i]->size);
    }
    return size;
}

/* FNV-1a over the boards' hashes, as bytes, most significant first. */
static void hash_of(const RegisterBoard *const *boards, uint32_t n, uint8_t *bytes)
{
    uint64_t hash = UINT64_C(0xCBF29CE484222325);
    for (uint32_t i = 0u; i < n; i++) {
        for (int shift = 56; shift >= 0; shift -= 8) {
            hash = (hash ^ (boards[i]->hash >> shift & 0xFFu)) * UINT64_C(0x100000001B3);
        }
    }
    for (uint32_t i = 0u; i < 8u; i++) {
        bytes[i] = (uint8_t)(hash >> (56u - 8u * i));
    }
}

static void store_head(volatile uint32_t *words, const void *bytes)
{
    uint32_t v[2];
    memcpy(v, bytes, sizeof v);
    __atomic_store_n(&words[0], v[0], __ATOMIC_SEQ_CST);
    __atomic_store_n(&words[1], v[1], __ATOMIC_SEQ_CST);
}

static int head_is(const volatile uint32_t *words, const void *bytes)
{
    uint32_t v[2];
    memcpy(v, bytes, sizeof v);
    /* The second word is stored last. */
    return __atomic_load_n(&words[1], __ATOMIC_SEQ_CST) == v[1] && __atomic_load_n(&words[0], __ATOMIC_SEQ_CST) == v[0];
}

/* The lock of a side: one byte, whose offset is the number of the side. */
static struct flock lock_of(uint32_t side)
{
    struct flock l;
    memset(&l, 0, sizeof l);
    l.l_type = F_WRLCK;
    l.l_whence = SEEK_SET;
    l.l_start = (off_t)side;
    l.l_len = 1;
    return l;
}

static int lock(int fd, uint32_t side)
{
    struct flock l = lock_of(side);
    return fcntl(fd, SET_LOCK, &l);
}

static int is_locked(int fd, uint32_t side)
{
    struct flock l = lock_of(side);
    return fcntl(fd, GET_LOCK, &l) == 0 && l.l_type != F_UNLCK;
}

static void ring(void *user, uint32_t line)
{
    RegisterFile *f = user;
    volatile uint32_t *rings = &f->map[RINGS + f->side];
    (void)line;
    /* Only this side writes this word, but two of its threads may do so. */
    (void)__atomic_fetch_add(rings, 1u, __ATOMIC_SEQ_CST);
#ifdef __linux__
    (void)syscall(SYS_futex, rings, FUTEX_WAKE, INT_MAX, NULL, NULL, 0);
#endif
}

static void make_windows(RegisterFile *f, const RegisterBoard *const *boards, uint32_t n, RegisterWindow *windows)
{
    size_t at = HEAD_WORDS * 4u;
    for (uint32_t i = 0u; i < n; i++) {
        windows[i] = register_window(boards[i], f->map + at / 4u);
        windows[i].ring = ring;
        windows[i].user = f;
        at += rounded(boards[i]->size);
    }
}

static void reset(RegisterFile *f, uint32_t side)
{
    memset(f, 0, sizeof *f);
    f->fd = -1;
    f->side = side;
}

static RegisterFileStatus fail(RegisterFile *f, RegisterFileStatus status)
{
    f->error = status == REGISTER_FILE_FAILED ? errno : 0;
    register_file_close(f);
    return status;
}

static RegisterFileStatus map(RegisterFile *f, size_t size)
{
    void *p = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, f->fd, 0);
    if (p == MAP_FAILED) {
        return REGISTER_FILE_FAILED;
    }
    f->map = p;
    f->size = size;
    return REGISTER_FILE_OK;
}

/* A new file that no other process has open. */
static RegisterFileStatus open_new(RegisterFile *f, const char *path)
{
    const int flags = O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
    if (path == NULL) {
#ifdef __linux__
        f->fd = memfd_create("registers", MFD_CLOEXEC);
#else
        errno = ENOSYS;
#endif
        return f->fd < 0 ? REGISTER_FILE_FAILED : REGISTER_FILE_OK;
    }
    if (strlen(path) >= sizeof f->path) {
        errno = ENAMETOOLONG;
        return REGISTER_FILE_FAILED;
    }
    f->fd = open(path, flags, 0600);
    if (f->fd < 0 && errno == EEXIST) {
        /* Replace a file whose creator has ended. */
        const int old = open(path, O_RDWR | O_NOFOLLOW | O_CLOEXEC);
        struct stat s;
        if (old < 0) {
            return REGISTER_FILE_FAILED;
        }
        const int in_use = fstat(old, &s) != 0 || !S_ISREG(s.st_mode) || is_locked(old, CREATOR);
        (void)close(old);
        if (in_use) {
            return REGISTER_FILE_IN_USE;
        }
        (void)unlink(path);
        f->fd = open(path, flags, 0600);
    }
    if (f->fd < 0) {
        return REGISTER_FILE_FAILED;
    }
    (void)strcpy(f->path, path);
    return REGISTER_FILE_OK;
}

RegisterFileStatus register_file_create(RegisterFile *f, const char *path, const RegisterBoard *const *boards,
                                        uint32_t n, RegisterWindow *windows)
{
    uint8_t hash[8];
    const size_t size = size_of(boards, n);
    reset(f, CREATOR);
    RegisterFileStatus status = open_new(f, path);
    if (status != REGISTER_FILE_OK) {
        return fail(f, status);
    }
    if (lock(f->fd, CREATOR) != 0 || ftruncate(f->fd, (off_t)size) != 0) {
        return fail(f, REGISTER_FILE_FAILED);
    }
    status = map(f, size);
    if (status != REGISTER_FILE_OK) {
        return fail(f, status);
    }
    hash_of(boards, n, hash);
    store_head(f->map + HASH, hash);
    make_windows(f, boards, n, windows);
    store_head(f->map + MAGIC, MAGIC_BYTES);
    return REGISTER_FILE_OK;
}

RegisterFileStatus register_file_attach(RegisterFile *f, const char *path, const RegisterBoard *const *boards,
                                        uint32_t n, RegisterWindow *windows)
{
    static const char inherited[] = "/dev/fd/";
    const size_t size = size_of(boards, n);
    uint8_t hash[8];
    struct stat s;
    reset(f, PEER);
    f->fd = open(path, O_RDWR | O_CLOEXEC);
    if (f->fd < 0) {
        return fail(f, errno == ENOENT ? REGISTER_FILE_NOT_YET : REGISTER_FILE_FAILED);
    }
    if (fstat(f->fd, &s) != 0) {
        return fail(f, REGISTER_FILE_FAILED);
    }
    if (s.st_size == 0) {
        return fail(f, REGISTER_FILE_NOT_YET);
    }
    if (!S_ISREG(s.st_mode) || (size_t)s.st_size != size) {
        return fail(f, REGISTER_FILE_OTHER);
    }
    const RegisterFileStatus status = map(f, size);
    if (status != REGISTER_FILE_OK) {
        return fail(f, status);
    }
    if (__atomic_load_n(&f->map[MAGIC + 1], __ATOMIC_SEQ_CST) == 0u || !is_locked(f->fd, CREATOR)) {
        return fail(f, REGISTER_FILE_NOT_YET);
    }
    hash_of(boards, n, hash);
    if (!head_is(f->map + MAGIC, MAGIC_BYTES) || !head_is(f->map + HASH, hash)) {
        return fail(f, REGISTER_FILE_OTHER);
    }
    if (lock(f->fd, PEER) != 0) {
        return fail(f, errno == EACCES || errno == EAGAIN ? REGISTER_FILE_IN_USE : REGISTER_FILE_FAILED);
    }
    if (strncmp(path, inherited, sizeof inherited - 1u) == 0) {
        (void)close((int)strtol(path + sizeof inherited - 1u, NULL, 10));
    } else {
        (void)unlink(path);
    }
    make_windows(f, boards, n, windows);
    __atomic_store_n(&f->map[ATTACHED], 1u, __ATOMIC_SEQ_CST);
    ring(f, 0u);
    return REGISTER_FILE_OK;
}

void register_file_close(RegisterFile *f)
{
    const int error = f->error;
    if (f->path[0] != '\0' && (f->map == NULL || __atomic_load_n(&f->map[ATTACHED], __ATOMIC_SEQ_CST) == 0u)) {
        (void)unlink(f->path);
    }
    if (f->map != NULL) {
        (void)munmap((void *)(uintptr_t)f->map, f->size);
    }
    if (f->fd >= 0) {
        (void)close(f->fd);
    }
    reset(f, f->side);
    f->error = error;
}

int register_file_peer_lives(const RegisterFile *f)
{
    return __atomic_load_n(&f->map[ATTACHED], __ATOMIC_SEQ_CST) != 0u &&
           is_locked(f->fd, f->side == CREATOR ? PEER : CREATOR);
}

static int64_t now_ns(void)
{
    struct timespec t = {0, 0};
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + (int64_t)t.tv_nsec;
}

/* Sleep until the count of rings differs from `seen`, at most `ns`. */
static void sleep_while(volatile uint32_t *rings, uint32_t seen, int64_t ns)
{
#ifdef __linux__
    struct timespec t;
    t.tv_sec = (time_t)(ns / 1000000000);
    t.tv_nsec = (long)(ns % 1000000000);
    (void)syscall(SYS_futex, rings, FUTEX_WAIT, seen, &t, NULL, 0);
#else
    const struct timespec t = {0, ns < 50000 ? (long)ns : 50000L};
    (void)rings;
    (void)seen;
    (void)nanosleep(&t, NULL);
#endif
}

RegisterFileStatus register_file_wait(RegisterFile *f, int64_t timeout_ns)
{
    volatile uint32_t *rings = &f->map[RINGS + (f->side == CREATOR ? PEER : CREATOR)];
    const int64_t start = now_ns();
    int gone = 0;
    for (;;) {
        const uint32_t rung = __atomic_load_n(rings, __ATOMIC_SEQ_CST);
        if (rung != f->seen) {
            f->seen = rung;
            return REGISTER_FILE_RANG;
        }
        if (gone) {
            return REGISTER_FILE_GONE; /* and it has not rung since the last call */
        }
        const int64_t left = timeout_ns - (now_ns() - start);
        if (left <= 0) {
            return REGISTER_FILE_TIMEOUT;
        }
        sleep_while(rings, rung, left < POLL_NS ? left : POLL_NS);
        gone = __atomic_load_n(rings, __ATOMIC_SEQ_CST) == f->seen &&
               __atomic_load_n(&f->map[ATTACHED], __ATOMIC_SEQ_CST) != 0u && !register_file_peer_lives(f);
    }
}

const char *register_file_status_text(RegisterFileStatus status)
{
    switch (status) {
    case REGISTER_FILE_OK: return "ok";
    case REGISTER_FILE_RANG: return "the other side rang";
    case REGISTER_FILE_TIMEOUT: return "the other side did not ring in time";
    case REGISTER_FILE_GONE: return "the other side has ended";
    case REGISTER_FILE_NOT_YET: return "the file is not there yet";
    case REGISTER_FILE_IN_USE: return "another process uses the file";
    case REGISTER_FILE_OTHER: return "the file is of other boards or of another version";
    case REGISTER_FILE_FAILED: return "the system refused";
    }
    return "unknown";
}
