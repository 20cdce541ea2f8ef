#include "tests/lib_http.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <curl/curl.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <png.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

void sleep_ms(int ms)
{
	nanosleep(&(struct timespec){ ms / 1000, ms % 1000 * 1000000L }, NULL);
}

double seconds_now(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + (double)t.tv_nsec / 1e9;
}

/* ---- the daemon ---- */

static struct daemon_process running[8];

static void kill_leftovers(void)
{
	for (size_t i = 0; i < sizeof running / sizeof *running; i++)
		if (running[i].pid) {
			kill(running[i].pid, SIGKILL);
			waitpid(running[i].pid, NULL, 0);
		}
}

static void own_path(char path[PATH_MAX])
{
	const ssize_t n = readlink("/proc/self/exe", path, PATH_MAX - 1);
	path[n > 0 ? n : 0] = 0;
}

const char *daemon_binary(void)
{
	static char path[PATH_MAX + 16];
	const char *given = getenv("WELKIN_BIN");
	if (given && *given)
		return given;
	char self[PATH_MAX];
	own_path(self);
	char *slash = strrchr(self, '/');
	if (slash)
		*slash = 0;
	slash = strrchr(self, '/'); /* BUILD/tests/test_x: the binary is BUILD/welkin */
	if (slash)
		*slash = 0;
	snprintf(path, sizeof path, "%s/welkin", self);
	return path;
}

/* Forks and executes; the child dies with this program. out ≥ 0 becomes its stdout, both: and stderr. */
static pid_t launch(const char *const arguments[], int out, bool both)
{
	const pid_t pid = fork();
	if (pid)
		return pid;
	prctl(PR_SET_PDEATHSIG, SIGKILL);
	if (out >= 0)
		dup2(out, STDOUT_FILENO);
	if (out >= 0 && both)
		dup2(out, STDERR_FILENO);
	execv(arguments[0], (char *const *)arguments);
	_exit(127);
}

/* The ready line, or NULL when the program ends or takes too long. */
static bool read_line(int fd, char *line, size_t size, double seconds)
{
	const double end = seconds_now() + seconds;
	size_t n = 0;
	while (n + 1 < size && seconds_now() < end) {
		struct pollfd p = { .fd = fd, .events = POLLIN };
		if (poll(&p, 1, 100) <= 0)
			continue;
		if (read(fd, line + n, 1) != 1)
			break;
		if (line[n++] == '\n')
			break;
	}
	line[n] = 0;
	return n && line[n - 1] == '\n';
}

struct daemon_process *daemon_start(bool fake, const char *const options[])
{
	static bool prepared;
	if (!prepared) {
		atexit(kill_leftovers);
		signal(SIGPIPE, SIG_IGN);
		curl_global_init(CURL_GLOBAL_DEFAULT);
		prepared = true;
	}
	size_t slot = 0;
	while (slot < sizeof running / sizeof *running && running[slot].pid)
		slot++;
	assert_true(slot < sizeof running / sizeof *running);
	struct daemon_process *d = &running[slot];
	char self[PATH_MAX], line[1024];
	const char *arguments[64] = { daemon_binary(), "serve", "--listen", "127.0.0.1:0", "--admin", "127.0.0.1:0",
		"--log-level", getenv("WELKIN_TEST_LOG") ? getenv("WELKIN_TEST_LOG") : "error" };
	int n = 8, out[2];
	own_path(self);
	if (fake) {
		arguments[n++] = "--renderer";
		arguments[n++] = self;
	}
	for (int i = 0; options && options[i] && n < 63; i++)
		arguments[n++] = options[i];
	assert_int_equal(pipe2(out, O_CLOEXEC), 0);
	d->pid = launch(arguments, out[1], false);
	assert_true(d->pid > 0);
	close(out[1]);
	if (!read_line(out[0], line, sizeof line, 60))
		fail_msg("%s serve did not become ready", arguments[0]);
	close(out[0]);
	if (sscanf(line, "welkin ready: %127s admin %127s device %159[^\n]", d->url, d->admin, d->device) != 3)
		fail_msg("unexpected ready line: %s", line);
	d->port = atoi(strrchr(d->url, ':') + 1);
	d->admin_port = atoi(strrchr(d->admin, ':') + 1);
	return d;
}

void daemon_stop(struct daemon_process *d)
{
	int status = -1;
	pid_t got = 0;
	kill(d->pid, SIGTERM);
	for (int i = 0; i < 600 && !got; i++) {
		got = waitpid(d->pid, &status, WNOHANG);
		if (!got)
			sleep_ms(20);
	}
	if (got != d->pid)
		fail_msg("the daemon did not stop");
	d->pid = 0;
	if (!WIFEXITED(status) || WEXITSTATUS(status))
		fail_msg("the daemon ended with wait status %#x", status);
}

/* Walks /proc for children of the daemon: the living one, and how many are dead but not reaped. */
/* A process that reads a scene comes and goes. */
static bool is_loader(int pid)
{
	char path[64], name[14] = "";
	snprintf(path, sizeof path, "/proc/%d/cmdline", pid);
	FILE *file = fopen(path, "r");
	if (!file)
		return false;
	const size_t n = fread(name, 1, sizeof name - 1, file);
	fclose(file);
	return n == sizeof name - 1 && !strcmp(name, "welkin-loader");
}

static pid_t children(const struct daemon_process *d, int *zombies)
{
	pid_t alive = 0;
	DIR *proc = opendir("/proc");
	assert_non_null(proc);
	for (struct dirent *e; (e = readdir(proc));) {
		char path[300], state;
		int pid, parent;
		snprintf(path, sizeof path, "/proc/%s/stat", e->d_name);
		FILE *file = isdigit((unsigned char)*e->d_name) ? fopen(path, "r") : NULL;
		if (!file)
			continue;
		if (fscanf(file, "%d (%*[^)]) %c %d", &pid, &state, &parent) == 3 && parent == d->pid) {
			if (state == 'Z')
				++*zombies;
			else if (!is_loader(pid))
				alive = pid;
		}
		fclose(file);
	}
	closedir(proc);
	return alive;
}

pid_t daemon_renderer(const struct daemon_process *d)
{
	int zombies = 0;
	return children(d, &zombies);
}

int daemon_zombies(const struct daemon_process *d)
{
	int zombies = 0;
	children(d, &zombies);
	return zombies;
}

int daemon_run(const char *const arguments[], char **output)
{
	const char *all[32] = { daemon_binary() };
	int out[2], status = -1;
	for (int i = 0; arguments[i] && i < 30; i++)
		all[i + 1] = arguments[i];
	assert_int_equal(pipe2(out, O_CLOEXEC), 0);
	const pid_t pid = launch(all, out[1], true);
	assert_true(pid > 0);
	close(out[1]);
	*output = raw_read(out[0], 20, NULL);
	close(out[0]);
	assert_int_equal(waitpid(pid, &status, 0), pid);
	return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* ---- libcurl ---- */

struct growing {
	char *data;
	size_t size;
};

static size_t grow(char *bytes, size_t size, size_t n, void *cls)
{
	struct growing *g = cls;
	char *data = realloc(g->data, g->size + size * n + 1);
	if (!data)
		return 0;
	memcpy(data + g->size, bytes, size * n);
	g->data = data;
	g->size += size * n;
	data[g->size] = 0;
	return size * n;
}

static char *or_empty(char *text)
{
	return text ? text : calloc(1, 1);
}

struct http_reply ask(
	const char *method, const char *base, const char *path, const char *const headers[], const char *body)
{
	struct http_reply reply = { 0 };
	struct growing head = { 0 }, content = { 0 };
	char url[8192];
	struct curl_slist *list = NULL;
	CURL *curl = curl_easy_init();
	assert_non_null(curl);
	snprintf(url, sizeof url, "%s%s", base, *path == '/' ? path + 1 : path);
	for (int i = 0; headers && headers[i]; i++)
		list = curl_slist_append(list, headers[i]);
	curl_easy_setopt(curl, CURLOPT_URL, url);
	curl_easy_setopt(curl, CURLOPT_PATH_AS_IS, 1L);
	curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
	curl_easy_setopt(curl, CURLOPT_PROXY, "");
	curl_easy_setopt(curl, CURLOPT_TIMEOUT, 60L);
	curl_easy_setopt(curl, CURLOPT_ERRORBUFFER, reply.error);
	curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, grow);
	curl_easy_setopt(curl, CURLOPT_WRITEDATA, &content);
	curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, grow);
	curl_easy_setopt(curl, CURLOPT_HEADERDATA, &head);
	if (body)
		curl_easy_setopt(curl, CURLOPT_POSTFIELDS, body);
	if (!strcmp(method, "HEAD"))
		curl_easy_setopt(curl, CURLOPT_NOBODY, 1L);
	curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, method);
	curl_easy_setopt(curl, CURLOPT_HTTPHEADER, list);
	const CURLcode code = curl_easy_perform(curl);
	if (code == CURLE_OK)
		curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &reply.status);
	else if (!*reply.error)
		snprintf(reply.error, sizeof reply.error, "%s", curl_easy_strerror(code));
	curl_easy_getinfo(curl, CURLINFO_TOTAL_TIME, &reply.seconds);
	curl_slist_free_all(list);
	curl_easy_cleanup(curl);
	reply.headers = or_empty(head.data);
	reply.body = or_empty(content.data);
	reply.size = content.size;
	return reply;
}

struct http_reply get(const char *base, const char *path)
{
	return ask("GET", base, path, NULL, NULL);
}

struct http_reply fetch(const char *base, const char *path, int status)
{
	struct http_reply r = get(base, path);
	if (r.status != status)
		fail_msg("%s: status %ld, not %d: %s%.400s", path, r.status, status, r.error, r.body);
	return r;
}

struct http_reply fetch_soon(const char *base, const char *path)
{
	struct http_reply r = get(base, path);
	for (int i = 0; i < 80 && r.status != 200; i++) {
		reply_finish(&r);
		sleep_ms(100);
		r = get(base, path);
	}
	if (r.status != 200)
		fail_msg("%s: status %ld: %s%.400s", path, r.status, r.error, r.body);
	return r;
}

double pictures_differ(const char *base, const char *a, const char *b)
{
	const char *paths[2] = { a, b };
	unsigned char *rgb[2];
	size_t sizes[2], differ = 0;
	for (int k = 0; k < 2; k++) {
		struct http_reply r = fetch_soon(base, paths[k]);
		png_image image = { .version = PNG_IMAGE_VERSION };
		assert_true(png_image_begin_read_from_memory(&image, r.body, r.size));
		image.format = PNG_FORMAT_RGB;
		sizes[k] = PNG_IMAGE_SIZE(image);
		rgb[k] = malloc(sizes[k]);
		assert_non_null(rgb[k]);
		assert_true(png_image_finish_read(&image, NULL, rgb[k], 0, NULL));
		reply_finish(&r);
	}
	assert_int_equal(sizes[0], sizes[1]);
	for (size_t i = 0; i < sizes[0]; i++)
		differ += abs(rgb[0][i] - rgb[1][i]) > 2;
	free(rgb[0]);
	free(rgb[1]);
	return (double)differ / (double)sizes[0];
}

void reply_finish(struct http_reply *reply)
{
	free(reply->headers);
	free(reply->body);
	*reply = (struct http_reply){ 0 };
}

const char *header_of(const struct http_reply *reply, const char *name)
{
	static _Thread_local char value[8192];
	const size_t n = strlen(name);
	for (const char *line = reply->headers; line && *line;
		line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL)
		if (!strncasecmp(line, name, n) && line[n] == ':') {
			const char *start = line + n + 1 + strspn(line + n + 1, " \t");
			snprintf(value, sizeof value, "%.*s", (int)strcspn(start, "\r\n"), start);
			return value;
		}
	return NULL;
}

double metric(const struct daemon_process *d, const char *series)
{
	double value = -1;
	struct http_reply reply = get(d->admin, "metrics");
	const size_t n = strlen(series);
	assert_int_equal(reply.status, 200);
	for (const char *line = reply.body; line && *line; line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL)
		if (!strncmp(line, series, n) && line[n] == ' ')
			value = strtod(line + n, NULL);
	reply_finish(&reply);
	return value;
}

double metric_wait(const struct daemon_process *d, const char *series, double least, double seconds)
{
	const double end = seconds_now() + seconds;
	double value;
	while ((value = metric(d, series)) < least && seconds_now() < end)
		sleep_ms(20);
	return value;
}

double timing_sum(const char *server_timing, double *total, double *least)
{
	double sum = 0;
	*total = 0;
	*least = 1e300;
	for (const char *c = server_timing; c && *c;) {
		c += strspn(c, ", ");
		const char *end = c + strcspn(c, ",");
		const char *dur = strstr(c, ";dur=");
		const double ms = dur && dur < end ? strtod(dur + 5, NULL) : 0;
		if (ms < *least)
			*least = ms;
		if (!strncmp(c, "total;", 6))
			*total = ms;
		else
			sum += ms;
		c = end;
	}
	return sum;
}

/* ---- plain sockets ---- */

int raw_connect(int port)
{
	const struct sockaddr_in address = {
		.sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)
	};
	const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
	assert_true(fd >= 0);
	assert_int_equal(connect(fd, (const struct sockaddr *)&address, sizeof address), 0);
	return fd;
}

void raw_send_bytes(int fd, const char *bytes, size_t size)
{
	while (size) {
		const ssize_t n = send(fd, bytes, size, MSG_NOSIGNAL);
		if (n <= 0)
			return;
		bytes += n;
		size -= (size_t)n;
	}
}

void raw_send(int fd, const char *text)
{
	raw_send_bytes(fd, text, strlen(text));
}

char *raw_read(int fd, double seconds, bool *closed)
{
	struct growing g = { 0 };
	char chunk[65536];
	bool ended = false;
	while (!ended) {
		struct pollfd p = { .fd = fd, .events = POLLIN };
		if (poll(&p, 1, (int)(seconds * 1e3)) <= 0)
			break;
		const ssize_t n = read(fd, chunk, sizeof chunk);
		if (n > 0)
			grow(chunk, 1, (size_t)n, &g);
		else
			ended = true;
	}
	if (closed)
		*closed = ended;
	return or_empty(g.data);
}

char *raw_ask(int port, const char *text, double seconds, bool *closed)
{
	const int fd = raw_connect(port);
	raw_send(fd, text);
	char *reply = raw_read(fd, seconds, closed);
	close(fd);
	return reply;
}
