/* SPDX-License-Identifier: Apache-2.0 */
/* The functions of a system for the C library: the console, and a heap between the program and its stack. A flight
 * program calls none of them. */
#include "targets/leon3/leon3.h"

#include <errno.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/times.h>

void *_sbrk(ptrdiff_t n);
extern char leon3_heap[], leon3_stack[];

void *_sbrk(ptrdiff_t n);
int _write(int file, const void *bytes, size_t n);
int _read(int file, void *bytes, size_t n);
int _close(int file);
int _open(const char *path, int flags, int mode);
off_t _lseek(int file, off_t offset, int whence);
int _fstat(int file, struct stat *s);
int _isatty(int file);
int _getpid(void);
int _kill(int process, int number);
int _gettimeofday(struct timeval *t, void *zone);
int _unlink(const char *path);
int _link(const char *path, const char *other);
clock_t _times(struct tms *t);

static char *heap_end = leon3_heap; /* `fledge profile` reads it */

void *_sbrk(ptrdiff_t n)
{
    char *const old = heap_end;
    if (n > leon3_stack - heap_end) {
        errno = ENOMEM;
        return (void *)-1;
    }
    heap_end += n;
    return old;
}

int _write(int file, const void *bytes, size_t n)
{
    (void)file;
    leon3_send(leon3.console, bytes, n);
    return (int)n;
}

int _read(int file, void *bytes, size_t n)
{
    (void)file;
    (void)bytes;
    (void)n;
    return 0;
}

int _close(int file)
{
    (void)file;
    return 0;
}

static int refuse(int error)
{
    errno = error;
    return -1;
}

int _open(const char *path, int flags, int mode)
{
    (void)path;
    (void)flags;
    (void)mode;
    return refuse(ENOENT);
}

int _unlink(const char *path)
{
    (void)path;
    return refuse(ENOENT);
}

int _link(const char *path, const char *other)
{
    (void)path;
    (void)other;
    return refuse(ENOENT);
}

off_t _lseek(int file, off_t offset, int whence)
{
    (void)file;
    (void)offset;
    (void)whence;
    return refuse(ESPIPE);
}

int _fstat(int file, struct stat *s)
{
    (void)file;
    s->st_mode = S_IFCHR;
    return 0;
}

int _isatty(int file)
{
    return file >= 0 && file <= 2;
}

int _getpid(void)
{
    return 1;
}

int _kill(int process, int number)
{
    (void)process;
    (void)number;
    leon3_stop(1);
}

int _gettimeofday(struct timeval *t, void *zone)
{
    const int64_t now = bare_now();
    (void)zone;
    t->tv_sec = (time_t)(now / 1000000000);
    t->tv_usec = (suseconds_t)(now % 1000000000 / 1000);
    return 0;
}

clock_t _times(struct tms *t)
{
    t->tms_utime = (clock_t)(bare_now() / (1000000000 / CLOCKS_PER_SEC));
    t->tms_stime = t->tms_cutime = t->tms_cstime = 0;
    return t->tms_utime;
}

void _exit(int status)
{
    leon3_stop(status);
}
