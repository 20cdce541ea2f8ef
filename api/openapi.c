#include "api/openapi.h"
#include "api/api.h"

#include <stdio.h>
#include <string.h>

/* ---- building ---- */

static _Thread_local bool out_of_memory;

cJSON *doc_item(cJSON *parent, const char *key, cJSON *item)
{
	const cJSON_bool ok = key ? cJSON_AddItemToObject(parent, key, item) : cJSON_AddItemToArray(parent, item);
	if (ok)
		return item;
	cJSON_Delete(item);
	out_of_memory = true;
	return NULL;
}

cJSON *doc_object(cJSON *parent, const char *key)
{
	return doc_item(parent, key, cJSON_CreateObject());
}

cJSON *doc_array(cJSON *parent, const char *key)
{
	return doc_item(parent, key, cJSON_CreateArray());
}

void doc_string(cJSON *parent, const char *key, const char *value)
{
	doc_item(parent, key, cJSON_CreateString(value));
}

void doc_number(cJSON *parent, const char *key, double value)
{
	doc_item(parent, key, cJSON_CreateNumber(value));
}

void doc_bool(cJSON *parent, const char *key, int value)
{
	doc_item(parent, key, cJSON_CreateBool(value));
}

void doc_ref(cJSON *parent, const char *key, const char *pointer)
{
	char full[160];
	snprintf(full, sizeof full, "#/components/%s", pointer);
	doc_string(doc_object(parent, key), "$ref", full);
}

/* ---- the resources ---- */

struct reply_header {
	const char *name, *type, *description;
};

static const struct reply_header reply_headers[] = {
	{ "ETag", "string", "Strong: the same request on the same build and device gives the same bytes." },
	{ "Cache-Control", "string", "How long the reply may be kept." },
	{ "Server-Timing", "string", "Milliseconds of queue, tables, each pass, read-back, encoding and in total." },
	{ "Welkin-Method", "string", "The method that computed the sky." },
	{ "Welkin-Device", "string", "What rendered it." },
	{ "Welkin-Plan", "string", "The passes that ran and those left out, and why." },
	{ "Welkin-Expected-Error", "number",
		"Relative error of luminance to expect of the method, where it was measured." },
	{ "Retry-After", "integer", "Seconds after which to try again, from the measured service time." },
	{ "Allow", "string", "The methods this resource answers to." },
};

enum { HEADER_COUNT = sizeof reply_headers / sizeof reply_headers[0] };

struct problem_reply {
	int status;
	const char *name, *description, *header; /* header NULL: none */
};

static const struct problem_reply problem_replies[] = {
	{ 400, "Malformed", "The query or the body cannot be read.", NULL },
	{ 403, "Forbidden", "This server takes no uploads.", NULL },
	{ 404, "NotFound", "There is no such resource.", NULL },
	{ 405, "MethodNotAllowed", "The resource does not answer to this method.", "Allow" },
	{ 406, "NotAcceptable", "None of the types in Accept can be made.", NULL },
	{ 413, "TooLarge", "The body is too large.", NULL },
	{ 414, "UriTooLong", "The URL is too long.", NULL },
	{ 415, "UnsupportedType", "The body is of a type that the resource does not take.", NULL },
	{ 422, "OutOfRange", "Fields are unknown, out of range, in contradiction or outside the domain of the method.",
		NULL },
	{ 429, "QueueFull", "Too much is waiting already.", "Retry-After" },
	{ 500, "Failed", "The fault is the server's.", NULL },
	{ 503, "Unavailable", "The renderer is being replaced.", "Retry-After" },
	{ 504, "TimedOut", "The request was not done by its deadline.", NULL },
};

enum { PROBLEM_COUNT = sizeof problem_replies / sizeof problem_replies[0] };

struct media {
	const char *type, *schema; /* schema NULL: binary */
};

/* What GET or POST does with a resource. Each answers to OPTIONS as well, and GET's also to HEAD. */
struct operation {
	const char *path, *method, *id, *summary;
	const char *body; /* schema of the JSON body, or NULL */
	bool renders;     /* waits in the queue; by GET, takes every field in the query */
	struct media replies[4];
	bool uploads;                          /* its body is an archive */
	const struct welkin_noise_info *noise; /* what it shows; it then takes only the fields that change that */
};

static const struct operation operations[] = {
	{ "/v1/render.png", "get", "renderPng", "Render a picture as PNG", NULL, true, { { "image/png", NULL } } },
	{ "/v1/render.exr", "get", "renderExr", "Render a picture as OpenEXR, linear and with layers", NULL, true,
		{ { "image/x-exr", NULL } } },
	{ "/v1/render", "post", "render", "Render a picture from JSON; Accept picks the type of the reply", "Request",
		true, { { "image/png", NULL }, { "image/x-exr", NULL }, { "multipart/mixed", NULL } } },
	{ "/v1/sequences", "post", "sequences",
		"Render frames over time; each is a part of the reply, which begins with the first that is done",
		"SequenceRequest", true, { { "multipart/mixed", NULL } } },
	{ "/v1/radiance", "post", "radiance", "Measure spectral radiance in given directions", "RadianceRequest", true,
		{ { "application/json", "RadianceReply" } } },
	{ "/v1/noise/base.png", "get", "noiseBase",
		"One layer of the volume of shapes that clouds are made from, as it is", NULL, true,
		{ { "image/png", NULL } }, false, &welkin_noise_infos[WELKIN_NOISE_BASE] },
	{ "/v1/noise/detail.png", "get", "noiseDetail",
		"One layer of the volume that erodes the edges of clouds, as it is", NULL, true,
		{ { "image/png", NULL } }, false, &welkin_noise_infos[WELKIN_NOISE_DETAIL] },
	{ "/v1/noise/curl.png", "get", "noiseCurl", "The map that displaces that, as it is", NULL, true,
		{ { "image/png", NULL } }, false, &welkin_noise_infos[WELKIN_NOISE_CURL] },
	{ "/v1/noise/weather.png", "get", "noiseWeather", "The map of weather that clouds are made from, as it is",
		NULL, true, { { "image/png", NULL } }, false, &welkin_noise_infos[WELKIN_NOISE_WEATHER] },
	{ "/v1/methods", "get", "methods", "The methods, where they are valid, what they cost and how they err", NULL,
		false, { { "application/json", "Methods" } } },
	{ "/v1/presets", "get", "presets", "The presets and the fields they set", NULL, false,
		{ { "application/json", "Presets" } } },
	{ "/v1/scenes", "get", "scenes", "The scenes that scene.name may be, and what is wrong with the others", NULL,
		false, { { "application/json", "Scenes" } } },
	{ "/v1/scenes", "post", "uploadScene",
		"Upload a scene: an archive of its OBJ, MTL and PNG files, and perhaps a scene.json; the reply names "
		"it",
		NULL, false, { { "application/json", "Scene" } }, true },
	{ "/version", "get", "version", "Version, build, device and limits", NULL, false,
		{ { "application/json", "Version" } } },
	{ "/openapi.json", "get", "openapi", "This document", NULL, false, { { "application/json", NULL } } },
	{ "/", "get", "page", "A page with a form of all fields", NULL, false, { { "text/html", NULL } } },
};

enum { OPERATION_COUNT = sizeof operations / sizeof operations[0] };

static void add_header_refs(cJSON *response, const char *const names[])
{
	cJSON *headers = doc_object(response, "headers");
	for (int i = 0; names[i]; i++) {
		char pointer[64];
		snprintf(pointer, sizeof pointer, "headers/%s", names[i]);
		doc_ref(headers, names[i], pointer);
	}
}

static bool takes_fields(const struct operation *op)
{
	return op->renders && !op->body;
}

static void add_success(cJSON *responses, const struct operation *op, bool body)
{
	static const char *const rendered[] = { "ETag", "Cache-Control", "Server-Timing", "Welkin-Method",
		"Welkin-Device", "Welkin-Plan", "Welkin-Expected-Error", NULL };
	cJSON *ok = doc_object(responses, "200");
	doc_string(ok, "description", op->uploads ? "The same was uploaded before." : op->summary);
	if (op->renders)
		add_header_refs(ok, rendered);
	cJSON *content = body ? doc_object(ok, "content") : NULL;
	for (int i = 0; body && op->replies[i].type; i++) {
		cJSON *media = doc_object(content, op->replies[i].type);
		char pointer[64];
		snprintf(pointer, sizeof pointer, "schemas/%s", op->replies[i].schema ? op->replies[i].schema : "");
		if (op->replies[i].schema)
			doc_ref(media, "schema", pointer);
	}
}

/* Which problems an operation can end in; 404 and 405 are of paths and methods not in the document. */
static bool may_fail(const struct operation *op, int status)
{
	if (op->uploads)
		return status == 403 || status == 413 || status == 415 || status == 422 || status == 503;
	switch (status) {
	case 403:
	case 404:
	case 405:
		return false;
	case 413:
	case 415:
		return op->body != NULL;
	case 414:
		return takes_fields(op);
	}
	return op->renders;
}

static void add_problems(cJSON *responses, const struct operation *op)
{
	for (int i = 0; i < PROBLEM_COUNT; i++) {
		const struct problem_reply *problem = &problem_replies[i];
		char status[16], pointer[64];
		snprintf(status, sizeof status, "%d", problem->status);
		snprintf(pointer, sizeof pointer, "responses/%s", problem->name);
		if (may_fail(op, problem->status))
			doc_ref(responses, status, pointer);
	}
	doc_ref(responses, "default", "responses/Problem");
}

static void add_archive_body(cJSON *operation)
{
	static const char *const types[] = { "application/zip", "application/x-tar", "application/gzip",
		"application/octet-stream" };
	cJSON *body = doc_object(operation, "requestBody");
	doc_bool(body, "required", 1);
	cJSON *content = doc_object(body, "content");
	for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
		doc_object(content, types[i]);
}

static void add_created(cJSON *responses)
{
	cJSON *created = doc_object(responses, "201");
	doc_string(created, "description", "It can be asked for by its name, until others take its place.");
	doc_ref(doc_object(doc_object(created, "content"), "application/json"), "schema", "schemas/Scene");
}

/* suffix: what HEAD adds to the id of GET. */
static void add_operation(cJSON *path, const struct operation *op, const char *method, const char *suffix)
{
	cJSON *o = doc_object(path, method);
	char id[64];
	snprintf(id, sizeof id, "%s%s", op->id, suffix);
	doc_string(o, "operationId", id);
	doc_string(o, "summary", op->summary);
	if (op->noise)
		openapi_noise_parameters(doc_array(o, "parameters"), op->noise);
	else if (takes_fields(op))
		openapi_parameter_refs(doc_array(o, "parameters"));
	if (op->body) {
		cJSON *body = doc_object(o, "requestBody");
		char pointer[64];
		snprintf(pointer, sizeof pointer, "schemas/%s", op->body);
		doc_bool(body, "required", 1);
		doc_ref(doc_object(doc_object(body, "content"), "application/json"), "schema", pointer);
	}
	if (op->uploads)
		add_archive_body(o);
	cJSON *responses = doc_object(o, "responses");
	add_success(responses, op, !*suffix);
	if (op->uploads)
		add_created(responses);
	/* these two say how things are now */
	if (!op->body && strcmp(op->path, "/version") != 0 && strcmp(op->path, "/v1/scenes") != 0)
		doc_ref(responses, "304", "responses/NotModified");
	add_problems(responses, op);
}

static void add_options(cJSON *path, const struct operation *op)
{
	static const char *const allow[] = { "Allow", NULL };
	char id[64];
	snprintf(id, sizeof id, "%sOptions", op->id);
	cJSON *o = doc_object(path, "options");
	doc_string(o, "operationId", id);
	doc_string(o, "summary", "The methods allowed");
	cJSON *ok = doc_object(doc_object(o, "responses"), "204");
	doc_string(ok, "description", "The methods allowed");
	add_header_refs(ok, allow);
}

static void add_path(cJSON *paths, const struct operation *op)
{
	cJSON *path = cJSON_GetObjectItemCaseSensitive(paths, op->path);
	if (path) { /* the second method of a resource */
		add_operation(path, op, op->method, "");
		return;
	}
	path = doc_object(paths, op->path);
	add_operation(path, op, op->method, "");
	if (!strcmp(op->method, "get"))
		add_operation(path, op, "head", "Head");
	add_options(path, op);
}

static void add_responses(cJSON *responses)
{
	static const char *const etag[] = { "ETag", "Cache-Control", NULL };
	cJSON *any = doc_object(responses, "Problem");
	doc_string(any, "description", "Any other problem.");
	doc_ref(doc_object(doc_object(any, "content"), "application/problem+json"), "schema", "schemas/Problem");
	cJSON *not_modified = doc_object(responses, "NotModified");
	doc_string(not_modified, "description", "What If-None-Match named is still right; nothing was rendered.");
	add_header_refs(not_modified, etag);
	for (int i = 0; i < PROBLEM_COUNT; i++) {
		const struct problem_reply *problem = &problem_replies[i];
		cJSON *response = doc_object(responses, problem->name);
		doc_string(response, "description", problem->description);
		if (problem->header)
			add_header_refs(response, (const char *const[]){ problem->header, NULL });
		doc_ref(doc_object(doc_object(response, "content"), "application/problem+json"), "schema",
			"schemas/Problem");
	}
}

static void add_headers(cJSON *headers)
{
	for (int i = 0; i < HEADER_COUNT; i++) {
		cJSON *header = doc_object(headers, reply_headers[i].name);
		doc_string(header, "description", reply_headers[i].description);
		doc_string(doc_object(header, "schema"), "type", reply_headers[i].type);
	}
}

static void add_info(cJSON *root, const char *version)
{
	cJSON *info = doc_object(root, "info");
	doc_string(info, "title", "Welkin");
	doc_string(info, "version", version);
	doc_string(info, "summary", "Renders skies over HTTP.");
	doc_string(info, "description",
		"The fields of a request are the same in a query, with dotted names (sun.elevation_deg=5), and in "
		"JSON, as objects "
		"inside objects; the same values give the same bytes either way. Lists in a query are separated by "
		"commas.");
	cJSON *license = doc_object(info, "license");
	doc_string(license, "name", "MIT");
	doc_string(license, "identifier", "MIT");
}

char *welkin_openapi_json(const char *version)
{
	out_of_memory = false;
	cJSON *root = cJSON_CreateObject();
	doc_string(root, "openapi", "3.1.0");
	add_info(root, version);
	doc_string(doc_object(doc_array(root, "servers"), NULL), "url", "/");
	cJSON *paths = doc_object(root, "paths");
	for (int i = 0; i < OPERATION_COUNT; i++)
		add_path(paths, &operations[i]);
	cJSON *components = doc_object(root, "components");
	cJSON *parameters = doc_object(components, "parameters");
	cJSON *schemas = doc_object(components, "schemas");
	openapi_fields(parameters, schemas);
	openapi_schemas(schemas);
	add_responses(doc_object(components, "responses"));
	add_headers(doc_object(components, "headers"));
	char *text = out_of_memory ? NULL : cJSON_PrintUnformatted(root);
	cJSON_Delete(root);
	return text;
}
