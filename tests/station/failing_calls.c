/* Lets one system call on files below a folder fail, be cut short, or kill the process: for tests, by LD_PRELOAD.

   fail_arm(folder, at, how, error): the at-th call from now on, counted from 1. how: 0 fails with `error`, 1 writes half,
   2 kills the process before the call, 3 behind it, 4 fails all that
   need room on the disk with `error` from then on. fail_count(): calls so far. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum { FAILS, HALF, KILLS_BEFORE, KILLS_AFTER, FAILS_ON };

static char folder[PATH_MAX];
static long count, at;
static int how, error_number;

void fail_arm(const char *below, long place, int kind, int error) {
    snprintf(folder, sizeof folder, "%s", below);
    count = 0, at = place, how = kind, error_number = error;
}
long fail_count(void) { return count; }

static int below(const char *path) { return folder[0] && path && !strncmp(path, folder, strlen(folder)); }
static int below_fd(int fd) {
    char name[64], path[PATH_MAX];
    if (!folder[0]) return 0;
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(name, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return below(path);
}
/* Whether this call is to fail; kills where it is to be killed before the call. */
static int now(int counts, int needs_room) {
    if (!counts) return 0;
    count++;
    if (count == at && how == KILLS_BEFORE) kill(getpid(), SIGKILL);
    if ((count == at && how == FAILS) || (at && count >= at && how == FAILS_ON && needs_room)) {
        errno = error_number;
        return 1;
    }
    return 0;
}
static void behind(int counts) {
    if (counts && count == at && how == KILLS_AFTER) kill(getpid(), SIGKILL);
}
static size_t part(int counts, size_t size) { return counts && count == at && how == HALF && size > 1 ? size / 2 : size; }

#define REAL(type, name, ...) static type (*real)(__VA_ARGS__); if (!real) *(void **)&real = dlsym(RTLD_NEXT, #name)
#define OPENING(name) \
    int name(const char *path, int flags, ...) { \
        REAL(int, name, const char *, int, ...); \
        va_list rest; va_start(rest, flags); mode_t mode = va_arg(rest, mode_t); va_end(rest); \
        int c = below(path); if (now(c, flags & O_CREAT)) return -1; \
        int r = real(path, flags, mode); behind(c); return r; }
OPENING(open)
OPENING(open64)

ssize_t write(int fd, const void *data, size_t size) {
    REAL(ssize_t, write, int, const void *, size_t);
    int c = below_fd(fd);
    if (now(c, 1)) return -1;
    ssize_t r = real(fd, data, part(c, size));
    behind(c);
    return r;
}
#define PWRITING(name) \
    ssize_t name(int fd, const void *data, size_t size, off_t where) { \
        REAL(ssize_t, name, int, const void *, size_t, off_t); int c = below_fd(fd); if (now(c, 1)) return -1; \
        ssize_t r = real(fd, data, part(c, size), where); behind(c); return r; }
PWRITING(pwrite)
PWRITING(pwrite64)
#define READING(name) \
    ssize_t name(int fd, void *data, size_t size) { \
        REAL(ssize_t, name, int, void *, size_t); int c = below_fd(fd); if (now(c, 0)) return -1; \
        ssize_t r = real(fd, data, size); behind(c); return r; }
READING(read)
int fsync(int fd) {
    REAL(int, fsync, int);
    int c = below_fd(fd);
    if (now(c, 0)) return -1;
    int r = real(fd);
    behind(c);
    return r;
}
#define TRUNCATING(name) \
    int name(int fd, off_t size) { REAL(int, name, int, off_t); int c = below_fd(fd); if (now(c, 0)) return -1; \
        int r = real(fd, size); behind(c); return r; }
TRUNCATING(ftruncate)
TRUNCATING(ftruncate64)
int flock(int fd, int what) {
    REAL(int, flock, int, int);
    int c = below_fd(fd);
    if (now(c, 0)) return -1;
    int r = real(fd, what);
    behind(c);
    return r;
}
int rename(const char *from, const char *to) {
    REAL(int, rename, const char *, const char *);
    int c = below(to);
    if (now(c, 0)) return -1;
    int r = real(from, to);
    behind(c);
    return r;
}
int unlink(const char *path) {
    REAL(int, unlink, const char *);
    int c = below(path);
    if (now(c, 0)) return -1;
    int r = real(path);
    behind(c);
    return r;
}
int mkdir(const char *path, mode_t mode) {
    REAL(int, mkdir, const char *, mode_t);
    int c = below(path);
    if (now(c, 1)) return -1;
    int r = real(path, mode);
    behind(c);
    return r;
}
int chmod(const char *path, mode_t mode) {
    REAL(int, chmod, const char *, mode_t);
    int c = below(path);
    if (now(c, 0)) return -1;
    int r = real(path, mode);
    behind(c);
    return r;
}
