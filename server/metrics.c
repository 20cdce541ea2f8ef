#include "server/metrics.h"
#include "server/version.h"

#include <stdatomic.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

static const char *const resource_names[RESOURCE_COUNT] = { "/v1/render.png", "/v1/render.exr", "/v1/render",
	"/v1/sequences", "/v1/radiance", "/v1/noise", "/v1/methods", "/v1/presets", "/v1/scenes", "/version",
	"/openapi.json", "/", "other" };
static const char *const stage_names[STAGE_COUNT] = { "queue", "render", "encode", "request" };
static const char *const stage_help[STAGE_COUNT] = { "Time a render waited for the renderer.",
	"Time from handing a render out to its result.", "Time to encode a reply.",
	"Time from a complete request to its reply, image and radiance resources." };
static const int statuses[] = { 200, 201, 204, 304, 400, 403, 404, 405, 406, 413, 414, 415, 422, 429, 431, 500, 503,
	504, 0 };
enum { STATUS_COUNT = sizeof statuses / sizeof *statuses };

static const double bucket_s[] = { 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30,
	60 };
enum { BUCKET_COUNT = sizeof bucket_s / sizeof *bucket_s };

struct histogram {
	atomic_ullong buckets[BUCKET_COUNT + 1]; /* not cumulative; the last is +Inf */
	atomic_ullong sum_us;
};

static atomic_ullong replies[RESOURCE_COUNT][STATUS_COUNT];
static struct histogram stages[STAGE_COUNT];
static atomic_ullong pixels_rendered, restarts, cancelled, reaped;
static atomic_ullong frames, sequences_complete, sequences_cut;
static atomic_int connections, requests, sequences;

void metrics_count_reply(enum metrics_resource resource, int status)
{
	int s = 0;
	while (statuses[s] && statuses[s] != status)
		s++;
	atomic_fetch_add(&replies[resource][s], 1);
}

void metrics_observe(enum metrics_stage stage, double seconds)
{
	struct histogram *h = &stages[stage];
	int b = 0;
	while (b < BUCKET_COUNT && seconds > bucket_s[b])
		b++;
	atomic_fetch_add(&h->buckets[b], 1);
	atomic_fetch_add(&h->sum_us, seconds > 0 ? (unsigned long long)(seconds * 1e6) : 0);
}

void metrics_add_pixels(double pixels)
{
	atomic_fetch_add(&pixels_rendered, (unsigned long long)pixels);
}

void metrics_sequences(int change)
{
	atomic_fetch_add(&sequences, change);
}

void metrics_count_frame(void)
{
	atomic_fetch_add(&frames, 1);
}

void metrics_count_sequence(bool complete)
{
	atomic_fetch_add(complete ? &sequences_complete : &sequences_cut, 1);
}

void metrics_count_restart(void)
{
	atomic_fetch_add(&restarts, 1);
}

void metrics_count_cancelled(void)
{
	atomic_fetch_add(&cancelled, 1);
}

void metrics_count_reaped(void)
{
	atomic_fetch_add(&reaped, 1);
}

void metrics_connections(int change)
{
	atomic_fetch_add(&connections, change);
}

void metrics_requests(int change)
{
	atomic_fetch_add(&requests, change);
}

double metrics_resident_bytes(pid_t pid)
{
	char path[64];
	long total = 0, resident = 0;
	snprintf(path, sizeof path, "/proc/%d/statm", (int)pid);
	FILE *file = pid > 0 ? fopen(path, "r") : NULL;
	if (!file)
		return 0;
	if (fscanf(file, "%ld %ld", &total, &resident) != 2)
		resident = 0;
	fclose(file);
	return (double)resident * (double)sysconf(_SC_PAGESIZE);
}

static void head(struct text *text, const char *name, const char *type, const char *help)
{
	text_printf(text, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

static void single(struct text *text, const char *name, const char *type, const char *help, double value)
{
	head(text, name, type, help);
	text_printf(text, "%s %.17g\n", name, value);
}

/* A label value: backslash, quote and newline escaped. */
static void label(struct text *text, const char *name, const char *value)
{
	text_printf(text, "%s=\"", name);
	for (const char *c = value; *c; c++) {
		if (*c == '\n')
			text_puts(text, "\\n");
		else if (*c == '"' || *c == '\\')
			text_printf(text, "\\%c", *c);
		else
			text_append(text, c, 1);
	}
	text_puts(text, "\"");
}

static void replies_text(struct text *text)
{
	head(text, "welkin_http_requests_total", "counter", "Requests answered, by resource and status.");
	for (int r = 0; r < RESOURCE_COUNT; r++)
		for (int s = 0; s < STATUS_COUNT; s++) {
			const unsigned long long n = replies[r][s];
			/* The series that alerts are built on exist from the start. */
			if (!n && !(statuses[s] == 200 || statuses[s] == 503))
				continue;
			text_printf(text, "welkin_http_requests_total{resource=\"%s\",status=\"", resource_names[r]);
			if (statuses[s])
				text_printf(text, "%d\"} %llu\n", statuses[s], n);
			else
				text_printf(text, "other\"} %llu\n", n);
		}
}

static void histogram_text(struct text *text, enum metrics_stage stage)
{
	char name[64];
	const struct histogram *h = &stages[stage];
	unsigned long long sum = 0;
	snprintf(name, sizeof name, "welkin_%s_seconds", stage_names[stage]);
	head(text, name, "histogram", stage_help[stage]);
	for (int b = 0; b <= BUCKET_COUNT; b++) {
		sum += h->buckets[b];
		if (b < BUCKET_COUNT)
			text_printf(text, "%s_bucket{le=\"%g\"} %llu\n", name, bucket_s[b], sum);
		else
			text_printf(text, "%s_bucket{le=\"+Inf\"} %llu\n", name, sum);
	}
	text_printf(text, "%s_sum %.6f\n%s_count %llu\n", name, (double)h->sum_us / 1e6, name, sum);
}

static void info_text(const struct metrics_gauges *g, struct text *text)
{
	head(text, "welkin_build_info", "gauge", "Always 1; version and revision as labels.");
	text_puts(text, "welkin_build_info{");
	label(text, "version", build_version);
	text_puts(text, ",");
	label(text, "revision", build_revision);
	text_puts(text, "} 1\n");
	head(text, "welkin_device_info", "gauge", "Always 1; the device that renders as labels.");
	text_puts(text, "welkin_device_info{");
	label(text, "device", g->device.name);
	text_puts(text, ",");
	label(text, "vendor", g->device.vendor);
	text_puts(text, ",");
	label(text, "gl", g->device.version);
	text_printf(text, ",software=\"%s\"} 1\n", g->device.software ? "true" : "false");
	head(text, "welkin_resident_memory_bytes", "gauge", "Resident memory, by process.");
	text_printf(text, "welkin_resident_memory_bytes{process=\"server\"} %.0f\n", metrics_resident_bytes(getpid()));
	text_printf(text, "welkin_resident_memory_bytes{process=\"renderer\"} %.0f\n",
		metrics_resident_bytes(g->renderer_pid));
}

void metrics_text(const struct metrics_gauges *g, struct text *text)
{
	replies_text(text);
	for (int s = 0; s < STAGE_COUNT; s++)
		histogram_text(text, s);
	single(text, "welkin_ready", "gauge", "1 while a small render works.", g->ready);
	single(text, "welkin_http_requests_in_flight", "gauge", "Requests being answered.", requests);
	single(text, "welkin_http_connections", "gauge", "Open connections.", connections);
	single(text, "welkin_sequences_under_way", "gauge", "Sequences whose frames are being rendered or sent.",
		sequences);
	single(text, "welkin_sequence_frames_total", "counter", "Frames of sequences that were sent.", (double)frames);
	head(text, "welkin_sequences_total", "counter",
		"Sequences that began to stream, by whether the last frame was sent.");
	text_printf(text,
		"welkin_sequences_total{complete=\"true\"} %llu\nwelkin_sequences_total{complete=\"false\"} %llu\n",
		(unsigned long long)sequences_complete, (unsigned long long)sequences_cut);
	single(text, "welkin_http_reaped_connections_total", "counter", "Connections closed for missing a deadline.",
		(double)reaped);
	single(text, "welkin_queue_depth", "gauge", "Renders waiting for the renderer.", g->queue_depth);
	single(text, "welkin_renders_in_flight", "gauge", "Renders at the renderer.", g->renders_in_flight);
	single(text, "welkin_renders_cancelled_total", "counter", "Renders given up because every client had gone.",
		(double)cancelled);
	single(text, "welkin_pixels_rendered_total", "counter", "Pixels, and directions times wavelengths, rendered.",
		(double)pixels_rendered);
	single(text, "welkin_renderer_restarts_total", "counter", "Renderer processes that were lost and replaced.",
		(double)restarts);
	single(text, "welkin_cache_hits_total", "counter", "Images answered from the cache.", (double)g->cache_hits);
	single(text, "welkin_cache_misses_total", "counter", "Images not found in the cache.", (double)g->cache_misses);
	single(text, "welkin_cache_bytes", "gauge", "Memory held by cached images.", (double)g->cache_bytes);
	single(text, "welkin_cache_entries", "gauge", "Images in the cache.", (double)g->cache_entries);
	single(text, "welkin_scene_bytes", "gauge", "Memory held by meshes of scenes.", (double)g->scene_bytes);
	single(text, "welkin_scene_meshes", "gauge", "Scenes whose meshes are in memory.", (double)g->scene_meshes);
	single(text, "welkin_scene_loads_total", "counter", "Scenes read, with or without success.",
		(double)g->scene_loads);
	single(text, "welkin_scene_faults_total", "counter", "Scenes that could not be read.", (double)g->scene_faults);
	info_text(g, text);
}
