#include "tests/lib_settings.h"

#include "api/api.h"
#include "server/domain.h"

#include <stdio.h>
#include <string.h>

/* What is tried of a field that a method declares. light_steps go with the steps. */
static const int step_counts[] = { 4, 8, 15, 30, 60 };
static const double error_goals[] = { 0.2, 0.1, 0.05 };

enum { N_STEPS = sizeof step_counts / sizeof *step_counts, N_GOALS = sizeof error_goals / sizeof *error_goals };

static bool reads(const struct method *method, const char *field)
{
	for (int i = 0; method->fields && method->fields[i]; i++)
		if (!strcmp(method->fields[i], field))
			return true;
	return false;
}

int settings_of(int method, bool coarse, struct setting settings[SETTINGS_MAX])
{
	const struct method *m = welkin_methods[method];
	const bool steps = reads(m, "atmosphere.steps"), light = reads(m, "atmosphere.light_steps");
	const bool goals = m->progressive && reads(m, "accuracy.max_error");
	const int many = steps || light ? N_STEPS : goals ? N_GOALS : 1, first = coarse ? many / 2 : 0;
	int n = 0;
	for (int i = coarse && goals ? 0 : first; i < many && (!coarse || n < 1); i++) {
		struct setting *s = &settings[n++];
		*s = (struct setting){ .method = method };
		if (steps)
			s->steps = step_counts[i];
		if (light)
			s->light_steps = step_counts[i];
		if (steps || light)
			snprintf(s->label, sizeof s->label, light ? "%d x %d steps" : "%d steps", step_counts[i],
				step_counts[i]);
		if (goals) {
			s->max_error = error_goals[i];
			snprintf(s->label, sizeof s->label, "to %g %%", 100 * error_goals[i]);
		}
	}
	return n;
}

void setting_apply(const struct setting *s, struct welkin_request *request)
{
	request->atmosphere.method = s->method;
	if (s->steps)
		request->atmosphere.steps = s->steps;
	if (s->light_steps)
		request->atmosphere.light_steps = s->light_steps;
	if (s->max_error > 0)
		request->max_error = s->max_error;
}

bool method_covers(int method, const struct welkin_request *request)
{
	struct welkin_faults faults = { 0 };
	struct welkin_request r = *request;
	r.atmosphere.method = method;
	domain_check(&r, &faults);
	return faults.n == 0;
}
