#include "server/timing.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const double least_ms = 0.001; /* what three decimals can show */

/* Appends, or leaves the text as it was when there is no room. */
__attribute__((format(printf, 3, 4))) static void append(char *text, size_t size, const char *format, ...)
{
	const size_t used = strlen(text);
	va_list args;
	va_start(args, format);
	const int n = vsnprintf(text + used, size - used, format, args);
	va_end(args);
	if (n < 0 || (size_t)n >= size - used)
		text[used] = 0;
}

/* A token: anything else becomes '-'. */
static void token(const char *name, char out[40])
{
	size_t i = 0;
	for (; i < 32 && name[i]; i++)
		out[i] = (name[i] >= 'a' && name[i] <= 'z') || (name[i] >= 'A' && name[i] <= 'Z') ||
					 (name[i] >= '0' && name[i] <= '9') || name[i] == '_' || name[i] == '.'
				 ? name[i]
				 : '-';
	out[i] = 0;
}

static double entry(char *text, size_t size, const char *name, double ms)
{
	const double shown = fmax(ms, least_ms);
	append(text, size, "%s%s;dur=%.3f", *text ? ", " : "", name, shown);
	return shown;
}

void timing_of_product(const struct product *p, double total_ms, char *text, size_t size)
{
	char name[40];
	*text = 0;
	double sum = entry(text, size, "queue", p->queue_ms);
	for (int i = 0; i < p->result.n_passes; i++) {
		token(p->result.passes[i].name, name);
		sum += entry(text, size, name, p->result.passes[i].ms);
	}
	sum += entry(text, size, "readback", p->result.readback_ms);
	sum += entry(text, size, "encode", p->encode_ms);
	sum += entry(text, size, "other", total_ms - sum);
	entry(text, size, "total", fmax(total_ms, sum));
}

void timing_shared(const char *name, double total_ms, char *text, size_t size)
{
	*text = 0;
	entry(text, size, name, total_ms);
	entry(text, size, "total", total_ms);
}

void timing_plan(const struct welkin_result *result, char *text, size_t size)
{
	char name[40];
	*text = 0;
	for (int i = 0; i < result->n_plan; i++) {
		const struct welkin_plan_entry *e = &result->plan[i];
		char why[sizeof e->why];
		size_t n = 0;
		for (const char *c = e->why; *c && n < sizeof why - 1; c++)
			if (*c >= 0x20 && *c < 0x7f && *c != '"' && *c != '\\')
				why[n++] = *c;
		why[n] = 0;
		token(e->pass, name);
		if (n)
			append(text, size, "%s%s;ran=?%d;why=\"%s\"", *text ? ", " : "", name, e->ran != 0, why);
		else
			append(text, size, "%s%s;ran=?%d", *text ? ", " : "", name, e->ran != 0);
	}
}
