/* `welkin render` as a person or a job array calls it: files, faults, exit statuses, and the same bytes
 * as over HTTP. */
#include "tests/lib_http.h"

#include <cjson/cJSON.h>
#include <dirent.h>
#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static char binary[PATH_MAX + 16], folder[] = "/tmp/welkin-render-XXXXXX";

struct ran {
	int status;
	char output[65536]; /* stdout and stderr */
};

/* Runs `welkin render ARGUMENTS` by the shell, in the test's folder. */
static struct ran run(const char *arguments)
{
	struct ran ran = { .status = -1 };
	char line[PATH_MAX + 4096];
	snprintf(line, sizeof line, "cd %s && WELKIN_DEVICE=software timeout 120 %s render %s 2>&1", folder, binary,
		arguments);
	FILE *pipe = popen(line, "r");
	assert_non_null(pipe);
	size_t n = fread(ran.output, 1, sizeof ran.output - 1, pipe);
	ran.output[n] = 0;
	char rest[4096];
	while (fread(rest, 1, sizeof rest, pipe) > 0)
		;
	const int status = pclose(pipe);
	ran.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
	return ran;
}

static struct ran run_well(const char *arguments)
{
	struct ran ran = run(arguments);
	if (ran.status)
		fail_msg("render %s: status %d: %s", arguments, ran.status, ran.output);
	return ran;
}

static void assert_says(const struct ran *ran, const char *part)
{
	if (!strstr(ran->output, part))
		fail_msg("\"%s\" does not say \"%s\"", ran->output, part);
}

static char *contents(const char *name, size_t *size)
{
	char path[PATH_MAX];
	snprintf(path, sizeof path, "%s/%s", folder, name);
	FILE *file = fopen(path, "rb");
	if (!file)
		fail_msg("%s is missing", name);
	char *data = malloc(1 << 22);
	*size = fread(data, 1, (1 << 22) - 1, file);
	data[*size] = 0;
	fclose(file);
	return data;
}

static void write_text(const char *name, const char *text)
{
	char path[PATH_MAX];
	snprintf(path, sizeof path, "%s/%s", folder, name);
	FILE *file = fopen(path, "w");
	fputs(text, file);
	fclose(file);
}

static int files_in_folder(void)
{
	int n = 0;
	DIR *dir = opendir(folder);
	for (struct dirent *e; (e = readdir(dir));)
		n += e->d_name[0] != '.';
	closedir(dir);
	return n;
}

static void test_png_and_exr(void **state)
{
	(void)state;
	write_text("request.json", "{\"image\":{\"width\":40,\"height\":30},\"sun\":{\"elevation_deg\":12}}");
	struct ran ran = run_well("request.json -o a.png");
	assert_says(&ran, "a.png: 40 x 30");
	assert_says(&ran, "encode");
	assert_int_equal(strchr(ran.output, '\n') - ran.output, strlen(ran.output) - 1); /* one line */
	size_t size;
	char *png = contents("a.png", &size);
	assert_memory_equal(png, "\x89PNG", 4);
	free(png);
	run_well("request.json --out=b.exr image.exr_type=float");
	char *exr = contents("b.exr", &size);
	assert_memory_equal(exr, "\x76\x2f\x31\x01", 4);
	free(exr);
}

/* From a file, from standard input, from fields alone, and fields over a file. */
static void test_ways_to_ask(void **state)
{
	(void)state;
	size_t n, m;
	write_text("small.json", "{\"image\":{\"width\":24,\"height\":16},\"sun\":{\"elevation_deg\":7}}");
	run_well("small.json -o one.png");
	char *one = contents("one.png", &n);
	static const char *const others[] = {
		"- -o other.png <small.json",
		"-o other.png image.width=24 image.height=16 sun.elevation_deg=7",
		"small.json sun.elevation_deg=7 -o other.png",
		"-o other.png sun.elevation_deg=7.0 image.height=16 image.width=24",
	};
	for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
		run_well(others[i]);
		char *other = contents("other.png", &m);
		assert_int_equal(n, m);
		assert_memory_equal(one, other, n);
		free(other);
	}
	run_well("small.json sun.elevation_deg=8 -o other.png");
	char *other = contents("other.png", &m);
	assert_true(n != m || memcmp(one, other, n));
	free(other);
	free(one);
}

static void test_same_bytes_as_over_http(void **state)
{
	(void)state;
	static const char *const software[] = { "--device", "software", NULL };
	struct daemon_process *server = daemon_start(false, software);
	for (int exr = 0; exr < 2; exr++) {
		size_t n;
		const char *name = exr ? "same.exr" : "same.png";
		char line[300], path[300];
		snprintf(line, sizeof line,
			"-o %s image.width=64 image.height=48 sun.elevation_deg=3 camera.altitude_m=9000", name);
		run_well(line);
		char *file = contents(name, &n);
		snprintf(path, sizeof path,
			"v1/render.%s?camera.altitude_m=9000&image.height=48&image.width=64&sun.elevation_deg=3",
			name + 5);
		struct http_reply reply = get(server->url, path);
		assert_int_equal(reply.status, 200);
		assert_int_equal(n, reply.size);
		assert_memory_equal(file, reply.body, n);
		reply_finish(&reply);
		free(file);
	}
	daemon_stop(server);
}

static cJSON *json_file(const char *name)
{
	size_t size;
	char *text = contents(name, &size);
	cJSON *json = cJSON_Parse(text);
	if (!json)
		fail_msg("%s is not JSON: %s", name, text);
	free(text);
	return json;
}

/* A scene that is made, one in a folder, one that is not there. */
static void test_scenes(void **state)
{
	(void)state;
	struct ran ran = run_well("-o city.json scene.name=city image.width=32 image.height=16");
	ran = run("-o none.png scene.name=atlantis");
	assert_int_equal(ran.status, 2);
	assert_says(&ran, "scene.name: there is no scene \"atlantis\"");
	assert_says(&ran, "one of city, mountains");
	char command[PATH_MAX + 256];
	snprintf(command, sizeof command,
		"cd %s && mkdir -p scenes/hill scenes/bad && printf 'v 0 9 0\\nv 4 9 0\\nv 0 9 4\\nf 1 3 2\\n' > "
		"scenes/hill/a.obj && echo 'f 1 2 3' > scenes/bad/a.obj",
		folder);
	assert_int_equal(system(command), 0);
	run_well("-o hill.json --scene-dir scenes scene.name=hill image.width=32 image.height=16");
	snprintf(command, sizeof command, "grep -q '\"altitude_m\":10.7,\"above_ground_m\":1.7' %s/hill.json", folder);
	assert_int_equal(system(command), 0);
	ran = run("-o bad.png --scene-dir scenes scene.name=bad");
	assert_int_equal(ran.status, 2);
	assert_says(&ran, "a.obj, line 1: there is no vertex 1");
	ran = run("-o bad.png --scene-dir nowhere scene.name=bad");
	assert_int_equal(ran.status, 2);
	assert_says(&ran, "scene-dir nowhere");
}

static void test_json(void **state)
{
	(void)state;
	write_text("photometer.json", "{\"sun\":{\"elevation_deg\":30,\"azimuth_deg\":0},\"directions\":[{\"elevation_"
				      "deg\":90,\"azimuth_deg\":0},"
				      "{\"elevation_deg\":20,\"azimuth_deg\":180}],\"wavelengths_nm\":[450,550,650]}");
	run_well("photometer.json -o radiance.json");
	cJSON *json = json_file("radiance.json");
	const cJSON *rows = cJSON_GetObjectItem(json, "radiance");
	assert_int_equal(cJSON_GetArraySize(rows), 2);
	for (int d = 0; d < 2; d++) {
		const cJSON *row = cJSON_GetArrayItem(rows, d);
		assert_int_equal(cJSON_GetArraySize(row), 3);
		const double blue = cJSON_GetArrayItem(row, 0)->valuedouble,
			     red = cJSON_GetArrayItem(row, 2)->valuedouble;
		assert_true(blue > red && red > 0); /* the sky is blue */
	}
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(json, "luminance_cd_m2")), 2);
	cJSON_Delete(json);

	run_well("-o meta.json image.width=20 image.height=10 seed=7");
	json = json_file("meta.json");
	assert_true(cJSON_GetObjectItem(cJSON_GetObjectItem(json, "request"), "seed")->valuedouble == 7);
	assert_true(cJSON_IsString(cJSON_GetObjectItem(json, "device")));
	assert_true(cJSON_GetArraySize(cJSON_GetObjectItem(json, "plan")) > 0);
	assert_true(cJSON_IsObject(cJSON_GetObjectItem(json, "timing_ms")));
	cJSON_Delete(json);

	/* Pictures take no list of directions. */
	struct ran ran = run("photometer.json -o never.png");
	assert_int_equal(ran.status, 2);
	assert_says(&ran, "directions");
}

static void test_every_fault_is_named(void **state)
{
	(void)state;
	const int before = files_in_folder();
	struct ran ran = run("-o never.png sun.elevation_deg=500 camera.fov_deg=wide image.colour=red seed=1 seed=2");
	assert_int_equal(ran.status, 2);
	assert_says(&ran, "sun.elevation_deg: ");
	assert_says(&ran, "allowed: -90 to 90");
	assert_says(&ran, "camera.fov_deg: ");
	assert_says(&ran, "image.colour: ");
	assert_says(&ran, "seed: ");
	write_text("bad.json", "{\"sun\":{\"elevation_deg\":1e999},\"sun\":{}, \"x\":1} tail");
	ran = run("bad.json -o never.png");
	assert_int_equal(ran.status, 2);
	assert_int_equal(files_in_folder(), before + 1); /* bad.json, nothing half written */
}

static void test_wrong_command_lines(void **state)
{
	(void)state;
	static const struct {
		const char *arguments, *says;
	} wrong[] = {
		{ "", "-o OUT.png" },
		{ "seed=1", "-o OUT.png" },
		{ "-o", "-o needs a value" },
		{ "-o x.png", "no request" },
		{ "-o x.jpg seed=1", "can't tell the format of x.jpg" },
		{ "-o png seed=1", "can't tell the format" },
		{ "--colour -o x.png seed=1", "unknown option --colour" },
		{ "a.json b.json -o x.png", "two request files" },
		{ "missing.json -o x.png", "can't read missing.json" },
		{ ". -o x.png", "can't read ." },
	};
	for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
		struct ran ran = run(wrong[i].arguments);
		if (ran.status != 2)
			fail_msg("render %s: status %d", wrong[i].arguments, ran.status);
		assert_says(&ran, wrong[i].says);
	}
}

static void test_failures(void **state)
{
	(void)state;
	struct ran ran = run("-o no/such/folder/x.png image.width=8 image.height=8");
	assert_int_equal(ran.status, 1);
	assert_says(&ran, "no/such/folder/x.png");
	ran = run("-o x.png image.width=8 image.height=8 --device 99");
	assert_int_equal(ran.status, 1);
	ran = run("-o x.png image.width=8 image.height=8 --shader-dir /nowhere");
	assert_int_equal(ran.status, 1);

	/* A failure leaves what was there before. */
	write_text("kept.png", "old");
	ran = run("-o kept.png image.width=8 image.height=8 --shader-dir /nowhere");
	assert_int_equal(ran.status, 1);
	size_t size;
	char *kept = contents("kept.png", &size);
	assert_string_equal(kept, "old");
	free(kept);
}

static void test_help_lists_every_field(void **state)
{
	(void)state;
	struct ran ran = run_well("--help");
	assert_says(&ran, "Usage: welkin render");
	assert_says(&ran, "sun.elevation_deg");
	assert_says(&ran, "tone.map");
	assert_says(&ran, "seed");
}

/* The file has the rights that any new file has, not those of a temporary one. */
static void test_rights(void **state)
{
	(void)state;
	char path[PATH_MAX];
	struct stat info;
	umask(022);
	run_well("-o rights.png image.width=8 image.height=8");
	snprintf(path, sizeof path, "%s/rights.png", folder);
	assert_int_equal(stat(path, &info), 0);
	assert_int_equal(info.st_mode & 0777, 0644);
}

static int finish(void **state)
{
	(void)state;
	char line[PATH_MAX];
	snprintf(line, sizeof line, "rm -r %s", folder);
	return system(line);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_png_and_exr),
		cmocka_unit_test(test_ways_to_ask),
		cmocka_unit_test(test_same_bytes_as_over_http),
		cmocka_unit_test(test_scenes),
		cmocka_unit_test(test_json),
		cmocka_unit_test(test_every_fault_is_named),
		cmocka_unit_test(test_wrong_command_lines),
		cmocka_unit_test(test_failures),
		cmocka_unit_test(test_help_lists_every_field),
		cmocka_unit_test(test_rights),
	};
	if (!realpath(daemon_binary(), binary)) {
		fprintf(stderr, "test_render_command: no %s\n", daemon_binary());
		return 1;
	}
	if (!mkdtemp(folder))
		return 1;
	return cmocka_run_group_tests(tests, NULL, finish);
}
