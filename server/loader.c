#include "server/loader.h"
#include "api/text.h"
#include "server/clock.h"
#include "server/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

enum { BUNDLE_FD = 3, MESH_FD = 4, REPLY_FD = 5, ABOVE_THEM = 10 };

/* What the process says beside the mesh; all zero while it has said nothing. */
struct reply {
	int32_t said, sound;
	char message[512];
	struct scene_about about;
};

/* ---- in the process ---- */

static _Noreturn void say(struct reply *reply, bool sound, const char *message)
{
	reply->said = 1;
	reply->sound = sound;
	snprintf(reply->message, sizeof reply->message, "%s", message);
	const ssize_t n = pwrite(REPLY_FD, reply, sizeof *reply, 0);
	_exit(n == (ssize_t)sizeof *reply ? 0 : 1);
}

static bool build_scene(const void *bundle, size_t size, struct reply *reply, struct error *err)
{
	const struct bundle_header *header = bundle;
	struct scene_files files;
	struct mesh_build build = { 0 };
	if (!scene_files_open(&files, bundle, size, err))
		return false;
	build.limits = header->limits;
	const bool made = header->kind == BUNDLE_BUILTIN
				  ? files.n == 1 && scene_make(files.list[0].name, &build, &reply->about, err)
				  : scene_parse(&files, &build, &reply->about, err);
	/* nothing is freed: the process ends here */
	return made && mesh_build_write(&build, MESH_FD, header->key, err);
}

_Noreturn void loader_command(int argc, char **argv)
{
	static struct reply reply;
	struct error err = { "" };
	struct stat st;
	const size_t memory = argc > 1 ? strtoull(argv[1], NULL, 10) : 0;
	const unsigned seconds = argc > 2 ? (unsigned)atoi(argv[2]) : 0;
	if (!memory || !seconds || fstat(REPLY_FD, &st) || fstat(BUNDLE_FD, &st)) {
		fprintf(stderr, "welkin loader: started by `welkin serve` and `welkin render` only\n");
		_exit(2);
	}
	prctl(PR_SET_PDEATHSIG, SIGKILL);
	prctl(PR_SET_NAME, "welkin-loader");
	syscall(SYS_close_range, REPLY_FD + 1, ~0U, 0);
	const void *bundle = mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_SHARED, BUNDLE_FD, 0);
	if (bundle == MAP_FAILED || st.st_size < (off_t)sizeof(struct bundle_header))
		say(&reply, false, "the bundle can't be read");
	const uint64_t most = ((const struct bundle_header *)bundle)->limits.max_bytes + sizeof reply;
	if (!sandbox_enter(memory, most, seconds, &err) || !build_scene(bundle, (size_t)st.st_size, &reply, &err))
		say(&reply, false, err.text);
	say(&reply, true, "");
}

/* ---- in the server ---- */

/* A copy above the numbers that the process expects, so that putting one in its place cannot hit another. */
static int above(int fd)
{
	return fcntl(fd, F_DUPFD_CLOEXEC, ABOVE_THEM);
}

static bool spawn_loader(const struct loader_config *config, const int fds[3], pid_t *pid, struct error *err)
{
	char memory[32], seconds[32];
	const char *program = config->program && *config->program ? config->program : "/proc/self/exe";
	snprintf(memory, sizeof memory, "%zu", config->memory_bytes);
	snprintf(seconds, sizeof seconds, "%d", (int)ceil(config->timeout_s));
	const char *const argv[] = { "welkin-loader", "loader", memory, seconds, NULL };
	/* It allocates and frees hundreds of thousands of small blocks: with large pages, and without giving them back
	 * in between, that takes half the time (Fuji on two cores: 150 ms of processor time, else 330). */
	static const char *const environment[] = {
		"GLIBC_TUNABLES=glibc.malloc.hugetlb=1:glibc.malloc.mmap_threshold=1073741824:"
		"glibc.malloc.top_pad=16777216:glibc.malloc.trim_threshold=4294967296",
		NULL
	};
	posix_spawn_file_actions_t actions;
	posix_spawnattr_t attributes;
	sigset_t none, defaults;
	sigemptyset(&none);
	sigemptyset(&defaults);
	sigaddset(&defaults, SIGPIPE);
	posix_spawn_file_actions_init(&actions);
	posix_spawnattr_init(&attributes);
	posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
	posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
	for (int i = 0; i < 3; i++)
		posix_spawn_file_actions_adddup2(&actions, fds[i], BUNDLE_FD + i);
	posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
	posix_spawnattr_setsigmask(&attributes, &none);
	posix_spawnattr_setsigdefault(&attributes, &defaults);
	posix_spawnattr_setpgroup(&attributes, 0);
	const int status =
		posix_spawn(pid, program, &actions, &attributes, (char *const *)argv, (char *const *)environment);
	posix_spawnattr_destroy(&attributes);
	posix_spawn_file_actions_destroy(&actions);
	return !status || error_set(err, "can't start the loader: %s", strerror(status));
}

/* Waits for its end and kills it when it takes too long. */
static int wait_for_end(const struct loader_config *config, pid_t pid, const char **killed)
{
	const int pid_fd = (int)syscall(SYS_pidfd_open, pid, 0);
	struct pollfd fds[] = { { .fd = pid_fd, .events = POLLIN }, { .fd = config->cancel_fd, .events = POLLIN } };
	const int64_t end_us = clock_us() + (int64_t)(config->timeout_s * 1e6);
	int status = 0, ready = 0;
	*killed = NULL;
	while (pid_fd >= 0 && !ready && clock_us() < end_us)
		ready = poll(fds, 2, (int)((end_us - clock_us()) / 1000) + 1);
	if (pid_fd < 0 || !(fds[0].revents & POLLIN)) {
		*killed = ready > 0 ? "the server stops" : "it takes too long to read";
		kill(pid, SIGKILL);
	}
	while (waitpid(pid, &status, 0) < 0 && errno == EINTR)
		;
	if (pid_fd >= 0)
		close(pid_fd);
	return status;
}

/* What came from a process that may have been taken over: only sound values get through. */
static void check_text(char *text, size_t size)
{
	text[size - 1] = 0;
	if (utf8_check(text, strlen(text)) < strlen(text))
		text[0] = 0;
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < 0x20 || *c == 0x7F)
			*c = '?';
}

static void check_number(double *value, double least, double most)
{
	if (!(*value >= least && *value <= most))
		*value = NAN;
}

static void check_about(struct scene_about *a)
{
	check_number(&a->latitude_deg, -90, 90);
	check_number(&a->longitude_deg, -180, 180);
	check_number(&a->altitude_m, -1e6, 1e6);
	check_number(&a->heading_deg, -360, 360);
	check_number(&a->scale, 1e-4, 1e4);
	check_text(a->title, sizeof a->title);
	check_text(a->licence, sizeof a->licence);
	check_text(a->source, sizeof a->source);
	for (int i = 0; i < SCENE_MATERIALS_LISTED; i++)
		check_text(a->materials[i], sizeof a->materials[i]);
}

/* The process is gone, so sealing leaves nobody who could change the mesh behind our back. */
static bool check_mesh(int fd, const char key[33], struct error *err)
{
	struct stat st;
	if (fcntl(fd, F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) || fstat(fd, &st) ||
		st.st_size < (off_t)sizeof(struct mesh_header))
		return error_set(err, "the loader gave no mesh");
	void *map = mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_SHARED, fd, 0);
	if (map == MAP_FAILED)
		return error_set(err, "no memory for the mesh: %s", strerror(errno));
	const bool sound = mesh_valid(map, (size_t)st.st_size) && !strcmp(((const struct mesh_header *)map)->key, key);
	munmap(map, (size_t)st.st_size);
	return sound || error_set(err, "the loader gave something that is not a mesh");
}

static enum loaded judge(int status, const char *killed, struct reply *reply, struct error *err)
{
	check_text(reply->message, sizeof reply->message);
	if (killed)
		error_set(err, "%s", killed);
	else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
		error_set(err, "it takes too long to read");
	else if (WIFSIGNALED(status))
		error_set(err, "reading it failed: the loader was ended by signal %d", WTERMSIG(status));
	else if (!reply->said)
		error_set(err, "reading it failed: the loader exited with status %d", WEXITSTATUS(status));
	else if (reply->sound)
		return LOADED;
	else
		error_set(err, "%s", reply->message);
	return reply->said && !killed ? LOAD_FAULT : LOAD_FAILED;
}

static enum loaded run_with(const struct loader_config *config, const int fds[3], const char key[33],
	struct scene_about *about, struct error *err)
{
	struct reply reply = { 0 };
	const char *killed;
	pid_t pid;
	if (!spawn_loader(config, fds, &pid, err))
		return LOAD_FAILED;
	const int status = wait_for_end(config, pid, &killed);
	if (pread(fds[2], &reply, sizeof reply, 0) != (ssize_t)sizeof reply)
		reply.said = 0;
	const enum loaded loaded = judge(status, killed, &reply, err);
	if (loaded != LOADED)
		return loaded;
	*about = reply.about;
	check_about(about);
	return check_mesh(fds[1], key, err) ? LOADED : LOAD_FAILED;
}

enum loaded loader_run(const struct loader_config *config, int bundle_fd, const char key[33], int *mesh_fd,
	struct scene_about *about, struct error *err)
{
	const int mesh = memfd_create("welkin-mesh", MFD_CLOEXEC | MFD_ALLOW_SEALING);
	const int reply = memfd_create("welkin-reply", MFD_CLOEXEC);
	const int fds[3] = { above(bundle_fd), above(mesh), above(reply) };
	enum loaded loaded = LOAD_FAILED;
	if (mesh < 0 || reply < 0 || fds[0] < 0 || fds[1] < 0 || fds[2] < 0)
		error_set(err, "no descriptors: %s", strerror(errno));
	else
		loaded = run_with(config, fds, key, about, err);
	for (int i = 0; i < 3; i++)
		if (fds[i] >= 0)
			close(fds[i]);
	if (reply >= 0)
		close(reply);
	if (loaded == LOADED)
		*mesh_fd = mesh;
	else if (mesh >= 0)
		close(mesh);
	return loaded;
}
