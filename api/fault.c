#include "api/api.h"
#include "api/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Copies what fits, cut between characters and not inside one, since it ends up in JSON. */
static void copy_cut(char *to, size_t size, const char *from)
{
	const size_t length = strlen(from);
	size_t n = 0;
	while (n < length) {
		size_t step = utf8_length(from + n, length - n);
		if (step == 0)
			step = 1;
		if (n + step >= size)
			break;
		n += step;
	}
	memcpy(to, from, n);
	to[n] = '\0';
}

void welkin_fault_add(
	struct welkin_faults *faults, int status, const char *field, const char *allowed, const char *detail, ...)
{
	if (faults->n == 0 || status < faults->status)
		faults->status = status;
	if (faults->n < WELKIN_FAULTS_MAX) {
		struct welkin_fault *fault = &faults->list[faults->n];
		char line[512];
		va_list args;
		va_start(args, detail);
		vsnprintf(line, sizeof line, detail, args);
		va_end(args);
		copy_cut(fault->field, sizeof fault->field, field);
		copy_cut(fault->allowed, sizeof fault->allowed, allowed);
		copy_cut(fault->detail, sizeof fault->detail, line);
	}
	faults->n++;
}
