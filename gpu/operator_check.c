#include "gpu/operator_check.h"

#include "gpu/frame.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { RAYS = 128, TIMED_RAYS = 8192, TIMED_RUNS = 4, WAVELENGTHS = 4 };

static const double wavelengths_nm[WAVELENGTHS] = { 360, 440, 550, 830 };

/* At this much a picture of 1280 by 720 takes a quarter of an hour: nobody waits that long, and a loop
 * that a driver ends for us after many turns looks like this. */
static const double slowest_ms_per_ray = 1;

/* Rounding of exp() and sums may pass 1 by this much. */
static const double transmittance_slack = 1e-4;

struct check {
	struct workspace *ws;
	const struct operator_method *method;
	struct welkin_job job;
	void (*alive)(void *cls);
	void *cls;
	int memfd;
	double *map;                   /* a radiance job's, for TIMED_RAYS */
	struct operator_status status; /* what will be reported */
};

bool operator_check_prepare(struct programs *programs, struct error *err)
{
	for (int i = 0; i < operator_methods_count(); i++) {
		const struct operator_method *m = operator_methods_at(i);
		char kernel[64], included[64];
		if (m->index < 0 || !m->text)
			continue;
		snprintf(kernel, sizeof kernel, "methods/%s.comp", m->name);
		snprintf(included, sizeof included, "operator/%.40s", m->file);
		if (!programs_add_file(programs, kernel, kernel, operator_methods_kernel(m)) ||
			!programs_add_file(programs, included, m->file, strdup(m->text)))
			return error_set(err, "no memory for the operator's methods");
	}
	return true;
}

__attribute__((format(printf, 2, 3))) static bool refuse(struct check *c, const char *format, ...)
{
	va_list args;
	va_start(args, format);
	vsnprintf(c->status.reason, sizeof c->status.reason, format, args);
	va_end(args);
	c->status.state = OPERATOR_UNAVAILABLE;
	return false;
}

/* "file.glsl:12(5): error: …": the first line of a driver's log that speaks of an error. */
static void refuse_program(struct check *c, const char *log)
{
	const char *line = log;
	for (const char *p = log; p; p = strchr(p, '\n')) {
		p += *p == '\n';
		const size_t length = strcspn(p, "\n");
		if (memmem(p, length, "error", 5)) {
			line = p;
			break;
		}
	}
	char prefix[64];
	const int n = snprintf(prefix, sizeof prefix, "shader methods/%s.comp: ", c->method->name);
	if (!strncmp(line, prefix, (size_t)n))
		line += n;
	/* What a linker says has no place in the file. */
	const size_t shown = strcspn(line, "\n");
	const bool placed = memmem(line, shown, ".glsl:", 6) || memmem(line, shown, ".comp:", 6);
	refuse(c, "%s%s%.*s", placed ? "" : c->method->file, placed ? "" : ": ", (int)shown, line);
}

/* ---- directions ---- */

static void add(double (*rays)[3], int *n, double elevation_deg, double azimuth_deg)
{
	const double e = elevation_deg * (M_PI / 180), a = azimuth_deg * (M_PI / 180);
	double *d = rays[(*n)++];
	d[0] = cos(e) * sin(a);
	d[1] = sin(e);
	d[2] = -cos(e) * cos(a);
}

/* An even spread over the sphere, in the place of those that are left. */
static void spread(double (*rays)[3], int first, int n)
{
	for (int i = first; i < n; i++) {
		const double y = 1 - 2 * (i - first + 0.5) / (n - first), a = (i - first) * (M_PI * (3 - sqrt(5)));
		rays[i][0] = sqrt(1 - y * y) * cos(a);
		rays[i][1] = y;
		rays[i][2] = sqrt(1 - y * y) * sin(a);
	}
}

/* Where mappings have their poles: zenith, nadir, horizon, sun and the point opposite; then all over. */
static void set_rays(double (*rays)[3], int count, double sun_elevation_deg, double sun_azimuth_deg)
{
	static const double horizon_deg[] = { 0, 0.1, -0.1, 2, -2 };
	int n = 0;
	add(rays, &n, 90, 0);
	add(rays, &n, -90, 0);
	for (int turn = -180; turn < 180; turn += 60)
		for (size_t i = 0; i < sizeof horizon_deg / sizeof *horizon_deg; i++)
			add(rays, &n, horizon_deg[i], sun_azimuth_deg + turn);
	for (int i = -1; i <= 1; i++) {
		add(rays, &n, sun_elevation_deg + i * 0.3, sun_azimuth_deg);
		add(rays, &n, -sun_elevation_deg + i * 0.3, sun_azimuth_deg + 180);
	}
	spread(rays, n, count);
}

/* ---- one run ---- */

/* What was asked for, for a reason. */
static void describe(const struct check *c, char *text, size_t size)
{
	const struct welkin_request *r = &c->job.request;
	int n = snprintf(text, size, "with the sun at %g deg and the camera at %g m", r->sun.elevation_deg,
		r->camera.altitude_m);
	for (int i = 0; i < c->method->head.n_parameters && n < (int)size; i++)
		n += snprintf(text + n, size - (size_t)n, ", %s %g", c->method->head.parameters[i].name,
			r->method_values[c->method->method.first_value + i]);
}

static bool judge(struct check *c, long long nonfinite)
{
	const struct welkin_radiance_layout at = welkin_radiance_layout(c->job.n_directions, WAVELENGTHS);
	char where[200];
	describe(c, where, sizeof where);
	if (nonfinite)
		return refuse(c, "%s: %lld of %d numbers are not finite %s", c->method->file, nonfinite,
			2 * c->job.n_directions * WAVELENGTHS, where);
	for (int i = 0; i < c->job.n_directions * WAVELENGTHS; i++) {
		const double L = c->map[at.radiance + (size_t)i], T = c->map[at.transmittance + (size_t)i];
		const double elevation_deg =
			asin(c->map[at.directions + (size_t)(3 * (i / WAVELENGTHS) + 1)]) * (180 / M_PI);
		const double nm = wavelengths_nm[i % WAVELENGTHS];
		if (L < 0)
			return refuse(c, "%s: L is negative, %.3g, at elevation %.4g deg and %g nm, %s",
				c->method->file, L, elevation_deg, nm, where);
		if (T < 0 || T > 1 + transmittance_slack)
			return refuse(c, "%s: T is not between 0 and 1 but %.6g at elevation %.4g deg and %g nm, %s",
				c->method->file, T, elevation_deg, nm, where);
	}
	return true;
}

static double sky_ms(const struct welkin_result *result)
{
	for (int i = 0; i < result->n_passes; i++)
		if (!strcmp(result->passes[i].name, "sky"))
			return result->passes[i].ms;
	return 0;
}

/* Renders the job's rays. false with status.state unavailable, or, where that is not so, err and a lost context. */
static bool run_once(struct check *c, int rays, double *ms, struct error *err)
{
	struct error why = { "" };
	const struct welkin_sun *sun = &c->job.request.sun;
	c->job.n_directions = rays;
	set_rays((double(*)[3])c->map, rays, sun->elevation_deg, sun->azimuth_deg);
	memcpy(c->map + welkin_radiance_layout(rays, WAVELENGTHS).wavelengths, wavelengths_nm, sizeof wavelengths_nm);
	struct frame *frame = frame_create(c->ws, &c->job, c->memfd, &why);
	if (!frame)
		return refuse(c, "%s: %s", c->method->file, why.text);
	bool ok = true;
	while (ok && frame->stage != FRAME_DONE) {
		ok = frame_slice(c->ws, frame, err);
		c->alive(c->cls);
	}
	if (ok && frame->result.status != WELKIN_DONE)
		ok = refuse(c, "%s: %s", c->method->file, frame->result.message);
	*ms = sky_ms(&frame->result);
	ok = ok && judge(c, frame->result.nonfinite);
	frame_destroy(c->ws, frame);
	return ok;
}

/* Slow is what is slow three times: a machine that is busy elsewhere, or the code generation that a first dispatch
 * may hold, is no fault of the method's. *ms gets the least. */
static bool run(struct check *c, int rays, double *ms, struct error *err)
{
	const double most_ms = rays * slowest_ms_per_ray;
	*ms = INFINITY;
	for (int i = 0; i < 3 && *ms > most_ms; i++) {
		double again_ms;
		if (!run_once(c, rays, &again_ms, err))
			return false;
		*ms = fmin(*ms, again_ms);
	}
	if (*ms > most_ms)
		return refuse(c, "%s: a ray takes %.3g ms of device time, more than %g", c->method->file, *ms / rays,
			slowest_ms_per_ray);
	return true;
}

/* ---- what is tried ---- */

static const struct method_bound *bound_of(const struct method_head *head, const char *field)
{
	for (int i = 0; i < head->n_domain; i++)
		if (!strcmp(head->domain[i].field, field))
			return &head->domain[i];
	return NULL;
}

static double within(const struct check *c, const char *field, double value)
{
	const struct method_bound *b = bound_of(&c->method->head, field);
	return b ? fmin(fmax(value, b->min), b->max) : value;
}

/* The default request with this sun, camera and method, the numbers of its domain inside it. */
static bool set_request(struct check *c, double sun_deg, double altitude_m)
{
	struct welkin_draft draft;
	struct welkin_faults faults;
	memset(&draft, 0, sizeof draft);
	memset(&faults, 0, sizeof faults);
	draft.request.sun.elevation_deg = sun_deg;
	draft.request.sun.azimuth_deg = 30;
	draft.request.camera.altitude_m = altitude_m;
	draft.request.atmosphere.method = c->method->index;
	draft.request.atmosphere.turbidity = within(c, "atmosphere.turbidity", 3);
	draft.given[welkin_field_find("sun.elevation_deg")] = 1;
	draft.given[welkin_field_find("sun.azimuth_deg")] = 1;
	draft.given[welkin_field_find("camera.altitude_m")] = 1;
	draft.given[welkin_field_find("atmosphere.method")] = 1;
	draft.given[welkin_field_find("atmosphere.turbidity")] = 1;
	welkin_resolve(&draft, WELKIN_EXR, NULL, &c->job.request, &faults);
	if (faults.n)
		return refuse(c, "%s: %s: %s", c->method->file, faults.list[0].field, faults.list[0].detail);
	c->job.request.sun.disk = 0; /* the check is of the sky */
	return true;
}

static bool try_places(struct check *c, const double *suns_deg, int n_suns, const double *altitudes_m, int n_altitudes,
	const double *values, struct error *err)
{
	double last_sun = NAN, ms;
	for (int s = 0; s < n_suns; s++) {
		const double sun = within(c, "sun.elevation_deg", suns_deg[s]);
		if (sun == last_sun)
			continue;
		last_sun = sun;
		double last_altitude = NAN;
		for (int a = 0; a < n_altitudes; a++) {
			const double altitude = within(c, "camera.altitude_m", altitudes_m[a]);
			if (altitude == last_altitude)
				continue;
			last_altitude = altitude;
			if (!set_request(c, sun, altitude))
				return false;
			if (values)
				memcpy(c->job.request.method_values + c->method->method.first_value, values,
					(size_t)c->method->method.n_values * sizeof *values);
			if (!run(c, RAYS, &ms, err))
				return false;
		}
	}
	return true;
}

/* Parameters at the ends of their ranges: each by itself, then all at once. */
static bool try_parameters(struct check *c, struct error *err)
{
	static const double suns_deg[] = { 60, 3, -8 }, altitudes_m[] = { 1.7, 20e3 };
	const struct method_head *head = &c->method->head;
	double defaults[METHOD_PARAMETERS_MAX], values[METHOD_PARAMETERS_MAX];
	const int n = head->n_parameters;
	for (int i = 0; i < n; i++)
		defaults[i] = atof(head->parameters[i].default_text);
	for (int end = 0; end < 2; end++)
		for (int which = 0; which <= n && n > 0; which++) {
			for (int i = 0; i < n; i++) {
				const double extreme = end ? head->parameters[i].max : head->parameters[i].min;
				values[i] = which == n || which == i ? extreme : defaults[i];
			}
			if (!try_places(c, suns_deg, 3, altitudes_m, 2, values, err))
				return false;
		}
	return true;
}

static bool measure(struct check *c, struct error *err)
{
	double ms, least_ms = INFINITY;
	for (int i = 0; i < TIMED_RUNS; i++) {
		if (!set_request(c, within(c, "sun.elevation_deg", 45), within(c, "camera.altitude_m", 1.7)) ||
			!run(c, TIMED_RAYS, &ms, err))
			return false;
		least_ms = fmin(least_ms, ms); /* what else the machine does can only add to it */
	}
	c->status.ns_per_ray = least_ms * 1e6 / TIMED_RAYS;
	return true;
}

static bool try_all(struct check *c, struct error *err)
{
	static const double suns_deg[] = { 90, 45, 10, 1, 0, -1, -6, -18, -90 };
	static const double altitudes_m[] = { 0, 1.7, 1e3, 11e3, 60e3, 100e3, 1e6, 1e7 };
	return try_places(c, suns_deg, 9, altitudes_m, 8, NULL, err) && try_parameters(c, err) && measure(c, err);
}

bool operator_check(struct workspace *ws, int entry, void (*alive)(void *cls), void *cls, struct error *err)
{
	struct check c = { .ws = ws,
		.method = operator_methods_at(entry),
		.alive = alive,
		.cls = cls,
		.memfd = -1,
		.status.state = OPERATOR_AVAILABLE };
	struct error why = { "" };
	char file[64];
	bool lost = false;
	c.job = (struct welkin_job){
		.id = 1, .kind = WELKIN_JOB_RADIANCE, .n_directions = TIMED_RAYS, .n_wavelengths = WAVELENGTHS
	};
	const size_t size = welkin_job_bytes(&c.job);
	snprintf(file, sizeof file, "methods/%s.comp", c.method->name);
	c.memfd = memfd_create("welkin-check", MFD_CLOEXEC);
	void *map = c.memfd < 0 || ftruncate(c.memfd, (off_t)size)
			    ? MAP_FAILED
			    : mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, c.memfd, 0);
	c.map = map;
	if (map == MAP_FAILED)
		refuse(&c, "%s: no memory for the check", c.method->file);
	else if (!programs_get(ws->programs, file, "", &why))
		refuse_program(&c, why.text);
	else if (!try_all(&c, err))
		lost = c.status.state != OPERATOR_UNAVAILABLE;
	if (map != MAP_FAILED)
		munmap(map, size);
	if (c.memfd >= 0)
		close(c.memfd);
	/* What the first runs cost says little about those to come. */
	memset(ws->costs, 0, sizeof ws->costs);
	if (!lost)
		operator_methods_report(entry, &c.status);
	return !lost;
}
