#include "api/parse_json.h"
#include "api/json_scan.h"
#include "api/suggest.h"
#include "api/value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct reader {
	struct welkin_draft *draft;
	struct welkin_photometer *photometer; /* NULL: an image request */
	struct welkin_faults *faults;
	uint8_t group_seen[WELKIN_FIELDS_MAX]; /* by the group's first field, a bit for each depth: "a" and "a.b" may
						  begin with the same */
	bool directions_seen, wavelengths_seen;
};

/* The first field below a group's dotted name, or -1. */
static int find_group(const char *name)
{
	const size_t length = strlen(name);
	for (int i = 0; i < welkin_field_count; i++)
		if (!strncmp(welkin_fields[i].name, name, length) && welkin_fields[i].name[length] == '.')
			return i;
	return -1;
}

static void read_field(struct reader *reader, int index, const cJSON *json)
{
	const struct welkin_field *field = &welkin_fields[index];
	if (reader->draft->given[index]) {
		welkin_fault_add(reader->faults, 400, field->name, "", "is given more than once");
		return;
	}
	reader->draft->given[index] = 1;
	value_from_json(field, json, &reader->draft->request, reader->faults);
}

static void fault_unknown(struct reader *reader, const char *name)
{
	if (welkin_field_find(name) >= 0)
		welkin_fault_add(
			reader->faults, 422, name, "", "is a dotted name: in JSON it is an object inside an object");
	else
		suggest_fault(name, reader->faults);
}

static void read_directions(struct reader *reader, const cJSON *json);
static void read_wavelengths(struct reader *reader, const cJSON *json);

/* Members of the photometer stand at the top level. true when the key is one of them. */
static bool read_photometer_member(struct reader *reader, const cJSON *json)
{
	const bool directions = !strcmp(json->string, "directions");
	if (!reader->photometer || (!directions && strcmp(json->string, "wavelengths_nm") != 0))
		return false;
	bool *seen = directions ? &reader->directions_seen : &reader->wavelengths_seen;
	if (*seen)
		welkin_fault_add(reader->faults, 400, json->string, "", "is given more than once");
	else if (directions)
		read_directions(reader, json);
	else
		read_wavelengths(reader, json);
	*seen = true;
	return true;
}

/* prefix is "" at the top, else ends in a dot. The depth of the tree is bounded by the scan, that of groups by
 * the table. */
static void read_object(struct reader *reader, const cJSON *object, const char *prefix, int depth)
{
	const uint8_t bit = (uint8_t)(1u << depth);
	for (const cJSON *json = object->child; json; json = json->next) {
		char name[128]; /* longer than any field's: what is cut is unknown anyway */
		snprintf(name, sizeof name, "%s%s", prefix, json->string);
		if (!*prefix && read_photometer_member(reader, json))
			continue;
		/* A key with a dot in it must not pass for the nested field of that name. */
		const bool dotted = strchr(json->string, '.') != NULL;
		const int field = dotted ? -1 : welkin_field_find(name);
		const int group = dotted || !json->string[0] ? -1 : find_group(name);
		if (field >= 0) {
			read_field(reader, field, json);
		} else if (group < 0) {
			fault_unknown(reader, name);
		} else if (!cJSON_IsObject(json)) {
			welkin_fault_add(reader->faults, 400, name, "", "is not an object");
		} else if (reader->group_seen[group] & bit) {
			welkin_fault_add(reader->faults, 400, name, "", "is given more than once");
		} else {
			reader->group_seen[group] |= bit;
			strncat(name, ".", sizeof name - strlen(name) - 1);
			read_object(reader, json, name, depth + 1);
		}
	}
}

/* ---- the photometer's lists ---- */

/* Finite and inside [min, max], or a fault. */
static bool read_number(struct reader *reader, const cJSON *json, const char *name, double min, double max, double *out)
{
	char allowed[64];
	snprintf(allowed, sizeof allowed, "%g to %g", min, max);
	if (!cJSON_IsNumber(json)) {
		welkin_fault_add(reader->faults, 400, name, allowed, "is not a number");
		return false;
	}
	*out = json->valuedouble;
	if (*out >= min && *out <= max)
		return true;
	welkin_fault_add(reader->faults, 422, name, allowed, "%.10g is outside the allowed range", *out);
	return false;
}

static bool read_vector(struct reader *reader, const cJSON *json, const char *name, double out[3])
{
	int n = 0;
	double largest = 0;
	for (const cJSON *item = cJSON_IsArray(json) ? json->child : NULL; item; item = item->next, n++) {
		if (n == 3 || !cJSON_IsNumber(item)) {
			n = 0;
			break;
		}
		out[n] = item->valuedouble;
		largest = fmax(largest, fabs(out[n]));
	}
	if (n != 3) {
		welkin_fault_add(reader->faults, 400, name, "", "is not a list of three numbers");
		return false;
	}
	if (largest == 0 || !isfinite(largest)) {
		welkin_fault_add(reader->faults, 422, name, "", largest == 0 ? "has no length" : "is not finite");
		return false;
	}
	/* Scaled first, so that neither 1e300 nor 1e-300 leaves the range when squared. */
	double squares = 0;
	for (int i = 0; i < 3; i++) {
		out[i] /= largest;
		squares += out[i] * out[i];
	}
	for (int i = 0; i < 3; i++)
		out[i] = out[i] / sqrt(squares) + 0.0;
	return true;
}

static void from_angles(double elevation_deg, double azimuth_deg, double out[3])
{
	const double e = elevation_deg * (M_PI / 180), a = azimuth_deg * (M_PI / 180);
	out[0] = cos(e) * sin(a);
	out[1] = sin(e);
	out[2] = -cos(e) * cos(a);
}

enum { ELEVATION, ZENITH, AZIMUTH, VECTOR, DIRECTION_KEYS };

static bool read_direction(struct reader *reader, const cJSON *json, int index, double out[3])
{
	static const char *const keys[] = { "elevation_deg", "zenith_deg", "azimuth_deg", "vector" };
	static const char *const shapes = "{elevation_deg, azimuth_deg}, {zenith_deg, azimuth_deg} or {vector}";
	const cJSON *found[DIRECTION_KEYS] = { 0 };
	char name[96];
	snprintf(name, sizeof name, "directions[%d]", index);
	if (!cJSON_IsObject(json)) {
		welkin_fault_add(reader->faults, 400, name, shapes, "is not an object");
		return false;
	}
	for (const cJSON *member = json->child; member; member = member->next) {
		int key = 0;
		while (key < DIRECTION_KEYS && strcmp(keys[key], member->string) != 0)
			key++;
		snprintf(name, sizeof name, "directions[%d].%s", index, member->string);
		if (key == DIRECTION_KEYS || found[key]) {
			welkin_fault_add(reader->faults, key == DIRECTION_KEYS ? 422 : 400, name, shapes,
				key == DIRECTION_KEYS ? "is not a known member" : "is given more than once");
			return false;
		}
		found[key] = member;
	}
	snprintf(name, sizeof name, "directions[%d]", index);
	const bool angles = found[AZIMUTH] && !found[ELEVATION] != !found[ZENITH] && !found[VECTOR];
	const bool vector = found[VECTOR] && !found[AZIMUTH] && !found[ELEVATION] && !found[ZENITH];
	if (!angles && !vector) {
		welkin_fault_add(reader->faults, 422, name, shapes, "does not say one direction");
		return false;
	}
	if (vector) {
		strncat(name, ".vector", sizeof name - strlen(name) - 1);
		return read_vector(reader, found[VECTOR], name, out);
	}
	double height = 0, azimuth = 0;
	const int which = found[ELEVATION] ? ELEVATION : ZENITH;
	snprintf(name, sizeof name, "directions[%d].%s", index, keys[which]);
	bool ok = read_number(
		reader, found[which], name, which == ELEVATION ? -90 : 0, which == ELEVATION ? 90 : 180, &height);
	snprintf(name, sizeof name, "directions[%d].azimuth_deg", index);
	ok = read_number(reader, found[AZIMUTH], name, -360, 360, &azimuth) && ok;
	from_angles(which == ELEVATION ? height : 90 - height, azimuth, out);
	return ok;
}

/* Room for the numbers of a list, `each` per item, or NULL after a fault. */
static double *list_room(struct reader *reader, const cJSON *json, const char *name, int max, size_t each, int *n)
{
	char allowed[64];
	snprintf(allowed, sizeof allowed, "a list of 1 to %d", max);
	*n = 0;
	if (!cJSON_IsArray(json)) {
		welkin_fault_add(reader->faults, 400, name, allowed, "is not a list");
		return NULL;
	}
	const int length = cJSON_GetArraySize(json);
	if (length < 1 || length > max) {
		welkin_fault_add(reader->faults, 422, name, allowed, "has %d items", length);
		return NULL;
	}
	double *room = calloc((size_t)length, each * sizeof *room);
	if (!room)
		welkin_fault_add(reader->faults, 503, name, "", "out of memory");
	else
		*n = length;
	return room;
}

static void read_directions(struct reader *reader, const cJSON *json)
{
	struct welkin_photometer *p = reader->photometer;
	p->directions = list_room(reader, json, "directions", 16384, 3, &p->n_directions);
	const cJSON *item = json->child;
	for (int i = 0; i < p->n_directions; i++, item = item->next)
		read_direction(reader, item, i, p->directions + 3 * i);
}

static void read_wavelengths(struct reader *reader, const cJSON *json)
{
	struct welkin_photometer *p = reader->photometer;
	p->wavelengths_nm = list_room(reader, json, "wavelengths_nm", 64, 1, &p->n_wavelengths);
	const cJSON *item = json->child;
	for (int i = 0; i < p->n_wavelengths; i++, item = item->next) {
		char name[64];
		snprintf(name, sizeof name, "wavelengths_nm[%d]", i);
		read_number(reader, item, name, 360, 830, &p->wavelengths_nm[i]);
	}
}

void welkin_photometer_finish(struct welkin_photometer *photometer)
{
	if (!photometer)
		return;
	free(photometer->directions);
	free(photometer->wavelengths_nm);
	*photometer = (struct welkin_photometer){ 0 };
}

void json_read_fields(struct welkin_draft *draft, const cJSON *object, struct welkin_faults *faults)
{
	struct reader reader = { .draft = draft, .faults = faults };
	read_object(&reader, object, "", 0);
}

void welkin_parse_json(struct welkin_draft *draft, const char *text, size_t length,
	struct welkin_photometer *photometer, struct welkin_faults *faults)
{
	struct reader reader = { .draft = draft, .photometer = photometer, .faults = faults };
	if (photometer)
		*photometer = (struct welkin_photometer){ 0 };
	char reason[160];
	cJSON *tree = json_read(text, length, reason);
	if (!tree) {
		welkin_fault_add(faults, 400, "", "", "%s", reason);
		return;
	}
	if (!cJSON_IsObject(tree)) {
		welkin_fault_add(faults, 400, "", "", "the body is not a JSON object");
	} else {
		read_object(&reader, tree, "", 0);
		if (photometer && !reader.directions_seen)
			welkin_fault_add(faults, 422, "directions", "a list of 1 to 16384", "is missing");
		if (photometer && !reader.wavelengths_seen)
			welkin_fault_add(faults, 422, "wavelengths_nm", "a list of 1 to 64", "is missing");
	}
	cJSON_Delete(tree);
}
