/* What a process can still do once it has given up the rest: each attempt in a process of its own. */
#include "server/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#if defined(__SANITIZE_ADDRESS__)
enum { SANITIZED = 1 };
#else
enum { SANITIZED = 0 };
#endif

enum { FINE = 0, DENIED = 40, NO_SANDBOX = 41 };

static int memfd;

/* The status in which a process ends that enters the sandbox and does that. */
static int attempt(int (*act)(void))
{
	int status = 0;
	const pid_t pid = fork();
	if (!pid) {
		struct error err;
		_exit(sandbox_enter((size_t)256 << 20, 1 << 20, 1, &err) ? act() : NO_SANDBOX);
	}
	assert_true(pid > 0);
	assert_int_equal(waitpid(pid, &status, 0), pid);
	return status;
}

static void expect_exit(int (*act)(void), int wanted)
{
	const int status = attempt(act);
	if (!WIFEXITED(status) || WEXITSTATUS(status) != wanted)
		fail_msg("%s %d, not exit %d", WIFEXITED(status) ? "exit" : "signal",
			WIFEXITED(status) ? WEXITSTATUS(status) : WTERMSIG(status), wanted);
}

static void expect_signal(int (*act)(void), int wanted)
{
	const int status = attempt(act);
	if (!WIFSIGNALED(status) || WTERMSIG(status) != wanted)
		fail_msg("%s %d, not signal %d", WIFEXITED(status) ? "exit" : "signal",
			WIFEXITED(status) ? WEXITSTATUS(status) : WTERMSIG(status), wanted);
}

static int compute(void)
{
	char *memory = malloc(32 << 20);
	if (!memory)
		return 1;
	memset(memory, 1, 32 << 20);
	if (ftruncate(memfd, 4096) || pwrite(memfd, memory, 64, 0) != 64)
		return 2;
	void *map = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, memfd, 0);
	return map == MAP_FAILED ? 3 : FINE;
}

static int open_file(void)
{
	return open("/etc/passwd", O_RDONLY) < 0 && errno == EACCES ? DENIED : FINE;
}

static int make_file(void)
{
	return open("/tmp/welkin-sandbox", O_CREAT | O_WRONLY, 0600) < 0 && errno == EACCES ? DENIED : FINE;
}

static int make_socket(void)
{
	return socket(AF_INET, SOCK_STREAM, 0) < 0 ? DENIED : FINE;
}

static int make_process(void)
{
	return fork() < 0 ? DENIED : FINE;
}

static int run_program(void)
{
	char *const none[] = { NULL };
	return execve("/bin/true", none, none) ? DENIED : FINE;
}

static int kill_parent(void)
{
	return kill(getppid(), 0) ? DENIED : FINE;
}

static int executable_memory(void)
{
	return mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED ? DENIED
													 : FINE;
}

static int make_executable(void)
{
	void *map = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
	return mprotect(map, 4096, PROT_READ | PROT_EXEC) ? DENIED : FINE;
}

static int too_much_memory(void)
{
	return mmap(NULL, (size_t)512 << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED
		       ? DENIED
		       : FINE;
}

static int large_file(void)
{
	return ftruncate(memfd, 64 << 20) ? DENIED : FINE;
}

static int spin(void)
{
	for (volatile bool more = true; more;)
		;
	return FINE;
}

static void computing_works(void **state)
{
	(void)state;
	expect_exit(compute, FINE);
}

static void nothing_else_does(void **state)
{
	(void)state;
	expect_exit(open_file, DENIED);
	expect_exit(make_file, DENIED);
	expect_signal(make_socket, SIGSYS);
	expect_signal(make_process, SIGSYS);
	expect_signal(run_program, SIGSYS);
	expect_signal(kill_parent, SIGSYS);
	expect_signal(executable_memory, SIGSYS);
	expect_signal(make_executable, SIGSYS);
}

static void limits_hold(void **state)
{
	(void)state;
	expect_signal(large_file, SIGXFSZ);
	expect_signal(spin, SIGXCPU);
	if (!SANITIZED)
		expect_exit(too_much_memory, DENIED);
}

static int start(void **state)
{
	(void)state;
	memfd = memfd_create("sandbox", 0);
	return memfd < 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(computing_works),
		cmocka_unit_test(nothing_else_does),
		cmocka_unit_test(limits_hold),
	};
	return cmocka_run_group_tests(tests, start, NULL);
}
