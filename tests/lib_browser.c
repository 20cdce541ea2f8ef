#include "tests/lib_browser.h"

#include <curl/curl.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

extern char **environ;

static int64_t now_ms(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

static void sleep_ms(int ms)
{
	nanosleep(&(struct timespec){ ms / 1000, ms % 1000 * 1000000L }, NULL);
}

/* ---- children ---- */

static bool read_line(struct lib_child *child, const char *wanted, int timeout_ms)
{
	const int64_t end = now_ms() + timeout_ms;
	size_t n = 0;
	for (int64_t left; (left = end - now_ms()) > 0;) {
		struct pollfd fd = { .fd = child->out_fd, .events = POLLIN };
		char c;
		if (poll(&fd, 1, (int)left) <= 0 || read(child->out_fd, &c, 1) != 1)
			return false;
		if (c != '\n' && n < sizeof child->line - 1)
			child->line[n++] = c;
		child->line[n] = 0;
		if (c == '\n' && strstr(child->line, wanted))
			return true;
		if (c == '\n')
			n = 0;
	}
	return false;
}

bool lib_child_start(struct lib_child *child, const char *const argv[], const char *wanted, int timeout_ms)
{
	int out[2];
	posix_spawn_file_actions_t actions;
	if (pipe2(out, O_CLOEXEC))
		return false;
	posix_spawn_file_actions_init(&actions);
	posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
	const int status = posix_spawnp(&child->pid, argv[0], &actions, NULL, (char *const *)argv, environ);
	posix_spawn_file_actions_destroy(&actions);
	close(out[1]);
	child->out_fd = out[0];
	if (status) {
		close(out[0]);
		return false;
	}
	if (read_line(child, wanted, timeout_ms))
		return true;
	lib_child_stop(child);
	return false;
}

int lib_child_stop(struct lib_child *child)
{
	int status = 0;
	kill(child->pid, SIGTERM);
	for (int i = 0; i < 1000; i++) {
		if (waitpid(child->pid, &status, WNOHANG) == child->pid) {
			close(child->out_fd);
			return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
		}
		sleep_ms(10);
	}
	kill(child->pid, SIGKILL);
	waitpid(child->pid, &status, 0);
	close(child->out_fd);
	return -1;
}

/* ---- HTTP ---- */

struct body {
	char *data;
	size_t size;
};

static bool append(struct body *body, const void *data, size_t size)
{
	char *bigger = realloc(body->data, body->size + size + 1);
	if (!bigger)
		return false;
	body->data = bigger;
	memcpy(body->data + body->size, data, size);
	body->size += size;
	body->data[body->size] = 0;
	return true;
}

static size_t on_data(char *data, size_t one, size_t n, void *context)
{
	return append(context, data, one * n) ? one * n : 0;
}

/* text NULL: GET or, with a method, that. */
static char *talk(const char *method, const char *url, const char *text, size_t *size, long *status)
{
	struct body body = { 0 };
	CURL *curl = curl_easy_init();
	struct curl_slist *headers = curl_slist_append(NULL, "Content-Type: application/json");
	curl_easy_setopt(curl, CURLOPT_URL, url);
	curl_easy_setopt(curl, CURLOPT_NOPROXY, "*");
	curl_easy_setopt(curl, CURLOPT_TIMEOUT, 60L);
	curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, on_data);
	curl_easy_setopt(curl, CURLOPT_WRITEDATA, &body);
	if (text) {
		curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
		curl_easy_setopt(curl, CURLOPT_POSTFIELDS, text);
	}
	if (method)
		curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, method);
	const CURLcode code = curl_easy_perform(curl);
	curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, status);
	curl_slist_free_all(headers);
	curl_easy_cleanup(curl);
	if (code) {
		free(body.data);
		fail_msg("%s: %s", url, curl_easy_strerror(code));
	}
	*size = body.size;
	return body.data ? body.data : calloc(1, 1);
}

char *lib_get(const char *url, size_t *size, long *status)
{
	return talk(NULL, url, NULL, size, status);
}

/* ---- WebDriver ---- */

/* Sends a command and returns "value", the caller's. Takes arguments over. */
static cJSON *command(struct lib_browser *browser, const char *path, cJSON *arguments)
{
	char url[1024];
	size_t size;
	long status;
	snprintf(url, sizeof url, "%s%s", browser->session, path);
	char *text = cJSON_PrintUnformatted(arguments);
	char *answer = talk(NULL, url, text, &size, &status);
	cJSON *json = cJSON_Parse(answer);
	cJSON *value = cJSON_DetachItemFromObjectCaseSensitive(json, "value");
	if (status != 200)
		fail_msg("WebDriver %s: %ld %.600s", path, status, answer);
	cJSON_Delete(json);
	cJSON_Delete(arguments);
	free(answer);
	free(text);
	return value;
}

bool lib_browser_there(void)
{
	return !system("command -v chromedriver >/dev/null 2>&1 && command -v chromium >/dev/null 2>&1");
}

void lib_browser_start(struct lib_browser *browser, int width, int height, bool phone)
{
	const char *const argv[] = { "chromedriver", "--port=0", NULL };
	char options[1024], device[256] = "";
	if (!lib_child_start(&browser->driver, argv, "started successfully on port ", 30000))
		fail_msg("chromedriver does not start");
	const char *port = strstr(browser->driver.line, "on port ") + strlen("on port ");
	snprintf(browser->session, sizeof browser->session, "http://127.0.0.1:%d/session", atoi(port));
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
	size_t size;
	long status;
	free(talk("DELETE", browser->session, NULL, &size, &status));
	lib_child_stop(&browser->driver);
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
	const int64_t end = now_ms() + timeout_ms;
	snprintf(script, sizeof script, "return Boolean(%s)", expression);
	for (;;) {
		cJSON *value = lib_browser_run(browser, script);
		const bool is_true = cJSON_IsTrue(value);
		cJSON_Delete(value);
		if (is_true)
			return;
		if (now_ms() > end)
			fail_msg("in vain for %d ms: %s", timeout_ms, expression);
		sleep_ms(50);
	}
}

char *lib_browser_errors(struct lib_browser *browser)
{
	struct body all = { 0 };
	cJSON *entries = command(browser, "/se/log", cJSON_Parse("{\"type\":\"browser\"}"));
	append(&all, "", 0);
	for (cJSON *e = entries ? entries->child : NULL; e; e = e->next) {
		char *message = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(e, "message"));
		const char *level = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(e, "level"));
		if (!message || !level || strcmp(level, "SEVERE") || strstr(message, "status of 4"))
			continue;
		append(&all, message, strlen(message));
		append(&all, "\n", 1);
	}
	cJSON_Delete(entries);
	return all.data;
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
