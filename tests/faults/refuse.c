/* Counts the calls of a process that change a folder and what is below, and ends or refuses it at one of them.

   Loaded by LD_PRELOAD, it stands between a program and the C library, and does nothing before refuse_at() is called.
   A refused call does not reach the kernel. A short write does, with half of its bytes. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum kind { CREATE, WRITE, FSYNC, RENAME, LINK, UNLINK, MKDIR, TRUNCATE, N_KINDS };
enum how { NOT, KILL, ONCE, STAYS, SHORT, SHORT_THEN_FAILS };

#define HALF (-1)
#define N_FILES 1024

static char folder[PATH_MAX];
static long at_turn, seen[N_KINDS];
static int at_kind, how, number, log_fd, is_armed, is_next_write_refused, is_all_refused, has_failed[N_FILES];

/* Disturb the turn-th call of a kind below a folder, with an error number where it fails; note every call in a file. */
void refuse_at(const char *below, int kind, long turn, int what, int error, int log)
{
	snprintf(folder, sizeof folder, "%s", below);
	at_kind = kind;
	at_turn = turn;
	how = what;
	number = error;
	log_fd = log;
	is_armed = 1;
}

static void note(int kind, const char *name, const char *path, const char *word)
{
	char line[PATH_MAX + 64];
	int is_main = syscall(SYS_gettid) == getpid();
	int n = snprintf(line, sizeof line, "%d\t%d\t%s\t%s\t%s\n", is_main, kind, name, word, path);
	syscall(SYS_write, log_fd, line, (size_t)n);
}

/* Return 0 when a call shall go on, HALF, or the error it fails with. */
static int fate(int kind, const char *name, const char *path)
{
	int is_it, is_refused;

	if (!is_armed || strncmp(path, folder, strlen(folder)) != 0 || strchr("/", path[strlen(folder)]) == NULL)
		return 0; /* strchr finds the end of a text as well: the folder itself is meant, too */
	if (syscall(SYS_gettid) != getpid()) { /* reported, never disturbed */
		note(kind, name, path, "");
		return 0;
	}
	is_it = ++seen[kind] == at_turn && kind == at_kind && how != NOT;
	is_all_refused |= is_it && how == STAYS;
	is_refused = is_all_refused || (is_it && how == ONCE) || (is_next_write_refused && kind == WRITE);
	note(kind, name, path, is_it ? "struck" : is_refused ? "refused" : "");
	if (is_it && how == KILL) {
		syscall(SYS_kill, getpid(), SIGKILL);
		pause();
	}
	if (is_refused) {
		is_next_write_refused = 0;
		return number;
	}
	is_next_write_refused |= is_it && how == SHORT_THEN_FAILS;
	return is_it && (how == SHORT || how == SHORT_THEN_FAILS) ? HALF : 0;
}

/* Write the path of an open file, or of `path` in an open folder. */
static const char *path_of(int fd, const char *path, char *found)
{
	char link[64];
	ssize_t n = 0;

	if (path != NULL && path[0] == '/')
		return path;
	snprintf(link, sizeof link, fd == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/%d", fd);
	if (is_armed && (n = readlink(link, found, PATH_MAX - 1)) < 0)
		n = 0;
	found[n] = 0;
	if (path != NULL)
		snprintf(found + n, (size_t)(PATH_MAX - n), "/%s", path);
	return found;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define ASK(kind, name, fd, path)                                                                                      \
	char place[PATH_MAX];                                                                                              \
	int told = fate(kind, #name, path_of(fd, path, place))
#define REFUSE_IF_TOLD                                                                                                 \
	if (told > 0) {                                                                                                    \
		errno = told;                                                                                                  \
		return -1;                                                                                                     \
	}
#define SHORTEN(n) (told == HALF && (n) > 1 ? (n) / 2 : (n))

/* Return where it is noted that an fsync of an open file failed. */
static int *failed(int fd)
{
	static int none;

	none = 0;
	return fd >= 0 && fd < N_FILES ? &has_failed[fd] : &none;
}

static int opened(int fd)
{
	*failed(fd) = 0;
	return fd;
}

#define OPEN(name)                                                                                                     \
	int name(const char *path, int flags, ...)                                                                         \
	{                                                                                                                  \
		va_list more;                                                                                                  \
		va_start(more, flags);                                                                                         \
		mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;                                        \
		va_end(more);                                                                                                  \
		if (flags & O_CREAT) {                                                                                         \
			ASK(CREATE, name, AT_FDCWD, path);                                                                         \
			REFUSE_IF_TOLD                                                                                             \
		}                                                                                                              \
		return opened(REAL(name)(path, flags, mode));                                                                  \
	}
#define OPEN_AT(name)                                                                                                  \
	int name(int at, const char *path, int flags, ...)                                                                 \
	{                                                                                                                  \
		va_list more;                                                                                                  \
		va_start(more, flags);                                                                                         \
		mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;                                        \
		va_end(more);                                                                                                  \
		if (flags & O_CREAT) {                                                                                         \
			ASK(CREATE, name, at, path);                                                                               \
			REFUSE_IF_TOLD                                                                                             \
		}                                                                                                              \
		return opened(REAL(name)(at, path, flags, mode));                                                              \
	}
#define PWRITE(name, offset_t)                                                                                         \
	ssize_t name(int fd, const void *data, size_t n, offset_t offset)                                                  \
	{                                                                                                                  \
		ASK(WRITE, name, fd, NULL);                                                                                    \
		REFUSE_IF_TOLD                                                                                                 \
		return REAL(name)(fd, data, SHORTEN(n), offset);                                                               \
	}
#define CALL(kind, name, fd, path, arguments, ...)                                                                     \
	int name(__VA_ARGS__)                                                                                              \
	{                                                                                                                  \
		ASK(kind, name, fd, path);                                                                                     \
		REFUSE_IF_TOLD                                                                                                 \
		return REAL(name) arguments;                                                                                   \
	}
#define SYNC(name)                                                                                                     \
	int name(int fd)                                                                                                   \
	{                                                                                                                  \
		ASK(FSYNC, name, fd, NULL);                                                                                    \
		if (*failed(fd))                                                                                               \
			note(FSYNC, #name, place, "again");                                                                        \
		*failed(fd) = told > 0;                                                                                        \
		REFUSE_IF_TOLD                                                                                                 \
		return REAL(name)(fd);                                                                                         \
	}

OPEN(open)
OPEN(open64)
OPEN_AT(openat)
OPEN_AT(openat64)
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)
SYNC(fsync)
SYNC(fdatasync)
CALL(RENAME, rename, AT_FDCWD, from, (from, to), const char *from, const char *to)
CALL(RENAME, renameat, a, from, (a, from, b, to), int a, const char *from, int b, const char *to)
CALL(RENAME, renameat2, a, from, (a, from, b, to, f), int a, const char *from, int b, const char *to, unsigned f)
CALL(LINK, link, AT_FDCWD, from, (from, to), const char *from, const char *to)
CALL(LINK, linkat, a, from, (a, from, b, to, f), int a, const char *from, int b, const char *to, int f)
CALL(UNLINK, unlink, AT_FDCWD, path, (path), const char *path)
CALL(UNLINK, unlinkat, at, path, (at, path, flags), int at, const char *path, int flags)
CALL(UNLINK, rmdir, AT_FDCWD, path, (path), const char *path)
CALL(MKDIR, mkdir, AT_FDCWD, path, (path, mode), const char *path, mode_t mode)
CALL(MKDIR, mkdirat, at, path, (at, path, mode), int at, const char *path, mode_t mode)
CALL(TRUNCATE, ftruncate, fd, NULL, (fd, n), int fd, off_t n)
CALL(TRUNCATE, ftruncate64, fd, NULL, (fd, n), int fd, off64_t n)
CALL(TRUNCATE, truncate, AT_FDCWD, path, (path, n), const char *path, off_t n)
CALL(TRUNCATE, truncate64, AT_FDCWD, path, (path, n), const char *path, off64_t n)
CALL(TRUNCATE, fallocate, fd, NULL, (fd, mode, a, n), int fd, int mode, off_t a, off_t n)
CALL(TRUNCATE, fallocate64, fd, NULL, (fd, mode, a, n), int fd, int mode, off64_t a, off64_t n)

ssize_t write(int fd, const void *data, size_t n)
{
	ASK(WRITE, write, fd, NULL);
	REFUSE_IF_TOLD
	return REAL(write)(fd, data, SHORTEN(n));
}

ssize_t writev(int fd, const struct iovec *pieces, int n)
{
	ASK(WRITE, writev, fd, NULL);
	REFUSE_IF_TOLD
	if (told == HALF)
		return REAL(write)(fd, pieces[0].iov_base, (pieces[0].iov_len + 1) / 2);
	return REAL(writev)(fd, pieces, n);
}

int posix_fallocate(int fd, off_t from, off_t n)
{
	ASK(TRUNCATE, posix_fallocate, fd, NULL);
	return told > 0 ? told : REAL(posix_fallocate)(fd, from, n);
}

int posix_fallocate64(int fd, off64_t from, off64_t n)
{
	ASK(TRUNCATE, posix_fallocate64, fd, NULL);
	return told > 0 ? told : REAL(posix_fallocate64)(fd, from, n);
}
