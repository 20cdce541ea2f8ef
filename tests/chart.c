/*
 * Error against milliseconds for every method (`make chart`): the calibration scenes of tests/chart/, every
 * method of the registry at the settings of lib_settings.c, one after the other on one device.
 *
 *     chart [--smoke] FOLDER                  all points; writes chart.csv and what tests/chart.gp plots
 *     chart FOLDER SCENE METHOD [SETTING]     one point again ("30 steps"), printed
 *
 * Error: the image of the scene against the reference's (lib_image_error.h). Cost: device time of a
 * 1280×720 view of the same sky, warm, median of RUNS; each run turns the sun by a hundredth of a degree, so
 * that tables which belong to one frame are built and timed, apart from the other passes. Settings that take
 * longer than SLOW_MS are timed on fewer pixels and scaled (cost_pixels in the table says so).
 */
#include "tests/lib_reference.h"
#include "tests/lib_settings.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 1280, HEIGHT = 720, SMALL = 8, RUNS = 5, POINTS_MAX = 2048 };

static const double slow_ms = 300, reference_error = 0.002, reference_budget_ms = 8000, progressive_ms = 20e3;
static const double largest_error = 10; /* on the charts */

struct point {
	const struct calibration_scene *scene;
	struct setting setting;
	bool covered; /* by the method's declared domain */
	struct image_error error;
	double ms, ms_small; /* of the view, and of one a SMALL-th as wide and high, without tables */
	double ms_tables;    /* tables of one frame */
	double ms_first;     /* tables of a new atmosphere: once per method */
	int cost_pixels;
};

struct chart {
	struct lib_renderer renderer;
	const char *folder;
	bool smoke;
	int n_scenes, n_points;
	struct calibration_scene scenes[SCENES_MAX];
	struct point points[POINTS_MAX];
};

/* ---- cost ---- */

static void sum_passes(const struct welkin_result *result, double *ms, double *tables)
{
	*ms = *tables = 0;
	for (int i = 0; i < result->n_passes; i++)
		*(strncmp(result->passes[i].name, "table-", 6) ? ms : tables) += result->passes[i].ms;
}

static bool time_once(struct chart *c, const struct welkin_request *request, double *ms, double *tables)
{
	void *pixels;
	struct welkin_result result;
	if (!lib_render(&c->renderer, request, &pixels, &result))
		return false;
	free(pixels);
	sum_passes(&result, ms, tables);
	return true;
}

static int compare(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static double median(double *values, int n)
{
	qsort(values, (size_t)n, sizeof *values, compare);
	return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

/* Warm: the first run is not counted. */
static bool time_view(
	struct chart *c, const struct point *p, int width, int height, int runs, double *ms, double *tables)
{
	double all[RUNS], all_tables[RUNS], ignored[2];
	struct welkin_request request = scene_view(p->scene, width, height);
	setting_apply(&p->setting, &request);
	if (!time_once(c, &request, &ignored[0], &ignored[1]))
		return false;
	if (ignored[0] > slow_ms)
		runs = 1; /* what takes long is not disturbed by little */
	for (int i = 0; i < runs; i++) {
		request.sun.azimuth_deg += 0.01;
		if (!time_once(c, &request, &all[i], &all_tables[i]))
			return false;
	}
	*ms = median(all, runs);
	*tables = median(all_tables, runs);
	return true;
}

/* Progressive methods: on the scene's own image, for they take minutes for a large one. */
static bool time_progressive(struct chart *c, struct point *p)
{
	struct welkin_request request = p->scene->request;
	double tables;
	setting_apply(&p->setting, &request);
	if (!time_once(c, &request, &p->ms_small, &tables))
		return false;
	p->cost_pixels = request.image.width * request.image.height;
	p->ms = p->ms_small * WIDTH * HEIGHT / p->cost_pixels;
	p->ms_small = p->ms / (SMALL * SMALL);
	p->ms_tables = 0;
	return true;
}

static bool measure_cost(struct chart *c, struct point *p)
{
	const int runs = c->smoke ? 1 : RUNS;
	double tables;
	if (welkin_methods[p->setting.method]->progressive)
		return time_progressive(c, p);
	if (!time_view(c, p, WIDTH / SMALL, HEIGHT / SMALL, runs, &p->ms_small, &p->ms_tables))
		return false;
	p->cost_pixels = WIDTH * HEIGHT / (SMALL * SMALL);
	p->ms = p->ms_small * SMALL * SMALL;
	if (p->ms > slow_ms || c->smoke)
		return true;
	p->cost_pixels = WIDTH * HEIGHT;
	return time_view(c, p, WIDTH, HEIGHT, runs, &p->ms, &tables);
}

/* All of its tables, for an atmosphere that was never seen. */
static bool measure_first(struct chart *c, const struct point *p, double *ms)
{
	struct welkin_request request = scene_view(p->scene, 64, 36);
	double ignored;
	setting_apply(&p->setting, &request);
	static int seen;
	request.atmosphere.planet_radius_m += ++seen;
	return time_once(c, &request, &ignored, ms);
}

/* ---- error ---- */

static void write_map(const struct chart *c, const struct point *p, const float *map)
{
	char path[512];
	const struct welkin_image *image = &p->scene->request.image;
	snprintf(path, sizeof path, "%s/map-%s-%s.txt", c->folder, p->scene->name,
		welkin_methods[p->setting.method]->name);
	FILE *f = fopen(path, "w");
	if (!f)
		return;
	for (int y = image->height - 1; y >= 0; y--)
		for (int x = 0; x < image->width; x++)
			fprintf(f, "%.4g%c", (double)map[y * image->width + x], x + 1 < image->width ? ' ' : '\n');
	fclose(f);
}

static bool measure_error(struct chart *c, struct point *p, const struct reference_image *reference)
{
	struct welkin_request request = p->scene->request;
	struct welkin_result result;
	void *pixels;
	setting_apply(&p->setting, &request);
	request.exposure_mode = WELKIN_EXPOSURE_EV;
	request.exposure_ev = 0;
	if (!lib_render(&c->renderer, &request, &pixels, &result))
		return false;
	const int n = reference->width * reference->height;
	float *rgba = pixels, *map = calloc((size_t)n, sizeof *map);
	double *weights = scene_solid_angles(&request);
	for (int i = 0; i < 4 * n; i++)
		rgba[i] = (float)((double)rgba[i] / result.exposure_scale);
	const bool ok = map && weights && image_error(reference, rgba, weights, &p->error, map);
	p->error.unsound = fmax(p->error.unsound, (double)result.nonfinite / n);
	if (ok)
		write_map(c, p, map);
	free(weights);
	free(map);
	free(pixels);
	return ok;
}

/* ---- all of them ---- */

/* A progressive setting that would take too long, by what the last, coarser one took: left out. */
static bool too_slow(const struct chart *c, const struct setting *setting)
{
	const struct point *last = c->n_points > 0 ? &c->points[c->n_points - 1] : NULL;
	if (!(setting->max_error > 0) || !last || last->setting.method != setting->method)
		return false;
	const double took_ms = last->ms * last->cost_pixels / (WIDTH * HEIGHT);
	return took_ms * pow(last->setting.max_error / setting->max_error, 2) > progressive_ms;
}

static void print_point(const struct chart *c, const struct point *p)
{
	const struct image_error *e = &p->error;
	printf("%-17s %-12s %-14s %s rms %8.4f %% ± %.4f  p99 %8.3f %% (noise %.3f)  dE %7.3f (%.3f)  unsound %.2g  "
	       "%9.3f ms + tables %.3f\n",
		p->scene->name, welkin_methods[p->setting.method]->name, p->setting.label, p->covered ? " " : "*",
		100 * e->rms, 100 * e->rms_uncertainty, 100 * e->p99, 100 * e->p99_noise, e->delta_e, e->delta_e_noise,
		e->unsound, p->ms, p->ms_tables);
	fflush(stdout);
	(void)c;
}

static bool measure_scene(struct chart *c, const struct calibration_scene *scene, const char *method, const char *label)
{
	/* Of one setting; of each where they take long, by which auto tells the settings apart. */
	static double first[WELKIN_METHODS_MAX][SETTINGS_MAX];
	struct reference_image reference;
	struct setting settings[SETTINGS_MAX];
	bool ok = reference_get(&c->renderer, scene, c->folder, c->smoke ? 0.02 : reference_error,
		c->smoke ? 1000 : reference_budget_ms, &reference);
	for (int m = 0; ok && m < welkin_method_count; m++) {
		const int n =
			method && strcmp(method, welkin_methods[m]->name) ? 0 : settings_of(m, c->smoke, settings);
		for (int i = 0; ok && i < n && c->n_points < POINTS_MAX; i++) {
			struct point *p = &c->points[c->n_points];
			*p = (struct point){
				.scene = scene, .setting = settings[i], .covered = method_covers(m, &scene->request)
			};
			if ((label && strcmp(label, settings[i].label)) || too_slow(c, &settings[i]))
				continue;
			ok = measure_error(c, p, &reference) && measure_cost(c, p);
			double *ms_first = &first[m][welkin_methods[m]->slow_tables ? i : 0];
			if (ok && welkin_methods[m]->tables && *ms_first <= 0)
				ok = measure_first(c, p, ms_first);
			p->ms_first = *ms_first;
			c->n_points++;
			if (ok)
				print_point(c, p);
		}
	}
	reference_free(&reference);
	return ok;
}

/* ---- files ---- */

static FILE *open_in(const char *folder, const char *name)
{
	char path[512];
	snprintf(path, sizeof path, "%s/%s", folder, name);
	FILE *f = fopen(path, "w");
	if (!f)
		perror(path);
	return f;
}

static bool write_csv(const struct chart *c)
{
	FILE *f = open_in(c->folder, "chart.csv");
	if (!f)
		return false;
	fprintf(f, "class,scene,method,setting,in_domain,error_rms,error_rms_uncertainty,error_p99,p99_noise,delta_e,"
		   "delta_e_noise,"
		   "unsound_share,reference_std_error,uncertainty_within_a_tenth,ms,ms_small,ms_tables_frame,ms_tables_"
		   "first,"
		   "cost_pixels,device\n");
	for (int i = 0; i < c->n_points; i++) {
		const struct point *p = &c->points[i];
		const struct image_error *e = &p->error;
		fprintf(f, "%s,%s,%s,%s,%d,%.6g,%.2g,%.6g,%.3g,%.4g,%.3g,%.3g,%.3g,%d,%.4g,%.4g,%.4g,%.4g,%d,\"%s\"\n",
			p->scene->class, p->scene->name, welkin_methods[p->setting.method]->name, p->setting.label,
			p->covered, e->rms, e->rms_uncertainty, e->p99, e->p99_noise, e->delta_e, e->delta_e_noise,
			e->unsound, e->reference_std_error, e->rms_uncertainty <= e->rms / 10, p->ms, p->ms_small,
			p->ms_tables, p->ms_first, p->cost_pixels, c->renderer.device.name);
	}
	return !fclose(f);
}

/* The same as data of the product: gpu/measured.h. */
static bool write_measured(const struct chart *c)
{
	FILE *f = open_in(c->folder, "measured.inc");
	if (!f)
		return false;
	fprintf(f,
		"/* Made by `make chart`, put here by `make chart-update`. */\n\nconst char welkin_measured_device[] = "
		"\"%s\";\n\n"
		"const struct measured_scene welkin_measured_scenes[] = {\n",
		c->renderer.device.name);
	for (int i = 0; i < c->n_scenes; i++) {
		const struct welkin_request *r = &c->scenes[i].request;
		const struct welkin_atmosphere *a = &r->atmosphere;
		fprintf(f, "\t{ \"%s\", %g, %g, %.4g, %g },\n", c->scenes[i].name, r->sun.elevation_deg,
			r->camera.altitude_m,
			(a->aerosol_scattering_per_m[1] + a->aerosol_absorption_per_m[1]) * a->aerosol_scale_height_m *
				a->density_factor,
			r->ground_albedo[1]);
	}
	fprintf(f, "\t{ NULL },\n};\n\nconst struct measured_point welkin_measured[] = {\n");
	for (int i = 0; i < c->n_points; i++) {
		const struct point *p = &c->points[i];
		const double large = WIDTH * HEIGHT * 1e-6, small = large / (SMALL * SMALL);
		const double per_mpixel = fmax((p->ms - p->ms_small) / (large - small), 0);
		fprintf(f, "\t{ %d, \"%s\", %d, %d, %g, %d, %.4g, %.2g, %.4g, %.4g, %.4g, %.4g, %.4g },\n",
			(int)(p->scene - c->scenes), welkin_methods[p->setting.method]->name, p->setting.steps,
			p->setting.light_steps, p->setting.max_error, p->covered, p->error.rms,
			p->error.rms_uncertainty, p->error.p99, p->error.delta_e,
			p->ms_tables + fmax(p->ms - per_mpixel * large, 0), per_mpixel, p->ms_first);
	}
	fprintf(f, "\t{ 0, NULL },\n};\n");
	return !fclose(f);
}

struct pooled {
	int method;
	int scenes;
	double error, ms; /* RMS over the class' scenes, and mean */
};

/* Leaves out settings that have not all scenes of their method: a line through points of different scenes says nothing.
 */
static int keep_whole(struct pooled *pooled, int n)
{
	int most[WELKIN_METHODS_MAX] = { 0 }, kept = 0;
	for (int i = 0; i < n; i++)
		most[pooled[i].method] =
			most[pooled[i].method] > pooled[i].scenes ? most[pooled[i].method] : pooled[i].scenes;
	for (int i = 0; i < n; i++)
		if (pooled[i].scenes == most[pooled[i].method])
			pooled[kept++] = pooled[i];
	return kept;
}

/* A setting's points of one class; those outside of the method's domain are not its own. */
static int pool_class(const struct chart *c, const char *class, struct pooled pooled[POINTS_MAX])
{
	int n = 0;
	for (int i = 0; i < c->n_points; i++) {
		const struct point *p = &c->points[i];
		struct pooled sum = { .method = p->setting.method };
		int earlier = 0;
		for (int k = 0; k < c->n_points; k++) {
			const struct point *q = &c->points[k];
			if (strcmp(q->scene->class, class) || q->setting.method != p->setting.method ||
				strcmp(q->setting.label, p->setting.label) || !q->covered)
				continue;
			earlier += k < i;
			sum.scenes++;
			sum.error += pow(fmax(q->error.rms, q->error.rms_uncertainty), 2); /* what could be told */
			sum.ms += q->ms + q->ms_tables;
		}
		if (sum.scenes == 0 || earlier || strcmp(p->scene->class, class) || !p->covered)
			continue;
		sum.error = fmin(fmax(sqrt(sum.error / sum.scenes), 1e-5), largest_error);
		sum.ms /= sum.scenes;
		pooled[n++] = sum;
	}
	return keep_whole(pooled, n);
}

static int by_ms(const void *a, const void *b)
{
	const struct pooled *x = a, *y = b;
	return (x->ms > y->ms) - (x->ms < y->ms);
}

/* plot-CLASS.txt: a block per method, "ms error", and the Pareto front last. Listed if there are any points. */
static bool write_class(const struct chart *c, const char *class, FILE *list)
{
	static struct pooled pooled[POINTS_MAX];
	char name[64];
	const int n = pool_class(c, class, pooled);
	double best = INFINITY;
	if (n == 0)
		return true;
	fprintf(list, "%s\n", class);
	snprintf(name, sizeof name, "plot-%s.txt", class);
	FILE *f = open_in(c->folder, name);
	if (!f)
		return false;
	for (int m = 0; m < welkin_method_count; m++) {
		fprintf(f, "\"%s\"\n", welkin_methods[m]->name);
		int points = 0;
		for (int i = 0; i < n; i++)
			if (pooled[i].method == m && ++points)
				fprintf(f, "%.5g %.5g\n", pooled[i].ms, pooled[i].error);
		fprintf(f, "%s\n\n", points ? "" : "nan nan\n");
	}
	qsort(pooled, (size_t)n, sizeof *pooled, by_ms);
	fprintf(f, "\"front\"\n");
	for (int i = 0; i < n; i++)
		if (pooled[i].error < best) {
			if (isfinite(best))
				fprintf(f, "%.5g %.5g\n", pooled[i].ms, best);
			best = pooled[i].error;
			fprintf(f, "%.5g %.5g\n", pooled[i].ms, best);
		}
	return !fclose(f);
}

static bool write_plots(const struct chart *c)
{
	FILE *list = open_in(c->folder, "classes.txt");
	bool ok = list;
	for (int i = 0; ok && i < c->n_scenes; i++) {
		if (i > 0 && !strcmp(c->scenes[i].class, c->scenes[i - 1].class))
			continue;
		ok = write_class(c, c->scenes[i].class, list);
	}
	if (list && fclose(list) != 0)
		ok = false;
	if ((list = open_in(c->folder, "device.txt")))
		fprintf(list, "%s\n", c->renderer.device.name);
	return list && !fclose(list) && ok;
}

/* ---- the smoke test's own demands ---- */

/* Loose bounds that only a broken method breaks: the full chart is for judging. */
static bool plausible(const struct chart *c)
{
	bool ok = c->n_points > 0;
	for (int i = 0; i < c->n_points; i++) {
		const struct point *p = &c->points[i];
		const struct method *m = welkin_methods[p->setting.method];
		const double goal = p->setting.max_error;
		const double bound = goal > 0 ? 1.5 * goal : !m->physical ? 4 : m->single_scattering ? 0.7 : 0.15;
		if (p->covered && (p->error.unsound > 0 || !(p->error.rms < bound) || !(p->ms > 0))) {
			fprintf(stderr, "chart: %s of %s fails (bound %g)\n", m->name, p->scene->name, bound);
			ok = false;
		}
	}
	return ok;
}

static const char *device(void)
{
	const char *name = getenv("WELKIN_DEVICE");
	return name ? name : "auto";
}

int main(int argc, char **argv)
{
	static struct chart c;
	struct welkin_renderer_config config = { .slice_ms = 50, .table_budget_mib = 512 };
	c.smoke = argc > 1 && !strcmp(argv[1], "--smoke");
	argc -= c.smoke;
	argv += c.smoke;
	if (argc < 2) {
		fprintf(stderr, "usage: chart [--smoke] FOLDER [SCENE METHOD [SETTING]]\n");
		return 2;
	}
	c.folder = argv[1];
	c.n_scenes = scenes_load("tests/chart", c.scenes);
	snprintf(config.device, sizeof config.device, "%s", device());
	if (c.n_scenes == 0 || !lib_render_start(&c.renderer, &config))
		return 1;
	printf("device: %s; * is outside of the method's domain\n", c.renderer.device.name);
	bool ok = true;
	for (int i = 0; ok && i < c.n_scenes; i++) {
		struct calibration_scene *s = &c.scenes[i];
		if (c.smoke && strcmp(s->name, "day-45") && strcmp(s->name, "low-2"))
			continue;
		if (c.smoke) {
			s->request.image.width = 16;
			s->request.image.height = 8;
		}
		if (argc < 3 || !strcmp(argv[2], s->name))
			ok = measure_scene(&c, s, argc > 3 ? argv[3] : NULL, argc > 4 ? argv[4] : NULL);
	}
	if (argc == 2) /* what there is, also when a renderer gave up on the way */
		ok = write_csv(&c) && write_measured(&c) && write_plots(&c) && ok;
	ok = lib_render_stop(&c.renderer) == 0 && ok;
	return ok && (!c.smoke || plausible(&c)) ? 0 : 1;
}
