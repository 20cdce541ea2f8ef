#ifndef WELKIN_TESTS_FUZZ_CHECK_H
#define WELKIN_TESTS_FUZZ_CHECK_H

#include "api/api.h"

#undef NDEBUG
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What holds of whatever came out of parsing, for both fuzz targets. */

static inline void fuzz_check_faults(const struct welkin_faults *faults)
{
	assert(faults->status == 400 || faults->status == 422);
	for (int i = 0; i < faults->n && i < WELKIN_FAULTS_MAX; i++)
		assert(faults->list[i].detail[0]);
	char *problem = welkin_problem_json(faults->status, NULL, NULL, NULL, "/", faults);
	/* Well-formed by our own strict reader: then the one fault is that the members are unknown. */
	struct welkin_draft draft = { 0 };
	struct welkin_faults unknown = { 0 };
	welkin_parse_json(&draft, problem, strlen(problem), NULL, &unknown);
	assert(unknown.n > 0 && unknown.status == 422);
	free(problem);
}

static inline void fuzz_check_ranges(const struct welkin_request *request)
{
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *f = &welkin_fields[i];
		const void *at = (const char *)request + f->offset;
		const double *v = at;
		const int n = f->type == WELKIN_TYPE_DOUBLE                                  ? 1
			      : f->type == WELKIN_TYPE_VEC3 || f->type == WELKIN_TYPE_TRIPLE ? 3
											     : 0;
		for (int k = 0; k < n; k++)
			assert(isfinite(v[k]) && v[k] >= f->min && v[k] <= f->max);
		if (f->type == WELKIN_TYPE_INT)
			assert(*(const int32_t *)at >= f->min && *(const int32_t *)at <= f->max);
	}
}

static inline void fuzz_check(const struct welkin_draft *draft, enum welkin_format format, struct welkin_faults *faults)
{
	static const struct welkin_limits limits = { .max_pixels = 1e7 };
	struct welkin_request request, again;
	welkin_resolve(draft, format, &limits, &request, faults);
	if (faults->n > 0) {
		fuzz_check_faults(faults);
		return;
	}
	fuzz_check_ranges(&request);
	char *texts[] = { welkin_request_json(&request), welkin_request_query(&request) };
	for (int i = 0; i < 2; i++) {
		struct welkin_draft second = { 0 };
		struct welkin_faults none = { 0 };
		if (i)
			welkin_parse_query(&second, texts[i], strlen(texts[i]), &none);
		else
			welkin_parse_json(&second, texts[i], strlen(texts[i]), NULL, &none);
		welkin_resolve(&second, format, &limits, &again, &none);
		assert(none.n == 0 && !memcmp(&request, &again, sizeof request));
	}
	char *json = welkin_request_json(&again);
	assert(!strcmp(json, texts[0]));
	free(json);
	free(texts[0]);
	free(texts[1]);
}

#endif
