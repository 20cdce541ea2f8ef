/* Methods from files of the operator's: how their heads are read, what becomes of files at fault, how their
 * parameters are fields of a request, and that no such file takes the daemon down. */
#include "api/api.h"
#include "gpu/operator_methods.h"
#include "tests/lib_fake_renderer.h"
#include "tests/lib_http.h"
#include "tests/lib_render.h"

#include <cJSON.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>

#include <cmocka.h>

/* ---- files ---- */

static char dir[64];

static void write_file(const char *name, const char *text)
{
	char path[320];
	snprintf(path, sizeof path, "%s/%s", dir, name);
	FILE *file = fopen(path, "w");
	assert_non_null(file);
	assert_true(fputs(text, file) >= 0);
	assert_int_equal(fclose(file), 0);
}

static int make_dir(void **state)
{
	(void)state;
	strcpy(dir, "/tmp/welkin-methods-XXXXXX");
	return mkdtemp(dir) ? 0 : -1;
}

static int remove_dir(void **state)
{
	(void)state;
	char command[128];
	operator_methods_forget();
	snprintf(command, sizeof command, "rm -rf '%s'", dir);
	return system(command);
}

static const char flat[] = "/*\n"
			   " * The same light from everywhere.\n"
			   " *\n"
			   " * summary: flat light\n"
			   " * source: a test\n"
			   " * parameter: level | W/m2/sr/nm | 0 to 10 | 0.5 | Radiance at every wavelength.\n"
			   " * parameter: veil | - | 0 to 1 | 0.25 | Share of light that does not come through.\n"
			   " * domain: camera.altitude_m | 0 to 5000 | a test is of the ground\n"
			   " */\n"
			   "void method_sky(Ray ray, out vec4 L, out vec4 T)\n"
			   "{\n"
			   "	L = vec4(parameters.level);\n"
			   "	T = vec4(1.0 - parameters.veil);\n"
			   "}\n";

static void read_dir(void)
{
	struct error err = { "" };
	if (!operator_methods_read(dir, &err))
		fail_msg("%s", err.text);
}

/* The entry of a file, which has to be there. */
static int entry_of(const char *file)
{
	for (int i = 0; i < operator_methods_count(); i++)
		if (!strcmp(operator_methods_at(i)->file, file))
			return i;
	fail_msg("%s is not among the entries", file);
	return -1;
}

static void expect_refused(const char *file, const char *why)
{
	const struct operator_status status = operator_methods_status(entry_of(file));
	assert_int_equal(status.state, OPERATOR_UNAVAILABLE);
	if (!strstr(status.reason, why) || !strstr(status.reason, file))
		fail_msg("%s: \"%s\" does not say \"%s\"", file, status.reason, why);
}

/* ---- heads ---- */

static void test_head_says_what_the_file_is(void **state)
{
	(void)state;
	struct method_head head;
	struct error err = { "" };
	int line;
	static const char text[] =
		"\n// Prose: with a colon.\n// summary: one line\n// tables: multiple\n"
		"// fields: atmosphere.turbidity, atmosphere.steps\n// physical: yes\n"
		"// parameter: depth | - | -1 to 1e3 | 0.5 | How: deep.\nvoid f();\n// summary: not any more\n";
	assert_true(method_head_parse(&head, text, &line, &err));
	assert_string_equal(head.summary, "one line");
	assert_true(head.multiple && head.optical_depth && head.physical);
	assert_int_equal(head.n_fields, 2);
	assert_string_equal(head.fields[1], "atmosphere.steps");
	assert_int_equal(head.n_parameters, 1);
	assert_string_equal(head.parameters[0].name, "depth");
	assert_string_equal(head.parameters[0].unit, "");
	assert_string_equal(head.parameters[0].default_text, "0.5");
	assert_string_equal(head.parameters[0].help, "How: deep.");
	assert_float_equal(head.parameters[0].min, -1, 0);
	assert_float_equal(head.parameters[0].max, 1000, 0);
	assert_true(method_head_parse(&head, "void method_sky();", &line, &err)); /* none is fine */
	assert_int_equal(head.n_parameters, 0);
}

static void test_head_at_fault_names_its_line(void **state)
{
	(void)state;
	static const struct {
		const char *line, *why;
	} faults[] = {
		{ "paramter: a | - | 0 to 1 | 0 | b", "unknown key" },
		{ "parameter: A | - | 0 to 1 | 0 | b", "can't name a parameter" },
		{ "parameter: a__b | - | 0 to 1 | 0 | b", "can't name a parameter" },
		{ "parameter: abcdefghijklmnopqrstuvwxyz | - | 0 to 1 | 0 | b", "can't name a parameter" },
		{ "parameter: a | - | 0 1 | 0 | b", "not a range" },
		{ "parameter: a | - | 1 to 0 | 0 | b", "is empty" },
		{ "parameter: a | - | 0 to 1 | 2 | b", "outside its range" },
		{ "parameter: a | - | 0 to 1 | nan | b", "not a number" },
		{ "parameter: a | - | 0 to 1e999 | 0 | b", "not a number" },
		{ "parameter: a | - | 0 to 1e300 | 0 | b", "beyond what a float holds" },
		{ "parameter: first | - | 0 to 1 | 0 | b", "two parameters" },
		{ "tables: transmittance", "there is no table" },
		{ "fields: no.such", "there is no request field" },
		{ "domain: no.such | 0 to 1 | why", "there is no request field" },
		{ "physical: perhaps", "yes or no" },
	};
	for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
		struct method_head head;
		struct error err = { "" };
		char text[256];
		int line = 0;
		snprintf(text, sizeof text, "/*\n * parameter: first | - | 0 to 1 | 0 | b\n * %s\n */\n",
			faults[i].line);
		assert_false(method_head_parse(&head, text, &line, &err));
		assert_int_equal(line, 3);
		if (!strstr(err.text, faults[i].why))
			fail_msg("%s: \"%s\" does not say \"%s\"", faults[i].line, err.text, faults[i].why);
	}
}

static void test_too_many_parameters(void **state)
{
	(void)state;
	struct method_head head;
	struct error err = { "" };
	char text[4096] = "";
	int line;
	for (int i = 0; i <= METHOD_PARAMETERS_MAX; i++)
		snprintf(
			text + strlen(text), sizeof text - strlen(text), "// parameter: p%d | - | 0 to 1 | 0 | b\n", i);
	assert_false(method_head_parse(&head, text, &line, &err));
	assert_int_equal(line, METHOD_PARAMETERS_MAX + 1);
}

/* ---- folders ---- */

static void test_unreadable_folder(void **state)
{
	(void)state;
	struct error err = { "" };
	assert_false(operator_methods_read("/no/such/folder", &err));
	assert_non_null(strstr(err.text, "/no/such/folder"));
	assert_int_equal(operator_methods_count(), 0);
	assert_true(operator_methods_read("", &err));
	assert_int_equal(operator_methods_count(), 0);
}

static void test_files_at_fault_are_kept_apart(void **state)
{
	(void)state;
	char path[128], *large = malloc(OPERATOR_FILE_MAX + 2);
	const int built_in = welkin_method_count;
	assert_non_null(large);
	memset(large, ' ', OPERATOR_FILE_MAX + 1);
	large[OPERATOR_FILE_MAX + 1] = '\0';
	write_file("flat.glsl", flat);
	write_file("large.glsl", large);
	write_file("empty.glsl", "");
	write_file("latin.glsl", "// caf\xe9\n");
	write_file("Upper.glsl", flat);
	write_file("two__bars.glsl", flat);
	write_file("march.glsl", flat);
	write_file("auto.glsl", flat);
	write_file("head.glsl", "// summary: x\n// sumary: x\n");
	write_file(".hidden.glsl", flat);
	write_file("README.md", "not a method");
	snprintf(path, sizeof path, "%s/pipe.glsl", dir);
	assert_int_equal(mkfifo(path, 0600), 0);
	snprintf(path, sizeof path, "%s/folder.glsl", dir);
	assert_int_equal(mkdir(path, 0700), 0);
	snprintf(path, sizeof path, "%s/gone.glsl", dir);
	assert_int_equal(symlink("/no/such/file", path), 0);
	free(large);
	read_dir();
	assert_int_equal(operator_methods_count(), 12);
	expect_refused("large.glsl", "larger than");
	expect_refused("empty.glsl", "empty");
	expect_refused("latin.glsl", "UTF-8");
	expect_refused("Upper.glsl", "name");
	expect_refused("two__bars.glsl", "name");
	expect_refused("march.glsl", "built-in");
	expect_refused("auto.glsl", "built-in");
	expect_refused("head.glsl", "head.glsl:2: unknown key \"sumary\"");
	expect_refused("pipe.glsl", "regular file");
	expect_refused("folder.glsl", "regular file");
	expect_refused("gone.glsl", "No such file");
	assert_int_equal(operator_methods_status(entry_of("flat.glsl")).state, OPERATOR_UNCHECKED);
	/* Those with a usable name can be asked for, and then say why not. */
	assert_int_equal(welkin_method_count, built_in + 8);
	for (int i = 0; i < operator_methods_count(); i++) {
		const struct operator_method *m = operator_methods_at(i);
		if (i)
			assert_true(strcmp(operator_methods_at(i - 1)->file, m->file) < 0);
		if (m->index < 0)
			continue;
		assert_ptr_equal(welkin_methods[m->index], &m->method);
		assert_string_equal(welkin_method_names[m->index], m->name);
		assert_int_equal(operator_methods_find(m->index), i);
	}
	operator_methods_forget();
	assert_int_equal(welkin_method_count, built_in);
	assert_string_equal(welkin_method_names[built_in], "auto");
	assert_null(welkin_method_names[built_in + 1]);
}

static void test_a_thousand_files(void **state)
{
	(void)state;
	for (int i = 0; i < 1000; i++) {
		char name[32];
		snprintf(name, sizeof name, "m%03d.glsl", i);
		write_file(name, flat);
	}
	read_dir();
	assert_int_equal(operator_methods_count(), OPERATOR_METHODS_MAX);
	assert_int_equal(operator_methods_left_out(), 1000 - OPERATOR_METHODS_MAX);
	assert_string_equal(operator_methods_at(0)->file, "m000.glsl");
	assert_true(welkin_field_find("method.m031.veil") >= 0);
	assert_int_equal(welkin_field_find("method.m032.veil"), -1);
}

static void test_parameters_are_bounded_together(void **state)
{
	(void)state;
	char text[4096] = "";
	for (int i = 0; i < METHOD_PARAMETERS_MAX; i++)
		snprintf(
			text + strlen(text), sizeof text - strlen(text), "// parameter: p%d | - | 0 to 1 | 0 | b\n", i);
	for (int i = 0; i < 6; i++) {
		char name[32];
		snprintf(name, sizeof name, "m%d.glsl", i);
		write_file(name, text);
	}
	read_dir();
	assert_int_equal(operator_methods_status(3).state, OPERATOR_UNCHECKED);
	expect_refused("m4.glsl", "more than 64");
	expect_refused("m5.glsl", "more than 64");
	assert_true(welkin_field_find("method.m3.p15") >= 0);
	assert_int_equal(welkin_field_find("method.m4.p0"), -1);
}

static void test_a_renderer_gets_the_same(void **state)
{
	(void)state;
	struct error err = { "" };
	char states[OPERATOR_METHODS_MAX + 1];
	write_file("flat.glsl", flat);
	write_file("gone.glsl", "// sumary: x\n");
	write_file("Upper.glsl", flat);
	read_dir();
	const struct operator_status sound = { .state = OPERATOR_AVAILABLE };
	assert_true(operator_methods_report(entry_of("flat.glsl"), &sound));
	assert_false(operator_methods_report(entry_of("gone.glsl"), &sound)); /* unavailable is for good */
	operator_methods_states(states);
	assert_string_equal(states, "-+-");
	const int fd = operator_methods_bundle(&err), index = operator_methods_at(1)->index;
	char digest[17];
	strcpy(digest, operator_methods_at(1)->digest);
	assert_true(fd >= 10);
	write_file("another.glsl", flat); /* the folder may change: what was read counts */
	assert_true(operator_methods_receive(fd, &err));
	close(fd);
	assert_int_equal(operator_methods_count(), 3);
	assert_int_equal(operator_methods_at(1)->index, index);
	assert_string_equal(operator_methods_at(1)->text, flat);
	assert_string_equal(operator_methods_at(1)->digest, digest);
	operator_methods_take_states(states);
	assert_int_equal(operator_methods_status(1).state, OPERATOR_AVAILABLE);
	expect_refused("gone.glsl", "gone.glsl:1:");
}

/* ---- requests ---- */

static void resolve_query(const char *query, struct welkin_request *request, struct welkin_faults *faults)
{
	struct welkin_draft draft;
	memset(&draft, 0, sizeof draft);
	memset(faults, 0, sizeof *faults);
	welkin_parse_query(&draft, query, strlen(query), faults);
	welkin_resolve(&draft, WELKIN_PNG, NULL, request, faults);
}

static void expect_key_equal(const char *a, const char *b, bool equal)
{
	struct welkin_request request;
	struct welkin_faults faults;
	char keys[2][33];
	for (int i = 0; i < 2; i++) {
		resolve_query(i ? b : a, &request, &faults);
		assert_int_equal(faults.n, 0);
		welkin_request_key(&request, "", keys[i]);
	}
	if (equal != !strcmp(keys[0], keys[1]))
		fail_msg("%s and %s: keys %s", a, b, equal ? "differ" : "are equal");
}

static void test_parameters_are_fields(void **state)
{
	(void)state;
	struct welkin_request request, again;
	struct welkin_faults faults;
	write_file("flat.glsl", flat);
	write_file("plain.glsl", flat);
	read_dir();
	resolve_query("atmosphere.method=plain&method.plain.level=2.5", &request, &faults);
	assert_int_equal(faults.n, 0);
	const struct method *plain = welkin_methods[request.atmosphere.method];
	assert_string_equal(plain->name, "plain");
	assert_float_equal(request.method_values[plain->first_value], 2.5, 0);
	assert_float_equal(request.method_values[plain->first_value + 1], 0.25, 0);

	/* Its own parameters are in the canonical text, no others, and the text comes back as the same bytes. */
	char *json = welkin_request_json(&request), *query = welkin_request_query(&request);
	assert_non_null(strstr(json, "\"method\":{\"plain\":{\"level\":2.5,\"veil\":0.25}}"));
	assert_null(strstr(json, "flat"));
	struct welkin_draft draft;
	memset(&draft, 0, sizeof draft);
	welkin_parse_json(&draft, json, strlen(json), NULL, &faults);
	welkin_resolve(&draft, WELKIN_PNG, NULL, &again, &faults);
	assert_int_equal(faults.n, 0);
	assert_memory_equal(&request, &again, sizeof request);
	resolve_query(query, &again, &faults);
	assert_int_equal(faults.n, 0);
	assert_memory_equal(&request, &again, sizeof request);
	free(json);
	free(query);

	expect_key_equal("atmosphere.method=flat", "atmosphere.method=flat&method.flat.level=0.5", true);
	expect_key_equal("atmosphere.method=flat", "atmosphere.method=flat&method.flat.level=0.6", false);
	expect_key_equal("atmosphere.method=flat", "atmosphere.method=flat&method.plain.level=7", true);
	expect_key_equal("atmosphere.method=march", "atmosphere.method=march&method.plain.level=7", true);
	resolve_query("atmosphere.method=flat&method.flat.level=11&method.flat.no=1", &request, &faults);
	assert_int_equal(faults.n, 2);
	assert_int_equal(faults.status, 422);
	assert_string_equal(faults.list[0].field, "method.flat.level");
	assert_string_equal(faults.list[0].allowed, "0 to 10 W/m2/sr/nm");
}

static void test_nested_groups(void **state)
{
	(void)state;
	struct welkin_draft draft;
	struct welkin_faults faults = { 0 };
	static const char both[] = "{\"method\": {\"flat\": {\"level\": 1}, \"plain\": {\"level\": 2}}}";
	static const char twice[] = "{\"method\": {\"flat\": {\"level\": 1}}, \"method\": {\"flat\": {\"veil\": 1}}}";
	write_file("flat.glsl", flat);
	write_file("plain.glsl", flat);
	read_dir();
	memset(&draft, 0, sizeof draft);
	welkin_parse_json(&draft, both, strlen(both), NULL, &faults);
	assert_int_equal(faults.n, 0);
	assert_true(draft.given[welkin_field_find("method.plain.level")]);
	memset(&draft, 0, sizeof draft);
	welkin_parse_json(&draft, twice, strlen(twice), NULL, &faults);
	assert_int_not_equal(faults.n, 0);
	assert_int_equal(faults.status, 400);
}

static void test_openapi_has_what_can_be_asked_for(void **state)
{
	(void)state;
	write_file("flat.glsl", flat);
	write_file("head.glsl", "// sumary: x\n");
	read_dir();
	char *text = welkin_openapi_json("1");
	cJSON *doc = cJSON_Parse(text);
	free(text);
	const cJSON *parameters =
		cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(doc, "components"), "parameters");
	const cJSON *level = cJSON_GetObjectItemCaseSensitive(parameters, "method.flat.level");
	const cJSON *schema = cJSON_GetObjectItemCaseSensitive(level, "schema");
	assert_string_equal(cJSON_GetObjectItemCaseSensitive(level, "x-group")->valuestring, "method.flat");
	assert_float_equal(cJSON_GetObjectItemCaseSensitive(schema, "maximum")->valuedouble, 10, 0);
	assert_float_equal(cJSON_GetObjectItemCaseSensitive(schema, "default")->valuedouble, 0.5, 0);
	bool has_flat = false, has_head = false;
	const cJSON *name;
	cJSON_ArrayForEach(
		name, cJSON_GetObjectItemCaseSensitive(
			      cJSON_GetObjectItemCaseSensitive(
				      cJSON_GetObjectItemCaseSensitive(parameters, "atmosphere.method"), "schema"),
			      "enum"))
	{
		has_flat |= !strcmp(name->valuestring, "flat");
		has_head |= !strcmp(name->valuestring, "head");
	}
	assert_true(has_flat);
	assert_false(has_head);
	cJSON_Delete(doc);
}

/* ---- a renderer alone, as programs that measure start it ---- */

static void test_renderer_alone(void **state)
{
	(void)state;
	struct welkin_renderer_config config = { .device = "software", .slice_ms = 20, .table_budget_mib = 64 };
	struct lib_renderer renderer;
	struct welkin_request request;
	struct welkin_faults faults;
	struct welkin_result result;
	static const double up[1][3] = { { 0, 1, 0 } }, nm = 550;
	double *reply;
	write_file("flat.glsl", flat);
	write_file("broken.glsl", "void method_sky(Ray ray, out vec4 L, out vec4 T) { }}\n");
	setenv("WELKIN_METHOD_DIR", dir, 1);
	assert_true(lib_render_methods(&config));
	unsetenv("WELKIN_METHOD_DIR");
	assert_true(lib_render_start(&renderer, &config));
	close(config.methods_fd);
	expect_refused("broken.glsl", "broken.glsl:1");
	const struct operator_status status = operator_methods_status(entry_of("flat.glsl"));
	assert_int_equal(status.state, OPERATOR_AVAILABLE);
	assert_true(status.ns_per_ray > 0);
	resolve_query("atmosphere.method=flat&method.flat.level=4", &request, &faults);
	assert_int_equal(faults.n, 0);
	assert_true(lib_radiance(&renderer, &request, up, 1, &nm, 1, &reply, &result));
	const struct welkin_radiance_layout at = welkin_radiance_layout(1, 1);
	assert_float_equal(reply[at.radiance], 4, 1e-6);
	assert_float_equal(reply[at.transmittance], 0.75, 1e-6);
	free(reply);
	/* A server that has not heard of the reason gets it with the refusal. */
	resolve_query("atmosphere.method=broken", &request, &faults);
	assert_false(lib_radiance(&renderer, &request, up, 1, &nm, 1, &reply, &result));
	assert_non_null(strstr(result.message, "broken.glsl:1"));
	free(reply);
	assert_int_equal(lib_render_stop(&renderer), 0);
}

/* ---- the daemon ---- */

static cJSON *fetch_methods(const struct daemon_process *server)
{
	struct http_reply reply = get(server->url, "/v1/methods");
	assert_int_equal(reply.status, 200);
	cJSON *json = cJSON_Parse(reply.body);
	assert_non_null(json);
	reply_finish(&reply);
	return json;
}

static const cJSON *method_named(const cJSON *methods, const char *name, bool available)
{
	const cJSON *m;
	cJSON_ArrayForEach(m, cJSON_GetObjectItemCaseSensitive(methods, "methods"))
	{
		const bool is = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(m, "available"));
		if (!strcmp(cJSON_GetObjectItemCaseSensitive(m, "name")->valuestring, name) && is == available)
			return m;
	}
	fail_msg("/v1/methods has no %s that is %savailable", name, available ? "" : "not ");
	return NULL;
}

static void expect_reason(const cJSON *methods, const char *name, const char *why)
{
	const char *reason =
		cJSON_GetObjectItemCaseSensitive(method_named(methods, name, false), "reason")->valuestring;
	if (!strstr(reason, why))
		fail_msg("%s: \"%s\" does not say \"%s\"", name, reason, why);
}

static struct http_reply fetch_small(
	const struct daemon_process *server, const char *query, int status, const char *says)
{
	char path[256];
	snprintf(path, sizeof path, "/v1/render.png?image.width=64&image.height=32&%s", query);
	struct http_reply reply = fetch(server->url, path, status);
	if (says && !strstr(reply.body, says))
		fail_msg("%s: no \"%s\" in %.400s", query, says, reply.body);
	return reply;
}

static void expect(const struct daemon_process *server, const char *query, int status, const char *says)
{
	struct http_reply reply = fetch_small(server, query, status, says);
	reply_finish(&reply);
}

/* The radiance at the zenith by the photometer. */
static double zenith_radiance(const struct daemon_process *server, const char *method)
{
	static const char *const json[] = { "Content-Type: application/json", NULL };
	char body[400];
	snprintf(body, sizeof body,
		"{%s, \"directions\": [{\"elevation_deg\": 90, \"azimuth_deg\": 0}], \"wavelengths_nm\": [550]}",
		method);
	struct http_reply reply = ask("POST", server->url, "/v1/radiance", json, body);
	if (reply.status != 200)
		fail_msg("%s: status %ld: %.300s", body, reply.status, reply.body);
	cJSON *answer = cJSON_Parse(reply.body);
	const double L = cJSON_GetObjectItemCaseSensitive(answer, "radiance")->child->child->valuedouble;
	cJSON_Delete(answer);
	reply_finish(&reply);
	return L;
}

static void test_daemon_with_files_of_all_kinds(void **state)
{
	(void)state;
	write_file("flat.glsl", flat);
	write_file("march.glsl", flat);
	write_file("broken.glsl",
		"// summary: does not compile\n\nvoid method_sky(Ray ray, out vec4 L, out vec4 T)\n{\n"
		"	L = vec4(undeclared);\n	T = vec4(1.0);\n}\n");
	write_file("nan.glsl", "void method_sky(Ray ray, out vec4 L, out vec4 T)\n{\n"
			       "	L = vec4(sqrt(ray.mu));\n	T = vec4(1.0);\n}\n");
	write_file("negative.glsl", "// parameter: dark | - | 0 to 1 | 0 | Light taken away.\n"
				    "void method_sky(Ray ray, out vec4 L, out vec4 T)\n{\n"
				    "	L = vec4(0.5 - parameters.dark);\n	T = vec4(1.0);\n}\n");
	write_file("tables.glsl",
		"// tables: multiple\n#define WITH_MULTIPLE\n#include \"scatter_sky.glsl\"\n"
		"void method_sky(Ray ray, out vec4 L, out vec4 T)\n{\n	scatter_sky(ray, L, T);\n}\n");
	struct daemon_process *server =
		daemon_start(false, (const char *const[]){ "--device", "software", "--method-dir", dir, NULL });

	cJSON *methods = fetch_methods(server);
	const cJSON *m = method_named(methods, "flat", true);
	assert_true(cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(m, "operator")));
	assert_string_equal(cJSON_GetObjectItemCaseSensitive(m, "summary")->valuestring, "flat light");
	assert_true(cJSON_GetObjectItemCaseSensitive(m, "ns_per_ray")->valuedouble > 0);
	assert_string_equal(
		cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(m, "fields")->child, "name")
			->valuestring,
		"method.flat.level");
	method_named(methods, "tables", true);
	assert_true(cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(method_named(methods, "march", true), "operator")));
	expect_reason(methods, "march.glsl", "built-in");
	expect_reason(methods, "broken", "broken.glsl:5");
	expect_reason(methods, "nan", "not finite");
	expect_reason(methods, "negative", "dark 1");
	cJSON_Delete(methods);

	/* What it gives is what the file says, by its parameters. */
	assert_float_equal(zenith_radiance(server, "\"atmosphere\": {\"method\": \"flat\"}"), 0.5, 1e-6);
	assert_float_equal(zenith_radiance(server,
				   "\"atmosphere\": {\"method\": \"flat\"}, \"method\": {\"flat\": {\"level\": 2}}"),
		2, 1e-6);
	const double table = zenith_radiance(server, "\"atmosphere\": {\"method\": \"tables\"}");
	const double sky_view = zenith_radiance(server, "\"atmosphere\": {\"method\": \"sky_view\"}");
	assert_float_equal(table, sky_view, 0.02 * sky_view);
	static const char fixed[] = "exposure.mode=ev&exposure.ev=17&atmosphere.method=flat";
	char query[128];
	struct http_reply one = fetch_small(server, fixed, 200, NULL);
	assert_string_equal(header_of(&one, "Welkin-Method"), "flat");
	char tag[64];
	snprintf(tag, sizeof tag, "%s", header_of(&one, "ETag"));
	snprintf(query, sizeof query, "%s&method.flat.level=0.1", fixed);
	struct http_reply other = fetch_small(server, query, 200, NULL);
	assert_string_not_equal(header_of(&other, "ETag"), tag);
	assert_true(one.size != other.size || memcmp(one.body, other.body, one.size) != 0);
	reply_finish(&one);
	reply_finish(&other);

	expect(server, "atmosphere.method=flat&method.flat.level=11", 422, "0 to 10");
	expect(server, "atmosphere.method=flat&camera.altitude_m=6000", 422, "a test is of the ground");
	expect(server, "atmosphere.method=broken", 422, "broken.glsl:5");
	expect(server, "atmosphere.method=nan", 422, "not finite");
	expect(server, "atmosphere.method=march", 200, NULL);
	expect(server, "", 200, NULL);
	daemon_stop(server);
}

/* A method that the device does not survive is switched off; the daemon is not restarted for ever. */
static void test_daemon_switches_off_what_kills_the_renderer(void **state)
{
	(void)state;
	char query[80];
	write_file("flat.glsl", flat);
	struct daemon_process *server = daemon_start(
		true, (const char *const[]){ "--watchdog-s", "0.5", "--cache-mib", "0", "--method-dir", dir, NULL });
	expect(server, "atmosphere.method=flat", 200, NULL);
	snprintf(query, sizeof query, "atmosphere.method=flat&seed=%d", FAKE_HANG);
	expect(server, query, 503, NULL);
	assert_true(metric_wait(server, "welkin_ready", 1, 20) >= 1);
	expect(server, "atmosphere.method=flat", 200, NULL); /* once may be chance */
	expect(server, query, 503, NULL);
	expect(server, query, 422, "the renderer was lost while it worked for this method");
	assert_true(metric_wait(server, "welkin_ready", 1, 20) >= 1);
	expect(server, "atmosphere.method=march", 200, NULL);
	cJSON *methods = fetch_methods(server);
	expect_reason(methods, "flat", "lost");
	cJSON_Delete(methods);
	struct http_reply openapi = get(server->url, "/openapi.json");
	assert_null(strstr(openapi.body, "method.flat.level"));
	reply_finish(&openapi);
	daemon_stop(server);
}

/* The same in the check: each is tried once, however many there are, and then the daemon serves. */
static void test_daemon_starts_when_checks_kill_the_renderer(void **state)
{
	(void)state;
	for (int i = 0; i < 5; i++) {
		char name[32];
		snprintf(name, sizeof name, "m%d.glsl", i);
		write_file(name, flat);
	}
	setenv("WELKIN_FAKE", "checks", 1);
	struct daemon_process *server = daemon_start(true, (const char *const[]){ "--method-dir", dir, NULL });
	unsetenv("WELKIN_FAKE");
	expect(server, "atmosphere.method=m4", 422, "m4.glsl: the renderer was lost while it checked this method");
	expect(server, "atmosphere.method=march", 200, NULL);
	daemon_stop(server);
}

static void test_command_lines(void **state)
{
	(void)state;
	char *output;
	assert_int_not_equal(
		daemon_run((const char *const[]){ "serve", "--method-dir", "/no/such", NULL }, &output), 0);
	assert_non_null(strstr(output, "/no/such"));
	free(output);
	assert_int_equal(daemon_run((const char *const[]){ "methods", "--method-dir", "/no/such", NULL }, &output), 2);
	free(output);
	assert_int_equal(daemon_run((const char *const[]){ "methods", "--what", NULL }, &output), 2);
	free(output);
	write_file("flat.glsl", flat);
	write_file("broken.glsl", "void method_sky(Ray ray, out vec4 L, out vec4 T)\n{\n	L = T = 1.0;\n}\n");
	const char *const list[] = { "methods", "--method-dir", dir, "--device", "software", NULL };
	assert_int_equal(daemon_run(list, &output), 1);
	assert_non_null(strstr(output, "NOT AVAILABLE: broken.glsl:3"));
	assert_non_null(strstr(output, "method.flat.level: 0 to 10 W/m2/sr/nm [0.5]"));
	free(output);
	char out[96];
	snprintf(out, sizeof out, "%s/x.png", dir);
	const char *const render[] = { "render", "--device", "software", "--method-dir", dir, "-o", out,
		"image.width=16", "image.height=8", "atmosphere.method=flat", "method.flat.level=3", NULL };
	assert_int_equal(daemon_run(render, &output), 0);
	free(output);
	assert_int_equal(access(out, R_OK), 0);
}

/* The example that operators are given. */
static void test_example_is_sound(void **state)
{
	(void)state;
	struct error err = { "" };
	if (access("deploy/methods/cie_sky.glsl", R_OK))
		skip(); /* not run from the top of the source */
	assert_true(operator_methods_read("deploy/methods", &err));
	assert_int_equal(operator_methods_count(), 1);
	assert_int_equal(operator_methods_status(0).state, OPERATOR_UNCHECKED);
	operator_methods_forget();
	struct daemon_process *server = daemon_start(
		false, (const char *const[]){ "--device", "software", "--method-dir", "deploy/methods", NULL });
	/* Type 5 is the uniform sky: as bright towards the horizon as at the zenith, 5000 cd/m². */
	static const char *const json[] = { "Content-Type: application/json", NULL };
	struct http_reply reply = ask("POST", server->url, "/v1/radiance", json,
		"{\"sun\": {\"elevation_deg\": 40, \"disk\": false}, \"atmosphere\": {\"method\": \"cie_sky\"}, "
		"\"method\": "
		"{\"cie_sky\": {\"type\": 5, \"horizon_temperature\": 24000}}, \"directions\": [{\"elevation_deg\": "
		"90, "
		"\"azimuth_deg\": 0}, {\"elevation_deg\": 10, \"azimuth_deg\": 123}], \"wavelengths_nm\": [400, 420, "
		"440, 460, "
		"480, 500, 520, 540, 560, 580, 600, 620, 640, 660, 680, 700]}");
	assert_int_equal(reply.status, 200);
	cJSON *answer = cJSON_Parse(reply.body);
	const cJSON *luminance = cJSON_GetObjectItemCaseSensitive(answer, "luminance_cd_m2");
	assert_float_equal(luminance->child->valuedouble, 5000, 50);
	assert_float_equal(luminance->child->next->valuedouble, luminance->child->valuedouble, 1);
	cJSON_Delete(answer);
	reply_finish(&reply);
	daemon_stop(server);
}

int main(int argc, char **argv)
{
	fake_renderer_run(argc, argv);
#define IN_DIR(test) cmocka_unit_test_setup_teardown(test, make_dir, remove_dir)
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_head_says_what_the_file_is),
		cmocka_unit_test(test_head_at_fault_names_its_line),
		cmocka_unit_test(test_too_many_parameters),
		cmocka_unit_test(test_unreadable_folder),
		IN_DIR(test_files_at_fault_are_kept_apart),
		IN_DIR(test_a_thousand_files),
		IN_DIR(test_parameters_are_bounded_together),
		IN_DIR(test_a_renderer_gets_the_same),
		IN_DIR(test_parameters_are_fields),
		IN_DIR(test_nested_groups),
		IN_DIR(test_openapi_has_what_can_be_asked_for),
		IN_DIR(test_renderer_alone),
		IN_DIR(test_daemon_with_files_of_all_kinds),
		IN_DIR(test_daemon_switches_off_what_kills_the_renderer),
		IN_DIR(test_daemon_starts_when_checks_kill_the_renderer),
		IN_DIR(test_command_lines),
		cmocka_unit_test(test_example_is_sound),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
