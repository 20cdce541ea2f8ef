#include "gpu/operator_methods.h"
#include "server/domain.h"
#include "server/http.h"
#include "server/negotiate.h"
#include "server/reply.h"
#include "server/sequence.h"
#include "server/version.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- scenes ---- */

/* The mesh of the scene that the draft names, in call->scene. False when the reply is what *result says, or comes after
 * the scene has been read: then the whole answer is made again. */
static bool find_scene(
	struct call *call, const struct welkin_draft *draft, struct welkin_faults *faults, enum MHD_Result *result)
{
	struct scenes_waiter *scene = &call->scene;
	const char *name = draft->request.scene.name;
	if (faults->n || !draft->given[welkin_field_find("scene.name")] || !*name)
		return true;
	if (!call->scene_asked && !scenes_find(call->http->scenes, name, scene)) {
		call->scene_asked = true;
		call_pause(call); /* now scene has somebody to tell */
		if (scenes_find(call->http->scenes, name, scene))
			call_unpause(call);
		*result = MHD_YES;
		return false;
	}
	switch (scene->answer) {
	case SCENES_FOUND:
		return true;
	case SCENES_UNKNOWN:
		welkin_fault_add(faults, 422, "scene.name", scene->fault, "there is no scene \"%s\"", name);
		return true;
	case SCENES_FAULTY:
		welkin_fault_add(
			faults, 422, "scene.name", "see /v1/scenes", "this scene can't be used: %s", scene->fault);
		return true;
	case SCENES_BUSY:
		break;
	}
	*result = reply_problem(call, 503, scene->fault, NULL, 5);
	return false;
}

static enum MHD_Result answer_scenes_get(struct call *call)
{
	if (!call->scene_asked) {
		call->scene_asked = true;
		call_pause(call);
		if (scenes_settle(call->http->scenes, &call->scene))
			call_unpause(call);
		return MHD_YES;
	}
	if (call->scene.answer == SCENES_BUSY)
		return reply_problem(call, 503, call->scene.fault, NULL, 5);
	return reply_json(call, 200, scenes_json(call->http->scenes, NULL));
}

static enum MHD_Result answer_scenes_post(struct call *call)
{
	struct scenes_waiter *scene = &call->scene;
	if (!call->scene_asked) {
		const size_t size = call->body.length;
		call->scene_asked = true;
		call_pause(call);
		if (scenes_upload(call->http->scenes, text_take(&call->body), size, scene))
			call_unpause(call);
		return MHD_YES;
	}
	if (scene->answer == SCENES_FOUND)
		return reply_json(call, scene->known ? 200 : 201, scenes_json(call->http->scenes, scene->name));
	if (scene->answer == SCENES_BUSY)
		return reply_problem(call, 503, scene->fault, NULL, 5);
	char detail[512];
	snprintf(detail, sizeof detail, "The scene can't be used: %s", scene->fault);
	return reply_problem(call, 422, detail, NULL, 0);
}

static enum MHD_Result answer_scenes(struct call *call)
{
	return call->verb == VERB_POST ? answer_scenes_post(call) : answer_scenes_get(call);
}

/* ---- images ---- */

static enum MHD_Result reply_faults(struct call *call, const struct welkin_faults *faults)
{
	char detail[128];
	snprintf(detail, sizeof detail, "%d field%s of the request cannot be used; see errors.", faults->n,
		faults->n > 1 ? "s" : "");
	return reply_problem(call, faults->status ? faults->status : 400, detail, faults, 0);
}

/* From a draft to call->request and its key. False when the reply (422, 400) is what *result says. */
static bool resolve(struct call *call, const struct welkin_draft *draft, enum welkin_format format, double max_pixels,
	double samples, struct welkin_faults *faults, enum MHD_Result *result)
{
	const struct welkin_limits limits = { max_pixels };
	if (!find_scene(call, draft, faults, result))
		return false;
	if (!faults->n)
		domain_resolve(draft, format, &limits, samples, call->scene.mesh, &call->request, faults);
	if (!faults->n)
		return true;
	*result = reply_faults(call, faults);
	return false;
}

bool render_key(struct service *service, const struct welkin_request *request, const struct scene_mesh *mesh,
	const struct welkin_noise_slice *noise, char key[33])
{
	char salt[384];
	const struct welkin_device device = service_device(service);
	if (request->image.embed_timing)
		return false;
	/* The file of an operator's method is as much a part of the build as a shader of ours. */
	const int entry = operator_methods_find(request->atmosphere.method);
	char slice[32] = "";
	if (noise)
		snprintf(slice, sizeof slice, "|noise %d %d", noise->table, noise->layer);
	snprintf(salt, sizeof salt, "%s|%s|%s|%s%s", build_name, device.name,
		entry >= 0 ? operator_methods_at(entry)->digest : "", mesh ? scene_mesh_key(mesh) : "", slice);
	welkin_request_key(request, salt, key);
	return true;
}

static enum MHD_Result render(struct call *call)
{
	call->keyed = render_key(call->http->service, &call->request, call->scene.mesh, call->noise, call->key);
	if (call->keyed && call->verb != VERB_POST && etag_matches(call_header(call, "If-None-Match"), call->key))
		return reply_not_modified(call);
	struct product *cached = call->keyed ? service_lookup(call->http->service, call->key) : NULL;
	if (call->verb == VERB_HEAD) {
		const enum MHD_Result result = reply_image_head(call, cached);
		product_unref(cached);
		return result;
	}
	if (!cached)
		return call_submit(call, NULL);
	call->ticket.product = cached; /* freed with the call */
	return reply_product(call, true);
}

static enum MHD_Result answer_render_get(struct call *call)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	enum MHD_Result result;
	welkin_parse_query(&draft, call->query, strlen(call->query), &faults);
	if (!resolve(call, &draft, (enum welkin_format)call->resource->argument, call->http->options->max_pixels, 0,
		    &faults, &result))
		return result;
	return render(call);
}

/* What Accept asks for: the best of PNG, EXR and multipart; PNG where all are equal. In a
 * multipart reply the image is PNG unless EXR is the better liked of the two. False: none. */
static bool negotiate_image(const char *accept, enum welkin_format *format, bool *multipart)
{
	const double png = accept_quality(accept, "image/png");
	const double exr = fmax(accept_quality(accept, "image/x-exr"), accept_quality(accept, "image/aces"));
	const double mixed = accept_quality(accept, "multipart/mixed");
	*format = exr > png ? WELKIN_EXR : WELKIN_PNG;
	*multipart = mixed > png && mixed > exr;
	return png > 0 || exr > 0 || mixed > 0;
}

static enum MHD_Result answer_render_post(struct call *call)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	enum welkin_format format;
	enum MHD_Result result;
	if (!negotiate_image(call_header(call, "Accept"), &format, &call->multipart))
		return reply_problem(
			call, 406, "This resource gives image/png, image/x-exr and multipart/mixed.", NULL, 0);
	welkin_parse_json(&draft, call->body.data ? call->body.data : "", call->body.length, NULL, &faults);
	if (!resolve(call, &draft, format, call->http->options->max_pixels, 0, &faults, &result))
		return result;
	return render(call);
}

/* ---- sequences ---- */

static enum MHD_Result answer_sequences(struct call *call)
{
	const struct options *o = call->http->options;
	const struct frames_limits limits = { { o->max_pixels }, o->max_sequence_pixels };
	const char *accept = call_header(call, "Accept");
	struct welkin_faults faults = { 0 };
	enum welkin_format format;
	bool multipart;
	negotiate_image(accept, &format, &multipart);
	if (accept_quality(accept, "multipart/mixed") <= 0)
		return reply_problem(call, 406, "This resource gives multipart/mixed.", NULL, 0);
	struct welkin_sequence *frames = welkin_sequence_parse(
		call->body.data ? call->body.data : "", call->body.length, o->max_frames, &faults);
	struct welkin_draft first = { 0 };
	enum MHD_Result result;
	if (frames)
		welkin_sequence_draft(frames, 0, &first);
	if (!find_scene(call, &first, &faults, &result)) {
		welkin_sequence_free(frames);
		return result;
	}
	if (frames && !faults.n && frames_check(frames, format, &limits, call->scene.mesh, &faults))
		return sequence_begin(call, frames, format, &limits);
	welkin_sequence_free(frames);
	return reply_faults(call, &faults);
}

/* ---- noise ---- */

static enum MHD_Result answer_noise(struct call *call)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	enum MHD_Result result;
	call->slice = (struct welkin_noise_slice){ .table = call->resource->argument };
	call->noise = &call->slice;
	welkin_parse_noise(&draft, &call->slice, call->query, strlen(call->query), &faults);
	/* No sky is rendered: the pixel budget does not apply to an image's default size. */
	if (!resolve(call, &draft, WELKIN_PNG, INFINITY, 0, &faults, &result))
		return result;
	struct welkin_image *image = &call->request.image;
	image->width = image->height = welkin_noise_infos[call->slice.table].side;
	image->png_bits = 8;
	return render(call);
}

/* ---- numbers ---- */

static enum MHD_Result answer_radiance(struct call *call)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	struct welkin_photometer photometer = { 0 };
	enum MHD_Result result;
	if (accept_quality(call_header(call, "Accept"), "application/json") <= 0)
		return reply_problem(call, 406, "This resource gives application/json.", NULL, 0);
	welkin_parse_json(&draft, call->body.data ? call->body.data : "", call->body.length, &photometer, &faults);
	/* No image is made, so the pixel budget does not apply to its (default) size. */
	if (resolve(call, &draft, WELKIN_EXR, INFINITY, photometer.n_directions, &faults, &result))
		result = call_submit(call, &photometer);
	welkin_photometer_finish(&photometer);
	return result;
}

/* ---- documents ---- */

static enum MHD_Result answer_document(struct call *call)
{
	return reply_document(call, documents_made(call->http->documents, call->resource->argument));
}

static enum MHD_Result answer_page(struct call *call)
{
	return reply_document(call, documents_of_file(call->http->documents, call->file));
}

static enum MHD_Result answer_version(struct call *call)
{
	const struct welkin_device device = service_device(call->http->service);
	const struct options *o = call->http->options;
	struct text text = { 0 };
	text_puts(&text, "{\"name\":\"welkin\",\"version\":");
	text_json_string(&text, build_version);
	text_puts(&text, ",\"revision\":");
	text_json_string(&text, build_revision);
	text_puts(&text, ",\"device\":");
	text_json_string(&text, device.name);
	text_puts(&text, ",\"gl\":{\"vendor\":");
	text_json_string(&text, device.vendor);
	text_puts(&text, ",\"renderer\":");
	text_json_string(&text, device.name);
	text_puts(&text, ",\"version\":");
	text_json_string(&text, device.version);
	text_printf(&text, ",\"software\":%s,\"index\":%d}", device.software ? "true" : "false", device.index);
	text_printf(&text,
		",\"limits\":{\"max_pixels\":%.0f,\"deadline_s\":%g,\"max_body_kib\":%d,\"queue\":%d,"
		"\"max_frames\":%d,\"max_sequence_pixels\":%.0f,\"max_sequences\":%d}}\n",
		o->max_pixels, o->deadline_s, o->max_body_kib, o->queue, o->max_frames, o->max_sequence_pixels,
		o->max_sequences);
	return reply_json(call, 200, text_take(&text));
}

/* Browsers ask for it whatever the page says; no icon is no error. */
static enum MHD_Result answer_favicon(struct call *call)
{
	static const char icon[] =
		"<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 16 16\"><defs><linearGradient id=\"s\" "
		"x2=\"0\" y2=\"1\"><stop stop-color=\"#1c4f9c\"/><stop offset=\"1\" stop-color=\"#cfe4f5\"/>"
		"</linearGradient></defs><rect width=\"16\" height=\"16\" rx=\"3\" fill=\"url(#s)\"/>"
		"<circle cx=\"11\" cy=\"6\" r=\"2.5\" fill=\"#fff3c4\"/></svg>";
	static const struct document document = {
		.type = "image/svg+xml", .data = icon, .size = sizeof icon - 1, .tag = "favicon-1"
	};
	return reply_document(call, &document);
}

#define READ (VERB_GET | VERB_HEAD | VERB_OPTIONS)
#define POST (VERB_POST | VERB_OPTIONS)

static const char *const archives[] = { "application/zip", "application/x-zip-compressed", "application/x-tar",
	"application/gzip", "application/x-gzip", "application/octet-stream", NULL };

const struct resource resources[] = {
	{ "/v1/render.png", READ, RESOURCE_RENDER_PNG, answer_render_get, WELKIN_PNG },
	{ "/v1/render.exr", READ, RESOURCE_RENDER_EXR, answer_render_get, WELKIN_EXR },
	{ "/v1/render", POST, RESOURCE_RENDER_POST, answer_render_post, 0 },
	{ "/v1/sequences", POST, RESOURCE_SEQUENCES, answer_sequences, 0 },
	{ "/v1/radiance", POST, RESOURCE_RADIANCE, answer_radiance, 0 },
	{ "/v1/noise/base.png", READ, RESOURCE_NOISE, answer_noise, WELKIN_NOISE_BASE },
	{ "/v1/noise/detail.png", READ, RESOURCE_NOISE, answer_noise, WELKIN_NOISE_DETAIL },
	{ "/v1/noise/curl.png", READ, RESOURCE_NOISE, answer_noise, WELKIN_NOISE_CURL },
	{ "/v1/noise/weather.png", READ, RESOURCE_NOISE, answer_noise, WELKIN_NOISE_WEATHER },
	{ "/v1/methods", READ, RESOURCE_METHODS, answer_document, DOCUMENT_METHODS },
	{ "/v1/presets", READ, RESOURCE_PRESETS, answer_document, DOCUMENT_PRESETS },
	{ "/v1/scenes", READ | VERB_POST, RESOURCE_SCENES, answer_scenes, 0, archives },
	{ "/openapi.json", READ, RESOURCE_OPENAPI, answer_document, DOCUMENT_OPENAPI },
	{ "/version", READ, RESOURCE_VERSION, answer_version, 0 },
	{ "/favicon.ico", READ, RESOURCE_OTHER, answer_favicon, 0 },
	{ "/", READ, RESOURCE_PAGE, answer_page, 0 }, /* and every other embedded file */
	{ NULL, 0, 0, NULL, 0 },
};
