#include "server/documents.h"
#include "api/api.h"
#include "api/text.h"
#include "gpu/measured.h"
#include "gpu/operator_methods.h"
#include "server/version.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void hash_tag(const void *data, size_t size, char tag[33])
{
	/* FNV-1a twice with different offsets; a tag, not a defence. */
	uint64_t a = 14695981039346656037u, b = 1099511628211u;
	for (size_t i = 0; i < size; i++) {
		a = (a ^ ((const unsigned char *)data)[i]) * 1099511628211u;
		b = (b ^ ((const unsigned char *)data)[i]) * 1099511628211u;
	}
	snprintf(tag, 33, "%016llx%016llx", (unsigned long long)a, (unsigned long long)b);
}

static const char *type_of(const char *name)
{
	static const struct {
		const char *suffix, *type;
	} types[] = { { ".html", "text/html; charset=utf-8" }, { ".css", "text/css; charset=utf-8" },
		{ ".js", "text/javascript; charset=utf-8" }, { ".json", "application/json" },
		{ ".svg", "image/svg+xml" }, { ".png", "image/png" }, { ".ico", "image/x-icon" },
		{ ".txt", "text/plain; charset=utf-8" }, { ".webmanifest", "application/manifest+json" },
		{ ".woff2", "font/woff2" } };
	const char *dot = strrchr(name, '.');
	for (size_t i = 0; dot && i < sizeof types / sizeof *types; i++)
		if (!strcmp(dot, types[i].suffix))
			return types[i].type;
	return "application/octet-stream";
}

/* ---- /v1/methods ---- */

static const char *const type_names[] = { "number", "integer", "boolean", "enum", "flags", "vector", "triple", "time",
	"seed", "name" };

static void add_member(struct text *text, const char *name, const char *value)
{
	text_printf(text, "\"%s\":", name);
	text_json_string(text, value ? value : "");
}

static void add_range(struct text *text, double min, double max)
{
	text_puts(text, ",\"min\":");
	isfinite(min) ? text_number(text, min) : text_puts(text, "null");
	text_puts(text, ",\"max\":");
	isfinite(max) ? text_number(text, max) : text_puts(text, "null");
}

static void add_field(struct text *text, const char *name)
{
	const int i = welkin_field_find(name);
	const struct welkin_field *f = i < 0 ? NULL : &welkin_fields[i];
	text_puts(text, "{");
	add_member(text, "name", name);
	if (f) {
		text_puts(text, ",");
		add_member(text, "type", type_names[f->type]);
		text_puts(text, ",");
		add_member(text, "unit", f->unit);
		text_puts(text, ",");
		add_member(text, "default", f->default_text);
		text_puts(text, ",");
		add_member(text, "help", f->help);
		if (f->names) {
			text_puts(text, ",\"values\":[");
			for (int n = 0; f->names[n]; n++) {
				text_puts(text, n ? "," : "");
				text_json_string(text, f->names[n]);
			}
			text_puts(text, "]");
		} else if (f->type != WELKIN_TYPE_BOOL && f->type != WELKIN_TYPE_TIME && f->type != WELKIN_TYPE_NAME) {
			add_range(text, f->min, f->max);
		}
	}
	text_puts(text, "}");
}

/* What it was found to err and cost, scene by scene. */
static void add_measured(struct text *text, const struct method *m)
{
	int n = 0;
	text_puts(text, ",\"measured\":[");
	for (const struct measured_point *p = welkin_measured; p->method; p++) {
		if (strcmp(p->method, m->name))
			continue;
		text_puts(text, n++ ? ",\n{" : "\n{");
		add_member(text, "scene", welkin_measured_scenes[p->scene].name);
		if (p->steps)
			text_printf(text, ",\"steps\":%d", p->steps);
		if (p->light_steps)
			text_printf(text, ",\"light_steps\":%d", p->light_steps);
		if (p->goal > 0)
			text_printf(text, ",\"max_error\":%g", p->goal);
		text_printf(text,
			",\"in_domain\":%s,\"error\":%.4g,\"error_uncertainty\":%.2g,\"error_p99\":%.4g,\"delta_e\":%."
			"4g",
			p->in_domain ? "true" : "false", p->error, p->uncertainty, p->p99, p->delta_e);
		text_printf(text,
			",\"frame_ms\":%.4g,\"megapixel_ms\":%.4g,\"first_tables_ms\":%.4g,\"ms_1280x720\":%.4g}",
			p->frame_ms, p->mpixel_ms, p->first_ms, measured_ms(p, 1280 * 720));
	}
	text_puts(text, "]");
}

static void add_operators(struct text *text, const struct operator_method *m, const struct operator_status *status)
{
	text_printf(
		text, ",\"operator\":true,\"available\":%s,", status->state == OPERATOR_UNAVAILABLE ? "false" : "true");
	add_member(text, "file", m->file);
	if (status->state == OPERATOR_UNAVAILABLE) {
		text_puts(text, ",");
		add_member(text, "reason", status->reason);
	}
	if (status->ns_per_ray > 0)
		text_printf(text, ",\"ns_per_ray\":%.1f", status->ns_per_ray);
}

static void add_method(struct text *text, const struct method *m)
{
	text_puts(text, "{");
	add_member(text, "name", m->name);
	text_puts(text, ",");
	add_member(text, "summary", m->summary);
	text_puts(text, ",");
	add_member(text, "source", m->source);
	text_printf(text, ",\"single_scattering\":%s,\"physical\":%s,\"fields\":[",
		m->single_scattering ? "true" : "false", m->physical ? "true" : "false");
	for (int i = 0; m->fields && m->fields[i]; i++) {
		text_puts(text, i ? "," : "");
		add_field(text, m->fields[i]);
	}
	text_puts(text, "],\"domain\":[");
	for (const struct method_range *r = m->domain; r && r->field; r++) {
		text_puts(text, r == m->domain ? "{" : ",{");
		add_member(text, "field", r->field);
		add_range(text, r->min, r->max);
		text_puts(text, ",");
		add_member(text, "why", r->why);
		text_puts(text, "}");
	}
	text_puts(text, "]");
	add_measured(text, m);
}

static char *methods_json(void)
{
	struct text text = { 0 };
	text_puts(&text, "{\"measured_on\":");
	text_json_string(&text, welkin_measured_device);
	text_puts(&text, ",\"methods\":[\n");
	for (int i = 0; i < welkin_method_count; i++) {
		text_puts(&text, i ? ",\n" : "");
		add_method(&text, welkin_methods[i]);
		const int entry = operator_methods_find(i);
		if (entry < 0) {
			text_puts(&text, ",\"operator\":false,\"available\":true}");
			continue;
		}
		const struct operator_status status = operator_methods_status(entry);
		add_operators(&text, operator_methods_at(entry), &status);
		text_puts(&text, "}");
	}
	/* Files whose names can't be asked for: here an operator sees why. */
	for (int entry = 0; entry < operator_methods_count(); entry++) {
		const struct operator_method *m = operator_methods_at(entry);
		const struct operator_status status = operator_methods_status(entry);
		if (m->index >= 0)
			continue;
		text_puts(&text, ",\n{");
		add_member(&text, "name", m->file);
		add_operators(&text, m, &status);
		text_puts(&text, "}");
	}
	text_puts(&text, "\n]}\n");
	return text_take(&text);
}

/* ---- all of them ---- */

/* All of them at one time; those before are kept, since a reply may still be reading them. */
struct documents_made {
	struct document list[DOCUMENT_COUNT];
	unsigned changes; /* operator_methods_changes() when it was made */
	struct documents_made *before;
};

static bool make(struct document *d, char *json)
{
	if (!json)
		return false;
	*d = (struct document){ .type = "application/json", .data = json, .size = strlen(json), .owned = json };
	hash_tag(d->data, d->size, d->tag);
	return true;
}

static void free_made(struct documents_made *made)
{
	for (int i = 0; made && i < DOCUMENT_COUNT; i++)
		free(made->list[i].owned);
	free(made);
}

static struct documents_made *make_all(void)
{
	struct documents_made *made = calloc(1, sizeof *made);
	if (!made)
		return NULL;
	made->changes = operator_methods_changes();
	if (make(&made->list[DOCUMENT_METHODS], methods_json()) &&
		make(&made->list[DOCUMENT_PRESETS], welkin_presets_json()) &&
		make(&made->list[DOCUMENT_OPENAPI], welkin_openapi_json(build_version)))
		return made;
	free_made(made);
	return NULL;
}

const struct document *documents_made(struct documents *documents, int which)
{
	pthread_mutex_lock(&documents->lock);
	if (documents->newest->changes != operator_methods_changes()) {
		struct documents_made *made = make_all();
		if (made) { /* without memory the old ones have to do */
			made->before = documents->newest;
			documents->newest = made;
		}
	}
	const struct document *document = &documents->newest->list[which];
	pthread_mutex_unlock(&documents->lock);
	return document;
}

struct documents *documents_create(struct error *err)
{
	size_t n = 0;
	while (welkin_embedded_www[n].name)
		n++;
	struct documents *d = calloc(1, sizeof *d);
	if (d)
		d->files = calloc(n + 1, sizeof *d->files);
	if (!d || !d->files || !(d->newest = make_all())) {
		documents_destroy(d);
		error_set(err, "out of memory");
		return NULL;
	}
	pthread_mutex_init(&d->lock, NULL);
	for (size_t i = 0; i < n; i++) {
		const struct embedded_file *f = &welkin_embedded_www[i];
		d->files[i] =
			(struct document){ .type = type_of(f->name), .data = f->data, .size = f->size, .page = true };
		hash_tag(f->data, f->size, d->files[i].tag);
	}
	return d;
}

void documents_destroy(struct documents *documents)
{
	if (!documents)
		return;
	while (documents->newest) {
		struct documents_made *made = documents->newest;
		documents->newest = made->before;
		free_made(made);
	}
	free(documents->files);
	free(documents);
}

const struct embedded_file *documents_file(const char *path)
{
	const char *name = !strcmp(path, "/") ? "index.html" : path + 1;
	for (const struct embedded_file *f = welkin_embedded_www; *path == '/' && f->name; f++)
		if (!strcmp(f->name, name))
			return f;
	return NULL;
}

const struct document *documents_of_file(const struct documents *documents, const struct embedded_file *file)
{
	return &documents->files[file - welkin_embedded_www];
}
