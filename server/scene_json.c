#include "api/text.h"
#include "server/scene_parse.h"

#include <cJSON.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

/* scene.json: strict, so that a slip of the pen is noticed. */

struct member {
	const char *name;
	size_t offset, size; /* size 0: a number */
	double min, max;
};

#define ABOUT(field) offsetof(struct scene_about, field)
#define SAID(field) offsetof(struct scene_description, field)
#define TEXT(field) sizeof((struct scene_about *)0)->field
#define PATH SCENE_PATH_MAX

static const struct member of_scene[] = {
	{ "title", ABOUT(title), TEXT(title), 0, 0 },
	{ "licence", ABOUT(licence), TEXT(licence), 0, 0 },
	{ "source", ABOUT(source), TEXT(source), 0, 0 },
	{ "latitude_deg", ABOUT(latitude_deg), 0, -90, 90 },
	{ "longitude_deg", ABOUT(longitude_deg), 0, -180, 180 },
	{ "altitude_m", ABOUT(altitude_m), 0, -1e6, 1e6 },
	{ "heading_deg", ABOUT(heading_deg), 0, -360, 360 },
	{ "scale", ABOUT(scale), 0, 1e-4, 1e4 },
	{ 0 },
};

static const struct member of_model[] = { { "model", SAID(model), PATH, 0, 0 }, { 0 } };

static const struct member of_heightmap[] = {
	{ "file", SAID(heightmap), PATH, 0, 0 },
	{ "albedo", SAID(albedo), PATH, 0, 0 },
	{ "spacing_m", SAID(spacing_m), 0, 1e-3, 1e6 },
	{ "low_m", SAID(low_m), 0, -1e5, 1e6 },
	{ "high_m", SAID(high_m), 0, -1e5, 1e6 },
	{ 0 },
};

static const struct member *find(const struct member *table, const char *name)
{
	while (table->name && strcmp(table->name, name))
		table++;
	return table->name ? table : NULL;
}

static bool take(const struct member *m, const cJSON *json, void *into, struct error *err)
{
	char *to = (char *)into + m->offset;
	if (m->size) {
		if (!cJSON_IsString(json) || strlen(json->valuestring) >= m->size ||
			utf8_check(json->valuestring, strlen(json->valuestring)) < strlen(json->valuestring))
			return error_set(err, "scene.json: \"%s\" has to be a string of at most %zu bytes", m->name,
				m->size - 1);
		snprintf(to, m->size, "%s", json->valuestring);
		return true;
	}
	if (!cJSON_IsNumber(json) || !(json->valuedouble >= m->min && json->valuedouble <= m->max))
		return error_set(err, "scene.json: \"%s\" has to be a number of %g to %g", m->name, m->min, m->max);
	memcpy(to, &json->valuedouble, sizeof(double));
	return true;
}

static bool take_heightmap(const cJSON *json, struct scene_description *d, struct error *err)
{
	if (!cJSON_IsObject(json))
		return error_set(err, "scene.json: \"heightmap\" has to be an object");
	for (const cJSON *j = json->child; j; j = j->next) {
		const struct member *m = find(of_heightmap, j->string);
		if (!m)
			return error_set(err, "scene.json: there is no \"heightmap\": {\"%.40s\"}", j->string);
		if (!take(m, j, d, err))
			return false;
	}
	if (!d->heightmap[0] || !(d->spacing_m > 0) || !isfinite(d->low_m) || !isfinite(d->high_m))
		return error_set(
			err, "scene.json: a height map needs \"file\", \"spacing_m\", \"low_m\" and \"high_m\"");
	if (!(d->high_m > d->low_m))
		return error_set(err, "scene.json: \"high_m\" has to be above \"low_m\"");
	return true;
}

static bool take_member(const cJSON *json, struct scene_description *d, struct scene_about *about, struct error *err)
{
	const struct member *m = find(of_scene, json->string);
	if (m)
		return take(m, json, about, err);
	if ((m = find(of_model, json->string)))
		return take(m, json, d, err);
	if (!strcmp(json->string, "heightmap"))
		return take_heightmap(json, d, err);
	if (!strcmp(json->string, "up")) {
		const char *up = cJSON_GetStringValue(json);
		if (!up || (strcmp(up, "y") && strcmp(up, "z")))
			return error_set(err, "scene.json: \"up\" has to be \"y\" or \"z\"");
		about->up = *up;
		return true;
	}
	return error_set(err, "scene.json: there is no \"%.40s\"", json->string);
}

bool scene_json_read(
	const struct scene_file *file, struct scene_description *d, struct scene_about *about, struct error *err)
{
	d->spacing_m = d->low_m = d->high_m = NAN;
	cJSON *json = file->size <= 65536 ? cJSON_ParseWithLength((const char *)file->data, file->size) : NULL;
	bool sound = cJSON_IsObject(json) || error_set(err, "scene.json is not a JSON object");
	for (const cJSON *j = sound ? json->child : NULL; sound && j; j = j->next)
		sound = take_member(j, d, about, err);
	if (sound && d->model[0] && d->heightmap[0])
		sound = error_set(err, "scene.json: either \"model\" or \"heightmap\"");
	cJSON_Delete(json);
	return sound;
}
