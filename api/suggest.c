#include "api/suggest.h"

#include <string.h>

/* Levenshtein's distance between short strings. */
static int distance(const char *a, const char *b)
{
	enum { LONGEST = 63 };
	const int n = (int)strlen(b);
	if (n > LONGEST || strlen(a) > LONGEST)
		return LONGEST;
	int row[LONGEST + 1];
	for (int j = 0; j <= n; j++)
		row[j] = j;
	for (int i = 1; *a; a++, i++) {
		int diagonal = row[0];
		row[0] = i;
		for (int j = 1; j <= n; j++) {
			const int replace = diagonal + (*a != b[j - 1]);
			const int step = (row[j - 1] < row[j] ? row[j - 1] : row[j]) + 1;
			diagonal = row[j];
			row[j] = replace < step ? replace : step;
		}
	}
	return row[n];
}

void suggest_fault(const char *name, struct welkin_faults *faults)
{
	/* Only for the first few: a body of many unknown names should not cost much. */
	enum { SUGGESTIONS = 8 };
	int best = -1, least = 4;
	for (int i = 0; i < welkin_field_count && faults->n < SUGGESTIONS; i++) {
		const char *full = welkin_fields[i].name;
		const char *last = strrchr(full, '.');
		/* "sun.elevation" for sun.elevation_deg, "elevation_deg" for the same */
		const size_t length = strlen(name);
		const bool begins = length > 3 && !strncmp(full, name, length) && full[length] == '_';
		const int d = begins || (last && !strcmp(last + 1, name)) ? 1 : distance(name, full);
		if (d < least && d <= (int)length / 3) {
			least = d;
			best = i;
		}
	}
	if (best >= 0)
		welkin_fault_add(faults, 422, name, "see /openapi.json", "unknown field; is %s meant?",
			welkin_fields[best].name);
	else
		welkin_fault_add(faults, 422, name, "see /openapi.json", "unknown field");
}
