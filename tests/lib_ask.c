#include "tests/lib_ask.h"

#include <string.h>

struct answer ask_query(const char *query, enum welkin_format format)
{
	struct answer answer;
	struct welkin_draft draft = { 0 };
	memset(&answer, 0, sizeof answer);
	welkin_parse_query(&draft, query, strlen(query), &answer.faults);
	welkin_resolve(&draft, format, NULL, &answer.request, &answer.faults);
	return answer;
}

struct answer ask_json(const char *json, enum welkin_format format)
{
	struct answer answer;
	struct welkin_draft draft = { 0 };
	memset(&answer, 0, sizeof answer);
	welkin_parse_json(&draft, json, strlen(json), NULL, &answer.faults);
	welkin_resolve(&draft, format, NULL, &answer.request, &answer.faults);
	return answer;
}

const struct welkin_fault *fault_of(const struct welkin_faults *faults, const char *field)
{
	for (int i = 0; i < faults->n && i < WELKIN_FAULTS_MAX; i++)
		if (!strcmp(faults->list[i].field, field))
			return &faults->list[i];
	return NULL;
}
