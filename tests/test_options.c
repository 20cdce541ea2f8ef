/* Options of `serve`: every source, who wins, every kind of mistake, and the same seen from outside. */
#include "server/options.h"
#include "tests/lib_http.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static struct error err;

static bool load(struct options *o, ...)
{
	char *argv[32];
	int argc = 0;
	va_list args;
	va_start(args, o);
	for (char *a; (a = va_arg(args, char *)) && argc < 32;)
		argv[argc++] = a;
	va_end(args);
	err.text[0] = 0;
	return options_load(o, argc, argv, &err);
}

static void write_file(char path[64], const char *text)
{
	strcpy(path, "/tmp/welkin-options-XXXXXX");
	const int fd = mkstemp(path);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, strlen(text)), strlen(text));
	close(fd);
}

static void defaults(void **state)
{
	struct options o;
	(void)state;
	assert_true(load(&o, NULL));
	assert_string_equal(o.listen, "127.0.0.1:8080");
	assert_string_equal(o.admin, "127.0.0.1:8081");
	assert_string_equal(o.device, "auto");
	assert_true(o.max_pixels == 33.6e6);
	assert_false(o.print_config);
}

static void command_line_wins_over_environment_over_file(void **state)
{
	struct options o;
	char path[64], argument[80];
	(void)state;
	write_file(path, "; a comment\nqueue = 11\ncache-mib = 12\ntable-mib = 13\n");
	snprintf(argument, sizeof argument, "--config=%s", path);
	setenv("WELKIN_CACHE_MIB", "22", 1);
	setenv("WELKIN_TABLE_MIB", "23", 1);
	assert_true(load(&o, argument, "--table-mib", "33", NULL));
	assert_int_equal(o.queue, 11);
	assert_int_equal(o.cache_mib, 22);
	assert_int_equal(o.table_mib, 33);
	/* The file may also be named by the environment. */
	setenv("WELKIN_CONFIG", path, 1);
	assert_true(load(&o, NULL));
	assert_int_equal(o.queue, 11);
	unsetenv("WELKIN_CONFIG");
	unsetenv("WELKIN_CACHE_MIB");
	unsetenv("WELKIN_TABLE_MIB");
	unlink(path);
}

static void refuse(const char *a, const char *b, const char *expected)
{
	struct options o;
	assert_false(load(&o, a, b, NULL));
	if (!strstr(err.text, expected))
		fail_msg("%s %s: \"%s\" does not say \"%s\"", a, b ? b : "", err.text, expected);
	assert_null(strchr(err.text, '\n'));
}

static void mistakes_are_named(void **state)
{
	(void)state;
	refuse("--qeue", "3", "unknown option --qeue");
	refuse("--queue", NULL, "--queue needs a value");
	refuse("--queue", "many", "--queue: \"many\" is not a number");
	refuse("--queue", "1.5", "not a whole number");
	refuse("--queue=0", NULL, "outside 1 to 65536");
	refuse("--queue=nan", NULL, "not a number");
	refuse("--max-pixels=1e999", NULL, "not a number");
	refuse("--queue=3x", NULL, "not a number");
	refuse("--queue=", NULL, "not a number");
	refuse("serve", NULL, "unexpected argument");
	refuse("--device=gpu", NULL, "not auto, software or a number");
	refuse("--log-level=loud", NULL, "not error, warn");
	refuse("--config", "/nonexistent/welkin.conf", "/nonexistent/welkin.conf");
	char longer[200];
	memset(longer, 'x', sizeof longer);
	memcpy(longer, "--listen=", 9);
	longer[199] = 0;
	refuse(longer, NULL, "longer than");
	setenv("WELKIN_QUEUE", "-1", 1);
	refuse("--cache-mib", "1", "WELKIN_QUEUE: -1 is outside");
	unsetenv("WELKIN_QUEUE");
}

static void mistakes_in_a_file_name_the_line(void **state)
{
	static const struct {
		const char *text, *expected;
	} files[] = { { "queue = 5\nqeue = 6\n", "line 2: unknown option \"qeue\"" },
		{ "queue = x\n", "line 1: queue: \"x\"" },
		{ "queue = 5\n\n[other]\nqueue = 6\n", "unknown section [other]" },
		{ "what is this\n", "line 1: not NAME = VALUE" }, { "config = x\n", "unknown option \"config\"" } };
	(void)state;
	for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
		char path[64];
		write_file(path, files[i].text);
		refuse("--config", path, files[i].expected);
		unlink(path);
	}
}

/* ---- the binary ---- */

static void expect_run(const char *const arguments[], int status, const char *expected, int lines)
{
	char *output;
	int n = 0;
	const int got = daemon_run(arguments, &output);
	if (got != status || !strstr(output, expected))
		fail_msg("status %d, output: %s", got, output);
	for (const char *c = output; *c; c++)
		n += *c == '\n';
	if (lines)
		assert_int_equal(n, lines);
	free(output);
}

#define RUN(status, expected, lines, ...)                                                                              \
	expect_run((const char *const[]){ __VA_ARGS__, NULL }, status, expected, lines)

static void exit_status_tells(void **state)
{
	(void)state;
	RUN(2, "unknown option --nonsense", 1, "serve", "--nonsense", "1");
	RUN(2, "listen: \"localhost\" is not ADDR:PORT", 1, "serve", "--listen", "localhost");
	RUN(2, "admin: \"x\" is not ADDR:PORT", 1, "serve", "--listen", "127.0.0.1:0", "--admin", "x");
	RUN(2, "port is not a number", 1, "serve", "--listen", "127.0.0.1:http");
	RUN(2, "in brackets", 1, "serve", "--listen", "::1:8080");
	RUN(2, "65535", 1, "serve", "--listen", "127.0.0.1:70000");
	RUN(2, "unknown command", 1, "server");
	RUN(2, "unknown command \"\"", 1, "");
	RUN(0, "welkin 0.", 1, "--version");
	RUN(0, "welkin serve", 0, "--help");
	RUN(0, "--max-pixels", 0, "serve", "--help");
	RUN(0, "depth_table", 0, "methods");
}

static void print_config_names_origins(void **state)
{
	char path[64], *output;
	(void)state;
	write_file(path, "[welkin]\nqueue = 77\n");
	setenv("WELKIN_DEVICE", "software", 1);
	const char *const arguments[] = { "serve", "--config", path, "--cache-mib", "5", "--print-config", NULL };
	assert_int_equal(daemon_run(arguments, &output), 0);
	unsetenv("WELKIN_DEVICE");
	unlink(path);
	static const struct {
		const char *name, *value, *origin;
	} rows[] = { { "queue", "77", "file" }, { "device", "software", "environment" },
		{ "cache-mib", "5", "command line" }, { "listen", "127.0.0.1:8080", "default" } };
	for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
		char start[64];
		snprintf(start, sizeof start, "\n%-18s = %s ", rows[i].name, rows[i].value);
		const char *at = *output ? strstr(output, start + (i == 3)) : NULL;
		if (!at || !strstr(at, "; ") || strncmp(strstr(at, "; ") + 2, rows[i].origin, strlen(rows[i].origin)))
			fail_msg("%s: not %s from %s in\n%s", rows[i].name, rows[i].value, rows[i].origin, output);
	}
	free(output);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(defaults),
		cmocka_unit_test(command_line_wins_over_environment_over_file),
		cmocka_unit_test(mistakes_are_named),
		cmocka_unit_test(mistakes_in_a_file_name_the_line),
		cmocka_unit_test(exit_status_tells),
		cmocka_unit_test(print_config_names_origins),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
