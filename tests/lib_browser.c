#include "tests/lib_browser.h"
#include "tests/lib_http.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

extern char **environ;

/* ---- chromedriver ---- */

/* Reads until it has said where it listens; 0 when it ends or takes too long. */
static int read_port(int fd, double seconds)
{
	static const char wanted[] = "started successfully on port ";
	const double end = seconds_now() + seconds;
	char text[4096];
	size_t n = 0;
	while (n + 1 < sizeof text && seconds_now() < end) {
		struct pollfd p = { .fd = fd, .events = POLLIN };
		if (poll(&p, 1, 100) <= 0)
			continue;
		if (read(fd, text + n, 1) != 1)
			break;
		text[++n] = 0;
		const char *at = strstr(text, wanted);
		if (at && text[n - 1] == '\n')
			return atoi(at + sizeof wanted - 1);
	}
	return 0;
}

static pid_t running; /* 0: none */

static void stop_driver(void)
{
	const pid_t driver = running;
	running = 0;
	if (!driver)
		return;
	kill(driver, SIGTERM);
	for (int i = 0; i < 1000; i++) {
		if (waitpid(driver, NULL, WNOHANG) == driver)
			return;
		sleep_ms(10);
	}
	kill(driver, SIGKILL);
	waitpid(driver, NULL, 0);
}

/* A test that fails while the browser starts never gets to its teardown: what still runs ends with the program, or
 * before the next one starts. */
static void start_driver(struct lib_browser *browser)
{
	static bool registered;
	stop_driver();
	if (!registered)
		registered = !atexit(stop_driver);
	const char *const argv[] = { "chromedriver", "--port=0", NULL };
	int out[2];
	posix_spawn_file_actions_t actions;
	assert_int_equal(pipe2(out, O_CLOEXEC), 0);
	posix_spawn_file_actions_init(&actions);
	posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
	const int status = posix_spawnp(&running, argv[0], &actions, NULL, (char *const *)argv, environ);
	posix_spawn_file_actions_destroy(&actions);
	close(out[1]);
	if (status)
		running = 0;
	const int port = status ? 0 : read_port(out[0], 30);
	close(out[0]);
	if (!port)
		fail_msg("chromedriver does not start");
	snprintf(browser->base, sizeof browser->base, "http://127.0.0.1:%d/", port);
}

/* ---- WebDriver ---- */

/* Sends a command and returns "value", the caller's. Takes arguments over; NULL: DELETE. */
static cJSON *command(struct lib_browser *browser, const char *path, cJSON *arguments)
{
	static const char *const json_type[] = { "Content-Type: application/json", NULL };
	char full[512];
	snprintf(full, sizeof full, "%s%s", browser->session, path);
	char *text = arguments ? cJSON_PrintUnformatted(arguments) : NULL;
	struct http_reply reply = ask(text ? "POST" : "DELETE", browser->base, full, json_type, text);
	cJSON *json = cJSON_Parse(reply.body);
	cJSON *value = cJSON_DetachItemFromObjectCaseSensitive(json, "value");
	if (reply.status != 200)
		fail_msg("WebDriver %s: %ld %.600s%s", path, reply.status, reply.body, reply.error);
	cJSON_Delete(json);
	cJSON_Delete(arguments);
	reply_finish(&reply);
	free(text);
	return value;
}

bool lib_browser_there(void)
{
	return !system("command -v chromedriver >/dev/null 2>&1 && command -v chromium >/dev/null 2>&1");
}

void lib_browser_start(struct lib_browser *browser, int width, int height, bool phone)
{
	char options[1024], device[256] = "";
	start_driver(browser);
	snprintf(browser->session, sizeof browser->session, "session");
	if (phone)
		snprintf(device, sizeof device,
			",\"mobileEmulation\":{\"deviceMetrics\":{\"width\":%d,\"height\":%d,"
			"\"pixelRatio\":2,\"touch\":true}}",
			width, height);
	snprintf(options, sizeof options,
		"{\"capabilities\":{\"alwaysMatch\":{\"browserName\":\"chrome\",\"goog:loggingPrefs\":{\"browser\":"
		"\"ALL\"},"
		"\"goog:chromeOptions\":{\"args\":[\"--headless=new\",\"--no-sandbox\",\"--disable-gpu\",\"--disable-"
		"dev-shm-usage\","
		"\"--window-size=%d,%d\",\"--lang=en\"]%s}}}}",
		width, height, device);
	cJSON *value = command(browser, "", cJSON_Parse(options));
	const char *id = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(value, "sessionId"));
	assert_non_null(id);
	const size_t n = strlen(browser->session);
	snprintf(browser->session + n, sizeof browser->session - n, "/%s", id);
	cJSON_Delete(value);
}

void lib_browser_stop(struct lib_browser *browser)
{
	cJSON_Delete(command(browser, "", NULL));
	stop_driver();
}

void lib_browser_open(struct lib_browser *browser, const char *url)
{
	cJSON *arguments = cJSON_CreateObject();
	cJSON_AddStringToObject(arguments, "url", url);
	cJSON_Delete(command(browser, "/url", arguments));
}

cJSON *lib_browser_run(struct lib_browser *browser, const char *script)
{
	cJSON *arguments = cJSON_CreateObject();
	cJSON_AddStringToObject(arguments, "script", script);
	cJSON_AddArrayToObject(arguments, "args");
	return command(browser, "/execute/sync", arguments);
}

double lib_browser_number(struct lib_browser *browser, const char *script)
{
	cJSON *value = lib_browser_run(browser, script);
	if (!cJSON_IsNumber(value))
		fail_msg("not a number: %s", script);
	const double number = value->valuedouble;
	cJSON_Delete(value);
	return number;
}

char *lib_browser_text(struct lib_browser *browser, const char *script)
{
	cJSON *value = lib_browser_run(browser, script);
	if (!cJSON_IsString(value))
		fail_msg("not text: %s", script);
	char *text = strdup(value->valuestring);
	cJSON_Delete(value);
	return text;
}

void lib_browser_wait(struct lib_browser *browser, const char *expression, int timeout_ms)
{
	char script[2048];
	const double end = seconds_now() + timeout_ms / 1e3;
	snprintf(script, sizeof script, "return Boolean(%s)", expression);
	for (;;) {
		cJSON *value = lib_browser_run(browser, script);
		const bool is_true = cJSON_IsTrue(value);
		cJSON_Delete(value);
		if (is_true)
			return;
		if (seconds_now() > end)
			fail_msg("in vain for %d ms: %s", timeout_ms, expression);
		sleep_ms(50);
	}
}

char *lib_browser_errors(struct lib_browser *browser)
{
	char *all = strdup("");
	cJSON *entries = command(browser, "/se/log", cJSON_Parse("{\"type\":\"browser\"}"));
	for (cJSON *e = entries ? entries->child : NULL; e; e = e->next) {
		const char *message = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(e, "message"));
		const char *level = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(e, "level"));
		char *longer;
		if (!message || !level || strcmp(level, "SEVERE") || strstr(message, "status of 4"))
			continue;
		if (asprintf(&longer, "%s%s\n", all, message) < 0)
			abort();
		free(all);
		all = longer;
	}
	cJSON_Delete(entries);
	return all;
}

static int base64_value(char c)
{
	static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
	const char *at = c ? strchr(digits, c) : NULL;
	return at ? (int)(at - digits) : -1;
}

void lib_browser_screenshot(struct lib_browser *browser, const char *path, bool whole)
{
	cJSON *arguments = cJSON_Parse("{\"cmd\":\"Page.captureScreenshot\",\"params\":{\"format\":\"png\"}}");
	cJSON_AddBoolToObject(cJSON_GetObjectItemCaseSensitive(arguments, "params"), "captureBeyondViewport", whole);
	cJSON *value = command(browser, "/goog/cdp/execute", arguments);
	const char *data = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(value, "data"));
	FILE *file = fopen(path, "wb");
	if (!file || !data)
		fail_msg("no screenshot %s: %s", path, strerror(errno));
	uint32_t bits = 0;
	int n = 0;
	for (; *data; data++) {
		const int digit = base64_value(*data);
		if (digit < 0)
			continue;
		bits = bits << 6 | (uint32_t)digit;
		n += 6;
		if (n >= 8) {
			n -= 8;
			fputc((int)(bits >> n & 0xff), file);
		}
	}
	fclose(file);
	cJSON_Delete(value);
}
