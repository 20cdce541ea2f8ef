#include "api/api.h"
#include "api/text.h"

static void member(struct text *text, const char *name, const char *value)
{
	if (!value)
		return;
	text_printf(text, ",\"%s\":", name);
	text_json_string(text, value);
}

char *welkin_problem_json(int status, const char *type, const char *title, const char *detail, const char *instance,
	const struct welkin_faults *faults)
{
	struct text text = { 0 };
	text_puts(&text, "{\"type\":");
	text_json_string(&text, type ? type : "about:blank");
	member(&text, "title", title);
	text_printf(&text, ",\"status\":%d", status);
	member(&text, "detail", detail);
	member(&text, "instance", instance);
	if (faults && faults->n > 0) {
		text_printf(&text, ",\"error_count\":%d,\"errors\":[", faults->n);
		for (int i = 0; i < faults->n && i < WELKIN_FAULTS_MAX; i++) {
			const struct welkin_fault *fault = &faults->list[i];
			text_puts(&text, i ? ",{\"field\":" : "{\"field\":");
			text_json_string(&text, fault->field);
			member(&text, "detail", fault->detail);
			if (fault->allowed[0])
				member(&text, "allowed", fault->allowed);
			text_puts(&text, "}");
		}
		text_puts(&text, "]");
	}
	text_puts(&text, "}");
	return text_take(&text);
}
