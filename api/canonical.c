#include "api/value.h"

#include <stdlib.h>
#include <string.h>

/* A resolved request back to text: what is written here, parsed and resolved, is the same bytes. */

/* How many leading characters of two dotted names are groups they share ("a.b.c", "a.b.d": 4). */
static size_t shared_groups(const char *a, const char *b)
{
	size_t shared = 0;
	for (size_t i = 0; a[i] && a[i] == b[i]; i++)
		if (a[i] == '.')
			shared = i + 1;
	return shared;
}

static int count_dots(const char *name)
{
	int n = 0;
	for (; *name; name++)
		n += *name == '.';
	return n;
}

char *welkin_request_json(const struct welkin_request *request)
{
	struct text text = { 0 };
	const char *before = "";
	text_puts(&text, "{");
	for (int i = 0; i < welkin_field_count; i++) {
		const char *name = welkin_fields[i].name;
		if (welkin_field_idle(&welkin_fields[i], request))
			continue;
		const size_t shared = shared_groups(before, name);
		for (int closing = count_dots(before + shared); closing > 0; closing--)
			text_puts(&text, "}");
		text_puts(&text, i ? "," : "");
		const char *rest = name + shared;
		for (const char *dot = strchr(rest, '.'); dot; rest = dot + 1, dot = strchr(rest, '.'))
			text_printf(&text, "\"%.*s\":{", (int)(dot - rest), rest);
		text_printf(&text, "\"%s\":", rest);
		value_to_json(&welkin_fields[i], request, &text);
		before = name;
	}
	for (int closing = count_dots(before); closing >= 0; closing--)
		text_puts(&text, "}");
	return text_take(&text);
}

/* Fields that decide others' defaults, in the order in which they do; the rest follows in table order. */
static const char *const deciding[] = {
	"scene.name",
	"image.projection",
	"image.width",
	"image.height",
	"time",
	"place.latitude_deg",
	"place.longitude_deg",
	"sun.elevation_deg",
	"sun.azimuth_deg",
	"atmosphere.preset",
	"atmosphere.planet_radius_m",
};

struct difference {
	const struct welkin_request *wanted;
	struct welkin_draft draft; /* what has been found necessary so far */
	struct welkin_request now; /* what it resolves to */
};

static void resolve_now(struct difference *d)
{
	struct welkin_faults faults = { 0 };
	welkin_resolve(&d->draft, (enum welkin_format)d->wanted->image.format, NULL, &d->now, &faults);
}

static bool demand(struct difference *d, int index)
{
	const struct welkin_field *field = &welkin_fields[index];
	if (d->draft.given[index] || value_equal(field, &d->now, d->wanted))
		return false;
	d->draft.given[index] = 1;
	value_copy(field, &d->draft.request, d->wanted);
	return true;
}

/* Marks the fields without which the request would not come out again. */
static void find_differences(struct difference *d)
{
	resolve_now(d);
	for (size_t i = 0; i < sizeof deciding / sizeof deciding[0]; i++)
		if (demand(d, welkin_field_find(deciding[i])))
			resolve_now(d);
	const double *position = d->wanted->camera.position_m;
	if (position[0] != 0 || position[2] != 0 || position[1] < 0)
		if (demand(d, welkin_field_find("camera.position_m")))
			resolve_now(d);
	/* Altitude comes next in need, for it brings the position. */
	if (demand(d, welkin_field_find("camera.altitude_m")))
		resolve_now(d);
	bool more = true;
	while (more) {
		more = false;
		for (int i = 0; i < welkin_field_count; i++)
			more |= demand(d, i);
		if (more)
			resolve_now(d);
	}
}

char *welkin_request_query(const struct welkin_request *request)
{
	struct text text = { 0 };
	struct difference *d = calloc(1, sizeof *d);
	if (!d)
		return NULL;
	d->wanted = request;
	find_differences(d);
	for (int i = 0; i < welkin_field_count; i++) {
		if (!d->draft.given[i])
			continue;
		struct text value = { 0 };
		value_to_text(&welkin_fields[i], request, &value);
		char *plain = text_take(&value);
		text_printf(&text, "%s%s=", text.length ? "&" : "", welkin_fields[i].name);
		if (plain)
			text_query_escape(&text, plain);
		else
			text.failed = true;
		free(plain);
	}
	free(d);
	return text_take(&text);
}

void welkin_request_key(const struct welkin_request *request, const char *salt, char key[33])
{
	/* FNV-1a, 128 bits: offset basis and prime of its authors. */
	unsigned __int128 hash = (unsigned __int128)0x6C62272E07BB0142u << 64 | 0x62B821756295C58Du;
	const unsigned __int128 prime = (unsigned __int128)0x1000000u << 64 | 0x13Bu;
	const unsigned char *bytes = (const unsigned char *)request;
	for (size_t i = 0; i < sizeof *request; i++)
		hash = (hash ^ bytes[i]) * prime;
	for (; *salt; salt++)
		hash = (hash ^ (unsigned char)*salt) * prime;
	for (int i = 31; i >= 0; i--, hash >>= 4)
		key[i] = "0123456789abcdef"[(unsigned)hash & 15];
	key[32] = '\0';
}
