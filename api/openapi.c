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
	{ 404, "NotFound", "There is no such resource.", NULL },
	{ 405, "MethodNotAllowed", "The resource does not answer to this method.", "Allow" },
	{ 406, "NotAcceptable", "None of the types in Accept can be made.", NULL },
	{ 413, "TooLarge", "The body is too large.", NULL },
	{ 414, "UriTooLong", "The URL is too long.", NULL },
	{ 415, "UnsupportedType", "The body is not JSON.", NULL },
	{ 422, "OutOfRange", "Fields are unknown, out of range, in contradiction or outside the domain of the method.", NULL },
	{ 429, "QueueFull", "Too much is waiting already.", "Retry-After" },
	{ 503, "Unavailable", "The renderer is being replaced.", "Retry-After" },
	{ 504, "TimedOut", "The request was not done by its deadline.", NULL },
};

enum { PROBLEM_COUNT = sizeof problem_replies / sizeof problem_replies[0] };

struct media {
	const char *type, *schema; /* schema NULL: binary */
};

struct operation {
	const char *path, *method, *id, *summary;
	const char *body;       /* schema of the JSON body, or NULL */
	bool fields;            /* takes every field in the query */
	bool renders;           /* waits in the queue */
	struct media replies[4];
};

static const struct operation operations[] = {
	{ "/v1/render.png", "get", "renderPng", "Render a picture as PNG", NULL, true, true, { { "image/png", NULL } } },
	{ "/v1/render.png", "head", "headPng", "The headers of that picture", NULL, true, true, { { NULL, NULL } } },
	{ "/v1/render.png", "options", "optionsPng", "The methods allowed", NULL, false, false, { { NULL, NULL } } },
	{ "/v1/render.exr", "get", "renderExr", "Render a picture as OpenEXR, linear and with layers", NULL, true, true,
	  { { "image/x-exr", NULL } } },
	{ "/v1/render.exr", "head", "headExr", "The headers of that picture", NULL, true, true, { { NULL, NULL } } },
	{ "/v1/render.exr", "options", "optionsExr", "The methods allowed", NULL, false, false, { { NULL, NULL } } },
	{ "/v1/render", "post", "render", "Render a picture from JSON; Accept picks the type of the reply", "Request", false, true,
	  { { "image/png", NULL }, { "image/x-exr", NULL }, { "multipart/mixed", NULL } } },
	{ "/v1/render", "options", "optionsRender", "The methods allowed", NULL, false, false, { { NULL, NULL } } },
	{ "/v1/radiance", "post", "radiance", "Measure spectral radiance in given directions", "RadianceRequest", false, true,
	  { { "application/json", "RadianceReply" } } },
	{ "/v1/radiance", "options", "optionsRadiance", "The methods allowed", NULL, false, false, { { NULL, NULL } } },
	{ "/v1/methods", "get", "methods", "The methods, where they are valid, what they cost and how they err", NULL, false, false,
	  { { "application/json", "Methods" } } },
	{ "/v1/presets", "get", "presets", "The presets and the fields they set", NULL, false, false,
	  { { "application/json", "Presets" } } },
	{ "/version", "get", "version", "Version, build and device", NULL, false, false, { { "application/json", "Version" } } },
	{ "/openapi.json", "get", "openapi", "This document", NULL, false, false, { { "application/json", NULL } } },
	{ "/", "get", "page", "A page with a form of all fields", NULL, false, false, { { "text/html", NULL } } },
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

static void add_success(cJSON *responses, const struct operation *op)
{
	static const char *const rendered[] = { "ETag", "Cache-Control", "Server-Timing", NULL };
	static const char *const allow[] = { "Allow", NULL };
	const bool options = !strcmp(op->method, "options");
	cJSON *ok = doc_object(responses, options ? "204" : "200");
	doc_string(ok, "description", op->summary);
	if (op->renders)
		add_header_refs(ok, rendered);
	if (options)
		add_header_refs(ok, allow);
	if (!op->replies[0].type)
		return;
	cJSON *content = doc_object(ok, "content");
	for (int i = 0; op->replies[i].type; i++) {
		cJSON *media = doc_object(content, op->replies[i].type);
		char pointer[64];
		snprintf(pointer, sizeof pointer, "schemas/%s", op->replies[i].schema ? op->replies[i].schema : "");
		if (op->replies[i].schema)
			doc_ref(media, "schema", pointer);
	}
}

/* Which problems an operation can end in. */
static bool may_fail(const struct operation *op, int status)
{
	switch (status) {
	case 404: /* of paths that are not in this document */
	case 405:
		return false;
	case 413:
	case 415:
		return op->body != NULL;
	case 414:
		return op->fields;
	case 406:
		return op->replies[0].type != NULL && op->renders;
	}
	return op->renders;
}

static void add_operation(cJSON *paths, const struct operation *op)
{
	cJSON *path = cJSON_GetObjectItemCaseSensitive(paths, op->path);
	cJSON *o = doc_object(path ? path : doc_object(paths, op->path), op->method);
	doc_string(o, "operationId", op->id);
	doc_string(o, "summary", op->summary);
	if (op->fields)
		openapi_parameter_refs(doc_array(o, "parameters"));
	if (op->body) {
		cJSON *body = doc_object(o, "requestBody");
		char pointer[64];
		snprintf(pointer, sizeof pointer, "schemas/%s", op->body);
		doc_bool(body, "required", 1);
		doc_ref(doc_object(doc_object(body, "content"), "application/json"), "schema", pointer);
	}
	cJSON *responses = doc_object(o, "responses");
	add_success(responses, op);
	if (op->fields)
		doc_ref(responses, "304", "responses/NotModified");
	for (int i = 0; i < PROBLEM_COUNT; i++) {
		const struct problem_reply *problem = &problem_replies[i];
		char status[16], pointer[64];
		snprintf(status, sizeof status, "%d", problem->status);
		snprintf(pointer, sizeof pointer, "responses/%s", problem->name);
		if (may_fail(op, problem->status))
			doc_ref(responses, status, pointer);
	}
	if (!op->renders)
		doc_ref(responses, "default", "responses/MethodNotAllowed");
}

static void add_responses(cJSON *responses)
{
	static const char *const etag[] = { "ETag", "Cache-Control", NULL };
	cJSON *not_modified = doc_object(responses, "NotModified");
	doc_string(not_modified, "description", "What If-None-Match named is still right; nothing was rendered.");
	add_header_refs(not_modified, etag);
	for (int i = 0; i < PROBLEM_COUNT; i++) {
		const struct problem_reply *problem = &problem_replies[i];
		cJSON *response = doc_object(responses, problem->name);
		doc_string(response, "description", problem->description);
		if (problem->header)
			add_header_refs(response, (const char *const[]){ problem->header, NULL });
		doc_ref(doc_object(doc_object(response, "content"), "application/problem+json"), "schema", "schemas/Problem");
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
		"The fields of a request are the same in a query, with dotted names (sun.elevation_deg=5), and in JSON, as objects "
		"inside objects; the same values give the same bytes either way. Lists in a query are separated by commas.");
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
		add_operation(paths, &operations[i]);
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
