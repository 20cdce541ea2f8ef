/*
 * Where each method fails (`make failures`): over sun elevation × camera altitude, and along one parameter at a
 * time, a few dozen directions per cell, the awkward ones among them (zenith, nadir, horizon ± 0.1°, sun,
 * antisolar point). A direction fails when its radiance is
 *
 *     not finite, or negative;
 *     discontinuous: a thousandth of a degree beside it, another number by more than JUMP;
 *     wrong: off `reference` by more than WRONG and four of its standard errors. Methods of single
 *     scattering are held against the first order of `reference`; analytic ones have WRONG_ANALYTIC, for
 *     they know nothing of the media. Where the path tracer did not settle in its time (late twilight, thick
 *     air), a direction is wrong if it is off another method of all orders as well.
 *
 *     failures [--smoke] FOLDER
 *
 * writes failures.csv and, for tests/failures.gp, failure-METHOD.txt. Status 1 when a method gives light that
 * is not finite or negative within the domain that it declares.
 */
#include "gpu/clock.h"
#include "tests/lib_render.h"
#include "tests/lib_request.h"
#include "tests/lib_settings.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BANDS = 4, BASES_MAX = 48, DIRECTIONS_MAX = 2 * BASES_MAX, METHODS_MAX = 64 };

static const double nm[BANDS] = { 440, 500, 555, 680 };
static const double jump = 0.05, wrong_physical = 0.15, wrong_analytic = 1, beside_deg = 0.001;
static const double dark = 1e-4;     /* of the cell's brightest direction: errors are relative to at least this */
static const double nothing = 1e-12; /* W/m²/sr/nm: a millionth of a moonless night */
static const double reference_error = 0.03, reference_budget_ms = 150;

enum failing { SOUND, DISCONTINUOUS, WRONG, NEGATIVE, NONFINITE, KINDS };
static const char *const kind_names[KINDS] = { "sound", "discontinuous", "wrong", "negative", "nonfinite" };

/* A request, and the directions to look in: each is followed by one beside it. */
struct cell {
	struct welkin_request request;
	int n;
	double directions[DIRECTIONS_MAX][3], elevation_deg[DIRECTIONS_MAX], azimuth_deg[DIRECTIONS_MAX];
	double *truth[2]; /* radiance jobs' replies of `reference`: all orders, the first */
};

struct verdict {
	int count[KINDS]; /* directions */
	int crossed;      /* of them, held against another method than the reference */
	enum failing worst;
	double worst_value; /* the jump, the error, or the radiance */
	int direction;
};

struct run {
	struct lib_renderer renderer;
	FILE *csv;
	const char *folder;
	bool smoke;
	int reference; /* method */
	int unsound;   /* cells within a domain with values that can't be */
};

/* ---- cells ---- */

static void look(struct cell *c, double elevation_deg, double azimuth_deg)
{
	/* The other one lies away from the horizon, where light does jump. */
	const double dip = -acos(c->request.atmosphere.planet_radius_m /
				   (c->request.atmosphere.planet_radius_m + c->request.camera.altitude_m)) *
			   180 / M_PI;
	const double away = (elevation_deg >= dip) == (elevation_deg < 89) ? beside_deg : -beside_deg;
	for (int i = 0; i < 2; i++) {
		c->elevation_deg[c->n] = elevation_deg + i * away;
		c->azimuth_deg[c->n] = azimuth_deg;
		direction_of(c->elevation_deg[c->n], azimuth_deg, c->directions[c->n]);
		c->n++;
	}
}

static void fill(struct cell *c, const struct welkin_request *request)
{
	static const double elevations[] = { 60, 30, 10, 3, -30 }, around[] = { 0.1, 0.02, -0.1, -0.02 };
	*c = (struct cell){ .request = *request };
	const double R = request->atmosphere.planet_radius_m, h = request->camera.altitude_m;
	const double dip = -acos(R / (R + h)) * 180 / M_PI, sun = request->sun.elevation_deg;
	look(c, 90, 0);
	look(c, -90, 0);
	look(c, 89.99, 90);
	for (int a = 0; a <= 180; a += 90) {
		for (size_t i = 0; i < sizeof elevations / sizeof *elevations; i++)
			look(c, elevations[i], a);
		for (size_t i = 0; i < sizeof around / sizeof *around; i++)
			look(c, dip + around[i], a);
		look(c, dip + 0.5, a + 10);
		look(c, dip - 3, a + 10);
	}
	look(c, sun, 0);
	look(c, sun + (sun < 89 ? 0.5 : -0.5), 0);
	look(c, -sun, 180);
}

static bool ask(struct run *run, const struct cell *c, struct welkin_request request, double **reply)
{
	struct welkin_result result;
	return lib_radiance(&run->renderer, &request, c->directions, c->n, nm, BANDS, reply, &result);
}

/* Every other direction is the twin of the one before: only the first is asked for. */
static bool find_truth(struct run *run, struct cell *c)
{
	double bases[BASES_MAX][3];
	for (int i = 0; i < c->n / 2; i++)
		memcpy(bases[i], c->directions[2 * i], sizeof bases[i]);
	for (int order = 0; order < 2; order++) {
		struct welkin_request request = c->request;
		struct welkin_result result;
		request.atmosphere.method = run->reference;
		request.atmosphere.max_order = order;
		request.max_error = reference_error;
		request.budget_ms = reference_budget_ms;
		if (!lib_radiance(&run->renderer, &request, (const double(*)[3])bases, c->n / 2, nm, BANDS,
			    &c->truth[order], &result))
			return false;
	}
	return true;
}

static void forget_truth(struct cell *c)
{
	free(c->truth[0]);
	free(c->truth[1]);
}

/* ---- judging ---- */

static void note(struct verdict *v, enum failing kind, double value, int direction)
{
	v->count[kind]++;
	if (kind > v->worst || (kind == v->worst && fabs(value) > fabs(v->worst_value))) {
		v->worst = kind;
		v->worst_value = value;
		v->direction = direction;
	}
}

/* Of one direction, band and its neighbour: the value, that beside it, the true one with its standard error. */
static enum failing judge(
	double L, double L_beside, double truth, double std_error, double least, double wrong, double *value)
{
	*value = L;
	if (!isfinite(L))
		return NONFINITE;
	if (L < 0)
		return NEGATIVE;
	const double scale = fmax(truth, least);
	*value = (L - truth) / scale;
	if (fabs(L - truth) > wrong * scale + 4 * std_error)
		return WRONG;
	*value = (L_beside - L) / fmax(fmax(L, L_beside), least);
	return isfinite(L_beside) && fabs(*value) > jump ? DISCONTINUOUS : SOUND;
}

/* Rare paths carry the light and the reference did not settle in its time: its standard error may be far too small. */
static bool unsure(double truth, double std_error)
{
	return !(truth > 0) || std_error > 2 * reference_error * truth;
}

/* stand_in: the reply of another method, or NULL. */
static struct verdict judge_all(
	const struct cell *c, const struct method *method, const double *reply, const double *stand_in)
{
	const struct welkin_radiance_layout at = welkin_radiance_layout(c->n, BANDS),
					    true_at = welkin_radiance_layout(c->n / 2, BANDS);
	const double *truths = c->truth[method->single_scattering] + true_at.radiance,
		     *errors = c->truth[method->single_scattering] + true_at.std_error;
	const double wrong = method->physical ? wrong_physical : wrong_analytic;
	struct verdict v = { .worst = SOUND };
	for (int i = 0; i < c->n / 2; i++) {
		enum failing worst = SOUND;
		double worst_value = 0;
		bool crossed = false;
		for (int b = 0; b < BANDS; b++) {
			const double *L = reply + at.radiance + (size_t)(2 * i * BANDS + b);
			double truth = truths[i * BANDS + b], std_error = errors[i * BANDS + b], brightest = 0, value;
			for (int k = 0; k < c->n / 2; k++)
				brightest = fmax(brightest, truths[k * BANDS + b]);
			if (stand_in && !method->single_scattering && unsure(truth, std_error)) {
				const double other = stand_in[at.radiance + (size_t)(2 * i * BANDS + b)];
				if (fabs(L[0] - other) < fabs(L[0] - truth)) {
					truth = other;
					std_error = 0;
				}
				crossed = true;
			}
			const enum failing kind =
				judge(L[0], L[BANDS], truth, std_error, fmax(dark * brightest, nothing), wrong, &value);
			if (kind > worst || (kind == worst && fabs(value) > fabs(worst_value))) {
				worst = kind;
				worst_value = value;
			}
		}
		v.crossed += crossed;
		note(&v, worst, worst_value, 2 * i);
	}
	return v;
}

static void write_row(struct run *run, const struct cell *c, const char *sweep, double x, double y,
	const struct method *m, bool covered, const struct verdict *v)
{
	fprintf(run->csv, "%s,%s,%.9g,%.9g,%d,%s,%d,%d,%d,%d,%d,%.4g,%.4g,%.4g,%s,%d,\"%s\"\n", m->name, sweep, x, y,
		covered, kind_names[v->worst], c->n / 2, v->count[NONFINITE], v->count[NEGATIVE],
		v->count[DISCONTINUOUS], v->count[WRONG], v->worst_value, c->elevation_deg[v->direction],
		c->azimuth_deg[v->direction], m->single_scattering ? "reference: first order" : "reference: all orders",
		v->crossed, run->renderer.device.name);
	fflush(run->csv);
	if (covered && v->worst >= NEGATIVE) {
		run->unsound++;
		fprintf(stderr, "failures: %s, %s %g (%g): %s %g at elevation %g, azimuth %g\n", m->name, sweep, x, y,
			kind_names[v->worst], v->worst_value, c->elevation_deg[v->direction],
			c->azimuth_deg[v->direction]);
	}
}

/* The first method of all orders by tables or formula, other than this one. */
static const double *stand_in_for(int method, double *const replies[])
{
	for (int m = 0; m < welkin_method_count; m++) {
		const struct method *other = welkin_methods[m];
		if (m != method && other->physical && !other->single_scattering && !other->progressive)
			return replies[m];
	}
	return NULL;
}

/* All methods on one cell. worst: by method, and KINDS more where it is outside of the domain; may be NULL. */
static bool measure(
	struct run *run, const struct welkin_request *request, const char *sweep, double x, double y, int *worst)
{
	struct cell c;
	double *replies[METHODS_MAX] = { NULL };
	fill(&c, request);
	bool ok = find_truth(run, &c);
	for (int m = 0; ok && m < welkin_method_count; m++) {
		c.request.atmosphere.method = m;
		ok = m == run->reference || ask(run, &c, c.request, &replies[m]);
	}
	for (int m = 0; ok && m < welkin_method_count; m++) {
		if (m == run->reference)
			continue;
		c.request.atmosphere.method = m;
		const bool covered = method_covers(m, &c.request);
		const struct verdict v = judge_all(&c, welkin_methods[m], replies[m], stand_in_for(m, replies));
		write_row(run, &c, sweep, x, y, welkin_methods[m], covered, &v);
		if (worst)
			worst[m] = (int)v.worst + (covered ? 0 : KINDS);
	}
	for (int m = 0; m < welkin_method_count; m++)
		free(replies[m]);
	forget_truth(&c);
	return ok;
}

/* ---- the map ---- */

static const double suns[] = { -18, -12, -8, -6, -4, -2, 0, 2, 5, 10, 30, 60, 90 };
static const double altitudes[] = { 0, 0.5, 2, 100, 1e3, 1e4, 3e4, 59e3, 61e3, 1e5, 4e5, 1e7 };

enum { N_SUNS = sizeof suns / sizeof *suns, N_ALTITUDES = sizeof altitudes / sizeof *altitudes };

static bool write_maps(const struct run *run, int (*worst)[METHODS_MAX])
{
	for (int m = 0; m < welkin_method_count && m < METHODS_MAX; m++) {
		char path[512];
		snprintf(path, sizeof path, "%s/failure-%s.txt", run->folder, welkin_methods[m]->name);
		FILE *f = m == run->reference ? NULL : fopen(path, "w");
		if (m == run->reference)
			continue;
		if (!f)
			return false;
		for (int a = 0; a < N_ALTITUDES; a++)
			for (int s = 0; s < N_SUNS; s++)
				fprintf(f, "%d %d %d %g %g\n", s, a, worst[a * N_SUNS + s][m], suns[s], altitudes[a]);
		if (fclose(f) != 0)
			return false;
	}
	return true;
}

static bool measure_map(struct run *run)
{
	static int worst[N_SUNS * N_ALTITUDES][METHODS_MAX];
	const int stride = run->smoke ? 5 : 1;
	for (int a = 0; a < N_ALTITUDES; a += stride)
		for (int s = 0; s < N_SUNS; s += stride) {
			const struct welkin_request request = request_of(WELKIN_EARTH, altitudes[a], suns[s]);
			if (!measure(run, &request, "sun_deg x altitude_m", suns[s], altitudes[a],
				    worst[a * N_SUNS + s]))
				return false;
		}
	return run->smoke || write_maps(run, worst);
}

/* ---- one parameter at a time ---- */

static void scale_triple(double triple[3], double factor)
{
	for (int i = 0; i < 3; i++)
		triple[i] *= factor;
}

static void set_aerosol(struct welkin_request *r, double factor)
{
	scale_triple(r->atmosphere.aerosol_scattering_per_m, factor);
	scale_triple(r->atmosphere.aerosol_absorption_per_m, factor);
}

static void set_turbidity(struct welkin_request *r, double value)
{
	r->atmosphere.turbidity = value;
}

static void set_density(struct welkin_request *r, double factor)
{
	r->atmosphere.density_factor = factor;
}

static void set_ozone(struct welkin_request *r, double factor)
{
	r->atmosphere.ozone_column_du *= factor;
}

static void set_radius(struct welkin_request *r, double metres)
{
	r->atmosphere.planet_radius_m = metres;
}

static void set_top(struct welkin_request *r, double metres)
{
	r->atmosphere.top_m = metres;
}

static void set_g(struct welkin_request *r, double g)
{
	r->atmosphere.aerosol_g = g;
}

static void set_steps(struct welkin_request *r, double steps)
{
	r->atmosphere.steps = (int32_t)steps;
}

static void set_light_steps(struct welkin_request *r, double steps)
{
	r->atmosphere.light_steps = (int32_t)steps;
}

static void set_altitude(struct welkin_request *r, double metres)
{
	r->camera.altitude_m = r->camera.position_m[1] = metres;
}

static void set_albedo(struct welkin_request *r, double albedo)
{
	r->ground_albedo[0] = r->ground_albedo[1] = r->ground_albedo[2] = albedo;
}

static const struct sweep {
	const char *name;
	void (*set)(struct welkin_request *request, double value);
	int n;
	double values[12];
} sweeps[] = {
	{ "aerosol_factor", set_aerosol, 8, { 0, 0.1, 0.5, 1, 2, 5, 10, 40 } },
	{ "turbidity", set_turbidity, 9, { 1, 1.5, 2, 2.2, 3, 6, 10, 20, 30 } },
	{ "density_factor", set_density, 6, { 0, 0.01, 0.3, 3, 10, 100 } },
	{ "ozone_factor", set_ozone, 5, { 0, 0.5, 1, 2, 3 } },
	{ "planet_radius_m", set_radius, 7, { 1e4, 1e5, 4e5, 1.737e6, 3.39e6, 2.5e7, 1e8 } },
	{ "top_m", set_top, 5, { 5e3, 3e4, 6e4, 1e5, 1e6 } },
	{ "g", set_g, 9, { -0.9, 0, 0.5, 0.76, 0.9, 0.95, 0.98, 0.99, 0.999 } },
	{ "steps", set_steps, 12, { 1, 2, 3, 4, 6, 8, 16, 32, 64, 128, 256, 512 } },
	{ "light_steps", set_light_steps, 9, { 1, 2, 3, 4, 8, 16, 64, 256, 512 } },
	{ "altitude_m at the top", set_altitude, 7, { 59000, 59999, 59999.5, 60000, 60000.5, 60001, 61000 } },
	{ "ground_albedo", set_albedo, 4, { 0, 0.3, 0.8, 1 } },
};

static bool measure_sweeps(struct run *run)
{
	static const double at_suns[] = { 30, 2, -3 };
	for (size_t k = 0; k < sizeof sweeps / sizeof *sweeps; k++) {
		/* Another air is other tables, which take seconds. */
		if (run->smoke && sweeps[k].set != set_altitude && sweeps[k].set != set_steps)
			continue;
		for (int i = 0; i < sweeps[k].n; i += run->smoke ? 4 : 1)
			for (int s = 0; s < (run->smoke ? 1 : 3); s++) {
				struct welkin_request request = request_of(WELKIN_EARTH, 2, at_suns[s]);
				sweeps[k].set(&request, sweeps[k].values[i]);
				if (!measure(run, &request, sweeps[k].name, sweeps[k].values[i], at_suns[s], NULL))
					return false;
			}
	}
	return true;
}

int main(int argc, char **argv)
{
	static struct run run;
	struct welkin_renderer_config config = { .slice_ms = 50, .table_budget_mib = 256 };
	char path[512];
	run.smoke = argc > 1 && !strcmp(argv[1], "--smoke");
	if (argc != 2 + run.smoke) {
		fprintf(stderr, "usage: failures [--smoke] FOLDER\n");
		return 2;
	}
	run.folder = argv[1 + run.smoke];
	const char *device = getenv("WELKIN_DEVICE");
	snprintf(config.device, sizeof config.device, "%s", device ? device : "auto");
	snprintf(path, sizeof path, "%s/failures.csv", run.folder);
	for (int m = 0; m < welkin_method_count; m++)
		if (!strcmp(welkin_methods[m]->name, "reference"))
			run.reference = m;
	if (!(run.csv = fopen(path, "w")) || !lib_render_start(&run.renderer, &config))
		return 1;
	fprintf(run.csv,
		"method,sweep,value,at,in_domain,verdict,directions,nonfinite,negative,discontinuous,wrong,worst_value,"
		"worst_elevation_deg,worst_azimuth_deg,held_against,held_against_another_method,device\n");
	bool ok = measure_map(&run) && measure_sweeps(&run);
	ok = !fclose(run.csv) && ok;
	ok = lib_render_stop(&run.renderer) == 0 && ok;
	printf("%d cells within a domain with light that can't be\n", run.unsound);
	return ok && run.unsound == 0 ? 0 : 1;
}
