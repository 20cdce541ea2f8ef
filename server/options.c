#include "server/options.h"
#include "server/log.h"

#include <assert.h>
#include <ctype.h>
#include <errno.h>
#include <ini.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum kind { KIND_STRING, KIND_DOUBLE, KIND_INT };

struct option {
	const char *name; /* --NAME, WELKIN_NAME, NAME = … */
	enum kind kind;
	size_t offset, size;
	const char *fallback;
	double min, max;
	const char *argument, *help;
};

#define STRING(field) KIND_STRING, offsetof(struct options, field), sizeof((struct options *)0)->field
#define DOUBLE(field) KIND_DOUBLE, offsetof(struct options, field), sizeof(double)
#define INT(field) KIND_INT, offsetof(struct options, field), sizeof(int)

static const struct option table[] = {
	{ "listen", STRING(listen), "127.0.0.1:8080", 0, 0, "ADDR:PORT",
		"where to serve; port 0 picks a free one; IPv6 as [::1]:8080" },
	{ "admin", STRING(admin), "127.0.0.1:8081", 0, 0, "ADDR:PORT",
		"where /livez, /readyz and /metrics are served" },
	{ "config", STRING(config), "", 0, 0, "FILE", "configuration file: lines of NAME = VALUE, names as here" },
	{ "device", STRING(device), "auto", 0, 0, "auto|software|N",
		"device to render on; N as `welkin devices` counts" },
	{ "shader-dir", STRING(shader_dir), "", 0, 0, "DIR", "read shaders from DIR instead of the built-in ones" },
	{ "method-dir", STRING(method_dir), "", 0, 0, "DIR", "methods of your own: each NAME.glsl in DIR is one" },
	{ "scene-dir", STRING(scene_dir), "", 0, 0, "DIR", "scenes of your own: each folder in DIR is one" },
	{ "renderer", STRING(renderer), "", 0, 0, "PROGRAM",
		"program to start as the renderer process instead of this one" },
	{ "log-level", STRING(log_level), "info", 0, 0, "LEVEL", "error, warn, info or debug" },
	{ "max-pixels", DOUBLE(max_pixels), "33.6e6", 1, 268435456, "N", "largest image, width x height" },
	{ "max-frames", INT(max_frames), "1000", 1, 65536, "N", "longest sequence, in frames" },
	{ "max-sequence-pixels", DOUBLE(max_sequence_pixels), "1e9", 1, 1e15, "N",
		"largest sequence, in pixels of all its frames" },
	{ "max-sequences", INT(max_sequences), "8", 1, 1024, "N", "sequences under way at once; more get 429" },
	{ "deadline-s", DOUBLE(deadline_s), "60", 0.05, 86400, "S",
		"longest time from a request to its answer; then 504" },
	{ "watchdog-s", DOUBLE(watchdog_s), "10", 0.5, 3600, "S",
		"a renderer silent for that long is killed and replaced" },
	{ "drain-s", DOUBLE(drain_s), "30", 0, 3600, "S", "longest wait for requests in flight after SIGTERM" },
	{ "probe-s", DOUBLE(probe_s), "5", 0.1, 3600, "S", "period of the small render behind /readyz" },
	{ "header-deadline-s", DOUBLE(header_deadline_s), "10", 0.1, 3600, "S",
		"longest time for a request's line and headers" },
	{ "body-deadline-s", DOUBLE(body_deadline_s), "30", 0.1, 3600, "S", "longest time for a request's body" },
	{ "idle-deadline-s", DOUBLE(idle_deadline_s), "60", 0.1, 86400, "S",
		"a kept-alive connection without a request is closed after that" },
	{ "reply-deadline-s", DOUBLE(reply_deadline_s), "120", 0.1, 86400, "S",
		"longest time for a client to take its answer" },
	{ "queue", INT(queue), "256", 1, 65536, "N", "renders that may wait; more get 429" },
	{ "in-flight", INT(in_flight), "4", 1, 16, "N",
		"renders handed to the renderer at once; half of them may be large" },
	{ "slice-ms", DOUBLE(slice_ms), "8", 0.1, 1000, "MS",
		"aimed length of one dispatch between two looks for other work" },
	{ "cache-mib", INT(cache_mib), "256", 0, 1048576, "MIB", "memory for encoded images; 0 keeps none" },
	{ "table-mib", INT(table_mib), "256", 1, 1048576, "MIB", "memory for tables on the device" },
	{ "encoders", INT(encoders), "0", 0, 256, "N", "encoder threads; 0 for one per processor" },
	{ "max-connections", INT(max_connections), "1024", 4, 65536, "N",
		"open connections; more wait in the backlog" },
	{ "max-body-kib", INT(max_body_kib), "2048", 1, 1048576, "KIB", "largest request body; more gets 413" },
	{ "scene-mib", INT(scene_mib), "512", 1, 1048576, "MIB",
		"memory for meshes of scenes, in the server and as much again in the renderer" },
	{ "scene-triangles", INT(scene_triangles), "4000000", 1, 100000000, "N", "largest scene" },
	{ "scene-texture", INT(scene_texture), "8192", 1, 16384, "PX",
		"longest side of a scene's texture or height map" },
	{ "scene-file-mib", INT(scene_file_mib), "1024", 1, 1048576, "MIB",
		"largest files of a scene together, unpacked" },
	{ "loader-mib", INT(loader_mib), "3072", 64, 1048576, "MIB",
		"address space of the process that reads a scene" },
	{ "loader-s", DOUBLE(loader_s), "60", 0.1, 3600, "S", "longest time to read a scene" },
	{ "uploads", INT(uploads), "0", 0, 512, "N",
		"scenes uploaded by clients that are kept at a time; 0 takes none" },
	{ "upload-mib", INT(upload_mib), "64", 1, 1024, "MIB", "largest upload; more gets 413" },
};
enum { OPTION_COUNT = sizeof table / sizeof *table };
static_assert(OPTION_COUNT <= sizeof((struct options *)0)->origin / sizeof(char *), "options.origin is too short");

static int option_find(const char *name, size_t length)
{
	for (int i = 0; i < OPTION_COUNT; i++)
		if (strlen(table[i].name) == length && !memcmp(table[i].name, name, length))
			return i;
	return -1;
}

/* `shown` is how the user wrote the name: --queue, WELKIN_QUEUE or queue. */
static bool option_set(
	struct options *options, int i, const char *shown, const char *value, const char *origin, struct error *err)
{
	const struct option *o = &table[i];
	char *field = (char *)options + o->offset;
	if (o->kind == KIND_STRING) {
		if (strlen(value) >= o->size)
			return error_set(err, "%s: longer than %zu bytes", shown, o->size - 1);
		strcpy(field, value);
	} else {
		char *end;
		errno = 0;
		const double number = strtod(value, &end);
		if (end == value || *end || !isfinite(number))
			return error_set(err, "%s: \"%s\" is not a number", shown, value);
		if (number < o->min || number > o->max)
			return error_set(err, "%s: %s is outside %.10g to %.10g", shown, value, o->min, o->max);
		if (o->kind == KIND_INT && number != floor(number))
			return error_set(err, "%s: %s is not a whole number", shown, value);
		if (o->kind == KIND_INT)
			*(int *)(void *)field = (int)number;
		else
			*(double *)(void *)field = number;
	}
	options->origin[i] = origin;
	return true;
}

static void environment_name(const char *name, char out[64])
{
	int n = snprintf(out, 64, "WELKIN_%s", name);
	for (int i = 0; i < n; i++)
		out[i] = out[i] == '-' ? '_' : (char)toupper((unsigned char)out[i]);
}

static bool load_environment(struct options *options, struct error *err)
{
	for (int i = 0; i < OPTION_COUNT; i++) {
		char name[64];
		environment_name(table[i].name, name);
		const char *value = getenv(name);
		if (value && !option_set(options, i, name, value, "environment", err))
			return false;
	}
	return true;
}

struct file_reader {
	struct options *options;
	struct error *err;
	bool failed;
};

static int read_pair(void *cls, const char *section, const char *name, const char *value)
{
	struct file_reader *reader = cls;
	const int i = option_find(name, strlen(name));
	if (reader->failed)
		return 0;
	if (*section && strcmp(section, "welkin"))
		reader->failed = !error_set(reader->err, "unknown section [%s]", section);
	else if (i < 0 || !strcmp(name, "config"))
		reader->failed = !error_set(reader->err, "unknown option \"%s\"", name);
	else
		reader->failed = !option_set(reader->options, i, name, value, "file", reader->err);
	return !reader->failed;
}

static bool load_file(struct options *options, const char *path, struct error *err)
{
	struct error why = { { 0 } };
	struct file_reader reader = { options, &why, false };
	errno = 0;
	const int line = ini_parse(path, read_pair, &reader);
	if (line < 0)
		return error_set(err, "configuration file %s: %s", path, errno ? strerror(errno) : "can't be read");
	if (line > 0)
		return error_set(err, "configuration file %s, line %d: %s", path, line,
			reader.failed ? why.text : "not NAME = VALUE");
	return true;
}

/* Walks the command line. With only_config it just looks for --config, which has to be known
 * before the file can be read, and the file before the rest is laid over it. */
static bool load_arguments(struct options *options, int argc, char **argv, bool only_config, struct error *err)
{
	for (int a = 0; a < argc; a++) {
		const char *argument = argv[a];
		if (!strcmp(argument, "--print-config") || !strcmp(argument, "--help") || !strcmp(argument, "-h")) {
			if (argument[2] == 'p')
				options->print_config = true;
			else
				options->help = true;
			continue;
		}
		if (strncmp(argument, "--", 2) || !argument[2])
			return error_set(err, "unexpected argument \"%s\"", argument);
		const char *equals = strchr(argument, '=');
		const size_t length = equals ? (size_t)(equals - argument) - 2 : strlen(argument) - 2;
		const int i = option_find(argument + 2, length);
		if (i < 0)
			return error_set(err, "unknown option %.*s", (int)length + 2, argument);
		const char *value = equals ? equals + 1 : a + 1 < argc ? argv[++a] : NULL;
		if (!value)
			return error_set(err, "--%s needs a value (%s)", table[i].name, table[i].argument);
		char shown[64];
		snprintf(shown, sizeof shown, "--%s", table[i].name);
		if ((!only_config || !strcmp(table[i].name, "config")) &&
			!option_set(options, i, shown, value, "command line", err))
			return false;
	}
	return true;
}

bool options_load(struct options *options, int argc, char **argv, struct error *err)
{
	memset(options, 0, sizeof *options);
	for (int i = 0; i < OPTION_COUNT; i++) {
		const bool sound = option_set(options, i, table[i].name, table[i].fallback, "default", err);
		assert(sound);
		if (!sound)
			return false;
	}
	const char *config = getenv("WELKIN_CONFIG");
	struct options first = *options;
	if (!load_arguments(&first, argc, argv, true, err))
		return false;
	if (first.config[0])
		config = first.config;
	if (config && *config && !load_file(options, config, err))
		return false;
	if (!load_environment(options, err) || !load_arguments(options, argc, argv, false, err))
		return false;
	const char *levels[] = { "error", "warn", "info", "debug", NULL };
	int level = 0;
	while (levels[level] && strcmp(levels[level], options->log_level))
		level++;
	if (!levels[level])
		return error_set(err, "log-level: \"%s\" is not error, warn, info or debug", options->log_level);
	if (strcmp(options->device, "auto") && strcmp(options->device, "software") &&
		(!*options->device || strspn(options->device, "0123456789") != strlen(options->device)))
		return error_set(err, "device: \"%s\" is not auto, software or a number", options->device);
	return true;
}

void options_print(const struct options *options, FILE *out)
{
	for (int i = 0; i < OPTION_COUNT; i++) {
		const struct option *o = &table[i];
		const char *field = (const char *)options + o->offset;
		char value[520];
		if (o->kind == KIND_STRING)
			snprintf(value, sizeof value, "%s", field);
		else if (o->kind == KIND_INT)
			snprintf(value, sizeof value, "%d", *(const int *)(const void *)field);
		else
			snprintf(value, sizeof value, "%.10g", *(const double *)(const void *)field);
		fprintf(out, "%-18s = %-24s ; %s\n", o->name, value, options->origin[i]);
	}
}

void options_help(FILE *out)
{
	for (int i = 0; i < OPTION_COUNT; i++) {
		const struct option *o = &table[i];
		char left[64], environment[64];
		environment_name(o->name, environment);
		snprintf(left, sizeof left, "--%s %s", o->name, o->argument);
		fprintf(out, "  %-30s %s (default: %s; %s)\n", left, o->help, *o->fallback ? o->fallback : "none",
			environment);
	}
	fprintf(out, "  %-30s show every option, its value and where it came from, and exit\n", "--print-config");
}
