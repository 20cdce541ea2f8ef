#include "gpu/choose.h"

#include "api/api.h"
#include "gpu/measured.h"

#include <math.h>
#include <string.h>

/* Progressive methods get as good as time allows; auto takes one only where a frame is done in this time. */
static const double longest_ms = 10e3;

/* Tables that take seconds are worth it to one who stays in an atmosphere: each frame bears this part of them. */
static const double slow_tables_share = 1 / 50.0;

/* ---- domains ---- */

/* The numbers of a field: how many, and where; integers are widened. */
static int field_values(const struct welkin_field *field, const struct welkin_request *request, double values[3])
{
	const char *at = (const char *)request + field->offset;
	int32_t whole;
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
		memcpy(values, at, sizeof *values);
		return 1;
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		memcpy(values, at, 3 * sizeof *values);
		return 3;
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_BOOL:
	case WELKIN_TYPE_ENUM:
		memcpy(&whole, at, sizeof whole);
		values[0] = whole;
		return 1;
	default:
		return 0;
	}
}

bool method_range_holds(const struct method_range *range, const struct welkin_request *request, double *outside)
{
	double values[3] = { 0 };
	const int index = welkin_field_find(range->field);
	const int n = index < 0 ? 0 : field_values(&welkin_fields[index], request, values);
	for (int i = 0; i < n; i++)
		if (!(values[i] >= range->min && values[i] <= range->max)) {
			*outside = values[i];
			return false;
		}
	return true;
}

bool method_can_do(const struct method *method, const struct welkin_request *request)
{
	double outside;
	for (const struct method_range *r = method->domain; r && r->field; r++)
		if (!method_range_holds(r, request, &outside))
			return false;
	return true;
}

bool method_is_auto(const struct welkin_request *request)
{
	return request->atmosphere.method == welkin_method_count;
}

static const struct method *method_called(const char *name, int *index)
{
	for (*index = 0; *index < welkin_method_count; ++*index)
		if (!strcmp(welkin_methods[*index]->name, name))
			return welkin_methods[*index];
	return NULL;
}

/* ---- where a request lies among the scenes ---- */

static double aerosol_depth(const struct welkin_atmosphere *a)
{
	return (a->aerosol_scattering_per_m[1] + a->aerosol_absorption_per_m[1]) * a->aerosol_scale_height_m *
	       a->density_factor;
}

static double rayleigh_depth(const struct welkin_atmosphere *a)
{
	return a->rayleigh_scattering_per_m[1] * a->rayleigh_scale_height_m * a->density_factor;
}

/* An air like the Earth's: the scenes say nothing of other planets, thrice the ozone or sharper aerosol. */
static bool like_the_scenes(const struct welkin_request *r)
{
	const struct welkin_atmosphere *a = &r->atmosphere;
	const double earth_rayleigh = 0.1085; /* at 550 nm */
	return fabs(a->planet_radius_m / 6360e3 - 1) < 0.05 && fabs(rayleigh_depth(a) / earth_rayleigh - 1) < 0.3 &&
	       fabs(a->rayleigh_scale_height_m / 8000 - 1) < 0.2 && a->aerosol_scale_height_m < 3000 &&
	       a->ozone_column_du <= 600 && fabs(a->aerosol_g) <= 0.9 && aerosol_depth(a) < 0.5 &&
	       r->sun.elevation_deg >= -10;
}

/* The error of one setting in one scene; NAN where it was not measured or lies outside of the domain. */
static double error_in(const struct measured_point *setting, int scene)
{
	for (const struct measured_point *p = welkin_measured; p->method; p++)
		if (p->scene == scene && p->in_domain && p->steps == setting->steps &&
			p->light_steps == setting->light_steps && p->goal == setting->goal &&
			!strcmp(p->method, setting->method))
			return fmax(p->error, p->uncertainty);
	return NAN;
}

static bool plain(const struct measured_scene *s)
{
	return s->albedo < 0.2 && s->aerosol_depth > 0.001 && s->aerosol_depth < 0.02;
}

static double interpolate(double x, double x0, double y0, double x1, double y1)
{
	const double t = x1 > x0 ? fmin(fmax((x - x0) / (x1 - x0), 0), 1) : 0;
	return exp(log(y0) + t * (log(y1) - log(y0)));
}

/* Over the sun's elevation, on the ground in plain air. */
static double error_at_sun(const struct measured_point *setting, double sun_deg)
{
	double below = -INFINITY, above = INFINITY, y_below = NAN, y_above = NAN;
	for (int s = 0; welkin_measured_scenes[s].name; s++) {
		const struct measured_scene *scene = &welkin_measured_scenes[s];
		const double y = error_in(setting, s), x = scene->sun_elevation_deg;
		if (!plain(scene) || scene->altitude_m > 1e3 || isnan(y))
			continue;
		if (x <= sun_deg && x > below) {
			below = x;
			y_below = y;
		}
		if (x >= sun_deg && x < above) {
			above = x;
			y_above = y;
		}
	}
	if (isnan(y_below) || isnan(y_above)) /* beyond the last scene by a little, or nothing at all */
		return isnan(y_below) ? y_above : y_below;
	return interpolate(sun_deg, below, y_below, above, y_above);
}

/* The worse of the scenes next below and above, in plain air above the ground; 0 where there is none. */
static double error_at_altitude(const struct measured_point *setting, double altitude_m)
{
	double below = 1e3, above = INFINITY, y_below = 0, y_above = 0;
	for (int s = 0; welkin_measured_scenes[s].name; s++) {
		const double y = error_in(setting, s), h = welkin_measured_scenes[s].altitude_m;
		if (h < 1e3 || isnan(y))
			continue;
		if (h <= altitude_m && h >= below) {
			below = h;
			y_below = y;
		}
		if (h >= altitude_m && h < above) {
			above = h;
			y_above = y;
		}
	}
	return fmax(y_below, y_above);
}

/* What a scene on the ground adds to the error in plain air under the same sun: 1 or more. */
static double penalty(const struct measured_point *setting, int scene)
{
	const double y = error_in(setting, scene),
		     usual = error_at_sun(setting, welkin_measured_scenes[scene].sun_elevation_deg);
	return y > usual ? y / usual : 1;
}

static double error_of(const struct measured_point *setting, const struct welkin_request *r)
{
	const double h = r->camera.altitude_m, depth = aerosol_depth(&r->atmosphere), albedo = r->ground_albedo[1];
	double error = error_at_sun(setting, r->sun.elevation_deg);
	if (h >= 1e3)
		error = fmax(h < 10e3 || r->sun.elevation_deg < 10 ? error : 0, error_at_altitude(setting, h));
	for (int s = 0; welkin_measured_scenes[s].name; s++) {
		const struct measured_scene *scene = &welkin_measured_scenes[s];
		if (plain(scene) || scene->altitude_m > 1e3)
			continue;
		double share = 0; /* how far the request is on its way to that scene */
		if (scene->albedo > 0.2)
			share = (albedo - 0.1) / (scene->albedo - 0.1);
		else if (scene->aerosol_depth > 0.02 && depth > 0.006)
			share = log(depth / 0.006) / log(scene->aerosol_depth / 0.006);
		else if (scene->aerosol_depth < 0.001 && depth < 0.005)
			share = 1 - depth / 0.005;
		if (share > 0)
			error *= pow(penalty(setting, s), fmin(share, 1.5));
	}
	return error > 0 ? error : NAN;
}

/* Where nothing like the request was measured, the worst that a setting ever did ranks it. */
static double worst_of(const struct measured_point *setting)
{
	double worst = 0;
	for (int s = 0; welkin_measured_scenes[s].name; s++) {
		const double y = error_in(setting, s);
		worst = y > worst ? y : worst;
	}
	return worst;
}

/* ---- choosing ---- */

struct candidate {
	int method, steps, light_steps;
	double error, ms;
	double tables_ms; /* the frame's part of tables that take seconds */
};

/* Nothing else chooses among more: the settings of one scene stand for all. */
static bool first_of_setting(const struct measured_point *p)
{
	for (const struct measured_point *q = welkin_measured; q < p; q++)
		if (q->steps == p->steps && q->light_steps == p->light_steps && q->goal == p->goal &&
			!strcmp(q->method, p->method))
			return false;
	return true;
}

/* Device time of a setting: the most that it took in any scene. */
static double ms_of(const struct measured_point *setting, double pixels)
{
	double ms = 0;
	for (const struct measured_point *p = welkin_measured; p->method; p++)
		if (p->steps == setting->steps && p->light_steps == setting->light_steps && p->goal == setting->goal &&
			!strcmp(p->method, setting->method))
			ms = fmax(ms, measured_ms(p, pixels));
	return ms;
}

/* Fixed steps: a measured setting with more of them than were given is not what will be run. One with
 * fewer stands in for it, and the cost grows with the steps. */
static bool fits_given(const struct measured_point *p, const struct welkin_request *r, const struct choose_terms *terms)
{
	return (!terms->steps || p->steps == 0 || p->steps <= r->atmosphere.steps) &&
	       (!terms->light_steps || p->light_steps == 0 || p->light_steps <= r->atmosphere.light_steps);
}

static bool make_candidate(const struct measured_point *p, const struct welkin_request *r,
	const struct choose_terms *terms, bool known, struct candidate *c)
{
	const struct method *m = method_called(p->method, &c->method);
	struct welkin_request as_run = *r;
	as_run.atmosphere.method = c->method;
	if (!m || !method_can_do(m, &as_run) || (!known && !m->physical))
		return false;
	c->steps = p->steps;
	c->light_steps = p->light_steps;
	c->error = known ? error_of(p, r) : worst_of(p);
	c->ms = ms_of(p, terms->pixels);
	c->tables_ms = m->slow_tables ? p->first_ms * slow_tables_share : 0;
	if (m->progressive) { /* the error is what is asked for, at the cost of its square */
		c->error = r->max_error;
		if (!known || !(c->error > 0))
			return false;
		c->ms *= pow(p->goal / c->error, 2);
		return c->ms <= longest_ms;
	}
	if (terms->steps && p->steps > 0)
		c->ms *= fmax(1, (double)r->atmosphere.steps / p->steps);
	if (terms->light_steps && p->light_steps > 0)
		c->ms *= fmax(1, (double)r->atmosphere.light_steps / p->light_steps);
	return !isnan(c->error);
}

/* Is a better than b for one who wants `cheap` (or accurate)? Ties go to the first in the data's order. */
static bool better(const struct candidate *a, const struct candidate *b, bool cheap)
{
	return cheap ? a->ms + a->tables_ms < b->ms + b->tables_ms
		     : a->error < b->error || (a->error == b->error && a->ms < b->ms);
}

struct search {
	bool found;
	struct candidate best;
};

/* The cheapest (or the most accurate) of those that err and cost at most so much. */
static struct search search(const struct welkin_request *r, const struct choose_terms *terms, bool known,
	double max_error, double budget_ms, bool cheap)
{
	struct search s = { false, { 0 } };
	for (const struct measured_point *p = welkin_measured; p->method; p++) {
		struct candidate c;
		if (!first_of_setting(p) || !fits_given(p, r, terms) || !make_candidate(p, r, terms, known, &c) ||
			c.error > max_error || c.ms > budget_ms)
			continue;
		if (!s.found || better(&c, &s.best, cheap))
			s = (struct search){ true, c };
	}
	return s;
}

/* Without numbers: the first physical method of all orders that can do it, or any that can. */
static int fallback(const struct welkin_request *r)
{
	int found = 0, best = -1;
	for (int i = 0; i < welkin_method_count; i++) {
		const struct method *m = welkin_methods[i];
		const int rank = m->progressive ? 0 : 1 + m->physical + (m->physical && !m->single_scattering);
		if (method_can_do(m, r) && rank > best) {
			best = rank;
			found = i;
		}
	}
	return found;
}

void choose_method(struct welkin_request *r, const struct choose_terms *terms)
{
	struct welkin_atmosphere *a = &r->atmosphere;
	if (!method_is_auto(r))
		return;
	const bool known = like_the_scenes(r);
	const double budget_ms = r->budget_ms > 0 ? r->budget_ms : INFINITY;
	const bool demanding = r->max_error > 0 && (terms->max_error || !(r->budget_ms > 0));
	struct search s = { false, { 0 } };
	a->choice = WELKIN_CHOICE_CHEAPEST;
	if (known && demanding)
		s = search(r, terms, known, r->max_error, budget_ms, true);
	if (!s.found) {
		a->choice = !known      ? WELKIN_CHOICE_UNMEASURED
			    : demanding ? WELKIN_CHOICE_BEST_EFFORT
					: WELKIN_CHOICE_ACCURATE;
		s = search(r, terms, known, INFINITY, budget_ms, false);
	}
	if (!s.found) { /* nothing fits the budget: what comes nearest to it */
		a->choice = WELKIN_CHOICE_OVER_BUDGET;
		s = search(r, terms, known, INFINITY, INFINITY, true);
	}
	if (!s.found) {
		a->choice = WELKIN_CHOICE_UNMEASURED;
		s.best.method = fallback(r);
	}
	a->method = s.best.method;
	if (!terms->steps && s.best.steps > 0)
		a->steps = s.best.steps;
	if (!terms->light_steps && s.best.light_steps > 0)
		a->light_steps = s.best.light_steps;
}

struct expectation choose_expect(const struct welkin_request *r, double pixels)
{
	struct expectation e = { NAN, NAN, NAN };
	const struct choose_terms terms = { .steps = true, .light_steps = true, .pixels = pixels };
	if (method_is_auto(r) || !like_the_scenes(r))
		return e;
	int most = -1;
	for (const struct measured_point *p = welkin_measured; p->method; p++) {
		struct candidate c;
		/* The measured setting that is next below what will be run. */
		if (strcmp(p->method, welkin_methods[r->atmosphere.method]->name) || !first_of_setting(p) ||
			p->steps + p->light_steps < most || !fits_given(p, r, &terms) ||
			!make_candidate(p, r, &terms, true, &c) || (p->steps + p->light_steps == most && c.ms >= e.ms))
			continue;
		most = p->steps + p->light_steps;
		e = (struct expectation){ c.error, c.ms, c.tables_ms };
	}
	return e;
}

const char *choose_reason(const struct welkin_request *r)
{
	switch (r->atmosphere.choice) {
	case WELKIN_CHOICE_CHEAPEST:
		return "the cheapest within accuracy.max_error";
	case WELKIN_CHOICE_ACCURATE:
		return "the most accurate within accuracy.budget_ms";
	case WELKIN_CHOICE_BEST_EFFORT:
		return "none keeps accuracy.max_error: the most accurate";
	case WELKIN_CHOICE_OVER_BUDGET:
		return "none keeps accuracy.budget_ms: the cheapest";
	case WELKIN_CHOICE_UNMEASURED:
		return "no such sky was measured: the one with the best worst case";
	default:
		return "";
	}
}
