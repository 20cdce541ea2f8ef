#include "server/methods.h"

#include "gpu/measured.h"
#include "gpu/operator_methods.h"
#include "server/log.h"
#include "server/supervisor.h"

#include <errno.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* Over once the renderer is ready, or can't become so. */
struct trial {
	int over_fd;
	char failure[256]; /* written before over_fd is, read after */
};

static void over(struct trial *trial)
{
	const uint64_t one = 1;
	if (write(trial->over_fd, &one, sizeof one) < 0)
		log_event(LEVEL_ERROR, "wake_failed", "error=\"%s\"", strerror(errno));
}

static void on_ready(void *cls, const struct welkin_device *device)
{
	(void)device;
	over(cls);
}

static void on_result(void *cls, const struct welkin_result *result)
{
	(void)cls;
	(void)result;
}

static void on_lost(void *cls, const char *reason, bool was_ready)
{
	struct trial *trial = cls;
	if (was_ready || *trial->failure)
		return;
	snprintf(trial->failure, sizeof trial->failure, "the renderer failed: %s", reason);
	over(trial);
}

static void on_tick(void *cls)
{
	(void)cls;
}

static const char *variable(const char *name, const char *fallback)
{
	const char *value = getenv(name);
	return value ? value : fallback;
}

/* Has a renderer check the operator's methods. */
static bool try_methods(const char *device, const char *shader_dir, struct error *err)
{
	struct trial trial = { .over_fd = eventfd(0, EFD_CLOEXEC) };
	const struct supervisor_config config = { .program = variable("WELKIN_RENDERER", ""),
		.device = device,
		.shader_dir = shader_dir,
		.slice_ms = 50,
		.table_mib = 256,
		.cold = true,
		.methods_fd = operator_methods_bundle(err),
		.watchdog_s = 10,
		.startup_s = 180,
		.ready = on_ready,
		.result = on_result,
		.lost = on_lost,
		.tick = on_tick,
		.cls = &trial };
	if (trial.over_fd < 0)
		error_set(err, "eventfd: %s", strerror(errno));
	struct supervisor *supervisor =
		trial.over_fd >= 0 && config.methods_fd >= 0 ? supervisor_start(&config, err) : NULL;
	struct pollfd wait = { .fd = trial.over_fd, .events = POLLIN };
	while (supervisor && poll(&wait, 1, -1) < 0 && errno == EINTR)
		;
	const bool tried = supervisor != NULL;
	supervisor_stop(supervisor);
	if (config.methods_fd >= 0)
		close(config.methods_fd);
	if (trial.over_fd >= 0)
		close(trial.over_fd);
	return tried && (!*trial.failure || error_set(err, "%s", trial.failure));
}

/* The best setting of a method by what was measured in one scene: its error, and time of a 1280×720 frame. */
static void print_measured(const struct method *m, int scene)
{
	const struct measured_point *best = NULL;
	for (const struct measured_point *p = welkin_measured; p->method; p++)
		if (p->scene == scene && !strcmp(p->method, m->name) && p->in_domain &&
			(!best || p->error < best->error))
			best = p;
	if (!best)
		return;
	printf("%-14s %-18s error %7.3f %%, %10.1f ms", "", welkin_measured_scenes[scene].name, 100 * best->error,
		measured_ms(best, 1280 * 720));
	if (best->steps || best->light_steps)
		printf(" (%d steps)", best->steps ? best->steps : best->light_steps);
	printf("\n");
}

/* What a glance needs: by day, at sunset, from space; /v1/methods has every scene and setting. */
static bool glance(const char *scene)
{
	return !strcmp(scene, "day-45") || !strcmp(scene, "low-2") || !strcmp(scene, "space-400km");
}

static void print_method(const struct method *m)
{
	printf("%-14s %s\n", m->name, m->summary && *m->summary ? m->summary : "(says nothing about itself)");
	if (m->source && *m->source)
		printf("%-14s source: %s\n", "", m->source);
	for (const struct method_range *r = m->domain; r && r->field; r++)
		printf("%-14s domain: %s from %.9g to %.9g (%s)\n", "", r->field, r->min, r->max, r->why ? r->why : "");
	for (int scene = 0; welkin_measured_scenes[scene].name; scene++)
		if (glance(welkin_measured_scenes[scene].name))
			print_measured(m, scene);
}

/* false: it can't be used. */
static bool print_operators(const struct operator_method *m, const struct operator_status *status)
{
	printf("%-14s file: %s\n", "", m->file);
	for (int i = 0; i < m->head.n_parameters; i++) {
		const struct method_parameter *p = &m->head.parameters[i];
		printf("%-14s method.%s.%s: %.9g to %.9g%s%s [%s]. %s\n", "", m->name, p->name, p->min, p->max,
			*p->unit ? " " : "", p->unit, p->default_text, p->help);
	}
	if (status->state == OPERATOR_UNAVAILABLE)
		printf("%-14s NOT AVAILABLE: %s\n", "", status->reason);
	else if (status->ns_per_ray > 0)
		printf("%-14s checked; %.1f ns of device time a ray\n", "", status->ns_per_ray);
	return status->state != OPERATOR_UNAVAILABLE;
}

static bool print_all(void)
{
	bool sound = true;
	printf("Errors are relative RMS of luminance of each method's best setting, times device time of a 1280x720 "
	       "frame\non %s.\n\n",
		welkin_measured_device);
	for (int i = 0; i < welkin_method_count; i++)
		if (!welkin_methods[i]->operators)
			print_method(welkin_methods[i]);
	for (int i = 0; i < operator_methods_count(); i++) {
		const struct operator_method *m = operator_methods_at(i);
		const struct operator_status status = operator_methods_status(i);
		if (m->index >= 0)
			print_method(&m->method);
		sound = print_operators(m, &status) && sound;
	}
	if (operator_methods_left_out())
		printf("%d more files are left out: the first %d are read\n", operator_methods_left_out(),
			OPERATOR_METHODS_MAX);
	return sound;
}

int methods_command(int argc, char **argv)
{
	static const char *const names[] = { "--method-dir", "--device", "--shader-dir" };
	const char *values[] = { variable("WELKIN_METHOD_DIR", ""), variable("WELKIN_DEVICE", "auto"),
		variable("WELKIN_SHADER_DIR", "") };
	struct error err = { "" };
	for (int a = 0; a < argc; a++) {
		int i = 0;
		size_t length = 0;
		for (; i < 3; i++) {
			length = strlen(names[i]);
			if (!strncmp(argv[a], names[i], length) && (argv[a][length] == '=' || !argv[a][length]))
				break;
		}
		const char *value = i == 3            ? NULL
				    : argv[a][length] ? argv[a] + length + 1
				    : a + 1 < argc    ? argv[++a]
						      : NULL;
		if (!value) {
			fprintf(stderr, "welkin methods: %s %s\n", argv[a],
				i == 3 ? "is not an option" : "needs a value");
			return 2;
		}
		values[i] = value;
	}
	log_set_level("error");
	if (!operator_methods_read(values[0], &err)) {
		fprintf(stderr, "welkin methods: %s\n", err.text);
		return 2;
	}
	const bool tried = !operator_methods_count() || try_methods(values[1], values[2], &err);
	const bool sound = print_all();
	if (!tried)
		fprintf(stderr, "welkin methods: the methods of %s could not be checked: %s\n", values[0], err.text);
	return tried && sound ? 0 : 1;
}
