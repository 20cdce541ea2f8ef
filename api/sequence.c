#include "api/json_scan.h"
#include "api/parse_json.h"
#include "api/value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/*
 * Frames over time. A list of frames is kept as what each differs in; keyframes as one track per field that any of
 * them gives, from which a frame is made when it is wanted.
 */

enum interpolation { LINEAR, SMOOTH };

static const char *const interpolations[] = { "linear", "smooth", NULL };
static const double max_duration_s = 1e6, max_fps = 1000;

struct welkin_sequence {
	struct welkin_draft base;
	int n_frames;
	bool keyed;                 /* steps are keyframes; else they are the frames */
	struct welkin_draft *steps; /* what is given there */
	int n_steps;
	double *at_s; /* of each keyframe, rising */
	double fps;
	int interpolation;
};

/* ---- reading ---- */

enum member { FRAMES, KEYFRAMES, DURATION, FPS, INTERPOLATION, MEMBERS };

static const char *const members[MEMBERS] = { "frames", "keyframes", "duration_s", "fps", "interpolation" };

/* Takes the members that are the sequence's own out of the tree, so that fields remain. */
static void detach_members(cJSON *tree, cJSON *found[MEMBERS], struct welkin_faults *faults)
{
	cJSON *next;
	for (cJSON *json = tree->child; json; json = next) {
		next = json->next;
		int m = 0;
		while (m < MEMBERS && strcmp(members[m], json->string) != 0)
			m++;
		if (m == MEMBERS)
			continue;
		cJSON_DetachItemViaPointer(tree, json);
		if (found[m]) {
			welkin_fault_add(faults, 400, members[m], "", "is given more than once");
			cJSON_Delete(json);
		} else {
			found[m] = json;
		}
	}
}

void welkin_sequence_faults(
	const char *list, int index, const struct welkin_faults *of_frame, struct welkin_faults *faults)
{
	for (int i = 0; i < of_frame->n && i < WELKIN_FAULTS_MAX; i++) {
		const struct welkin_fault *f = &of_frame->list[i];
		char name[160];
		snprintf(name, sizeof name, "%s[%d]%s%s", list, index, *f->field ? "." : "", f->field);
		welkin_fault_add(faults, of_frame->status, name, f->allowed, "%s", f->detail);
	}
	if (of_frame->n > WELKIN_FAULTS_MAX)
		faults->n += of_frame->n - WELKIN_FAULTS_MAX;
}

/* In [min, max], or a fault. */
static bool read_number(
	const cJSON *json, const char *name, double min, double max, double *out, struct welkin_faults *faults)
{
	char allowed[64];
	snprintf(allowed, sizeof allowed, "%.9g to %.9g", min, max);
	if (!cJSON_IsNumber(json)) {
		welkin_fault_add(faults, 400, name, allowed, "is not a number");
		return false;
	}
	*out = json->valuedouble;
	if (*out >= min && *out <= max)
		return true;
	welkin_fault_add(faults, 422, name, allowed, "%.10g is outside the allowed range", *out);
	return false;
}

/* at_s of a keyframe, taken out of it. */
static void read_moment(struct welkin_sequence *s, cJSON *step, int i, struct welkin_faults *faults)
{
	cJSON *at = cJSON_DetachItemFromObjectCaseSensitive(step, "at_s");
	if (!at)
		welkin_fault_add(faults, 422, "at_s", "", "is missing");
	else if (read_number(at, "at_s", 0, max_duration_s, &s->at_s[i], faults) && i && s->at_s[i] <= s->at_s[i - 1])
		welkin_fault_add(faults, 422, "at_s", "", "%.10g does not come after the keyframe before", s->at_s[i]);
	cJSON_Delete(at);
}

/* One picture's size and format hold for a film. */
static void refuse_image_fields(const struct welkin_draft *step, struct welkin_faults *faults)
{
	for (int f = 0; f < welkin_field_count; f++)
		if (step->given[f] && !strncmp(welkin_fields[f].name, "image.", 6))
			welkin_fault_add(faults, 422, welkin_fields[f].name, "beside frames",
				"is the same for all frames of a sequence");
}

static void read_steps(
	struct welkin_sequence *s, const cJSON *list, const char *name, int max, struct welkin_faults *faults)
{
	char allowed[64];
	snprintf(allowed, sizeof allowed, "a list of 1 to %d", max);
	if (!cJSON_IsArray(list)) {
		welkin_fault_add(faults, 400, name, allowed, "is not a list");
		return;
	}
	const int n = cJSON_GetArraySize(list);
	if (n < 1 || n > max) {
		welkin_fault_add(faults, 422, name, allowed, "has %d items", n);
		return;
	}
	s->steps = calloc((size_t)n, sizeof *s->steps);
	s->at_s = calloc((size_t)n, sizeof *s->at_s);
	if (!s->steps || !s->at_s) {
		welkin_fault_add(faults, 503, name, "", "out of memory");
		return;
	}
	s->n_steps = n;
	cJSON *step = list->child;
	for (int i = 0; i < n && faults->n < WELKIN_FAULTS_MAX; i++, step = step->next) {
		struct welkin_faults own = { 0 };
		if (!cJSON_IsObject(step)) {
			welkin_fault_add(&own, 400, "", "", "is not an object of fields");
		} else {
			if (s->keyed)
				read_moment(s, step, i, &own);
			json_read_fields(&s->steps[i], step, &own);
			refuse_image_fields(&s->steps[i], &own);
		}
		welkin_sequence_faults(name, i, &own, faults);
	}
}

static void read_interpolation(struct welkin_sequence *s, const cJSON *json, struct welkin_faults *faults)
{
	const char *name = cJSON_IsString(json) ? json->valuestring : NULL;
	if (!name) {
		welkin_fault_add(faults, 400, members[INTERPOLATION], "linear or smooth", "is not a name");
		return;
	}
	while (interpolations[s->interpolation] && strcmp(interpolations[s->interpolation], name) != 0)
		s->interpolation++;
	if (interpolations[s->interpolation])
		return;
	s->interpolation = LINEAR;
	welkin_fault_add(faults, 422, members[INTERPOLATION], "linear or smooth", "there is no \"%.40s\"", name);
}

static void read_keyframes(
	struct welkin_sequence *s, cJSON *const found[MEMBERS], int max_frames, struct welkin_faults *faults)
{
	read_steps(s, found[KEYFRAMES], members[KEYFRAMES], WELKIN_KEYFRAMES_MAX, faults);
	double duration_s = s->n_steps ? s->at_s[s->n_steps - 1] : 0;
	s->fps = 24;
	if (found[FPS])
		read_number(found[FPS], members[FPS], 0.001, max_fps, &s->fps, faults);
	if (found[DURATION])
		read_number(found[DURATION], members[DURATION], 0, max_duration_s, &duration_s, faults);
	if (found[INTERPOLATION])
		read_interpolation(s, found[INTERPOLATION], faults);
	if (faults->n)
		return;
	/* The last frame ends where the sequence does, so that it can be played over and over. */
	const double n = fmax(1, round(duration_s * s->fps));
	if (n <= max_frames) {
		s->n_frames = (int)n;
		return;
	}
	char allowed[64];
	snprintf(allowed, sizeof allowed, "at most %d frames", max_frames);
	welkin_fault_add(faults, 422, members[DURATION], allowed, "%.9g s at %.9g frames a second are %.0f frames",
		duration_s, s->fps, n);
}

static void read_frames(
	struct welkin_sequence *s, cJSON *const found[MEMBERS], int max_frames, struct welkin_faults *faults)
{
	if (!found[FRAMES]) {
		welkin_fault_add(faults, 422, members[FRAMES], "", "neither frames nor keyframes are given");
		return;
	}
	for (int m = KEYFRAMES; m < MEMBERS; m++)
		if (found[m])
			welkin_fault_add(faults, 422, members[m], "with keyframes only", "is given beside frames");
	read_steps(s, found[FRAMES], members[FRAMES], max_frames, faults);
	s->n_frames = s->n_steps;
}

struct welkin_sequence *welkin_sequence_parse(
	const char *text, size_t length, int max_frames, struct welkin_faults *faults)
{
	char reason[160];
	cJSON *found[MEMBERS] = { 0 };
	cJSON *tree = json_read(text, length, reason);
	struct welkin_sequence *s = tree ? calloc(1, sizeof *s) : NULL;
	if (!tree) {
		welkin_fault_add(faults, 400, "", "", "%s", reason);
	} else if (!cJSON_IsObject(tree)) {
		welkin_fault_add(faults, 400, "", "", "the body is not a JSON object");
	} else if (!s) {
		welkin_fault_add(faults, 503, "", "", "out of memory");
	} else {
		detach_members(tree, found, faults);
		json_read_fields(&s->base, tree, faults);
		s->keyed = found[KEYFRAMES] && !found[FRAMES];
		if (s->keyed)
			read_keyframes(s, found, max_frames, faults);
		else
			read_frames(s, found, max_frames, faults);
	}
	for (int m = 0; m < MEMBERS; m++)
		cJSON_Delete(found[m]);
	cJSON_Delete(tree);
	if (!faults->n)
		return s;
	welkin_sequence_free(s);
	return NULL;
}

void welkin_sequence_free(struct welkin_sequence *s)
{
	if (!s)
		return;
	free(s->steps);
	free(s->at_s);
	free(s);
}

struct welkin_draft *welkin_sequence_base(struct welkin_sequence *s)
{
	return &s->base;
}

int welkin_sequence_frames(const struct welkin_sequence *s)
{
	return s->n_frames;
}

/* ---- between keyframes ---- */

/* The keyframes around a moment that give a field, and one more on either side for slopes; -1: none. */
struct around {
	int k[4]; /* before, from, to, after */
};

static int giving(const struct welkin_sequence *s, int field, int k, int step)
{
	while (k >= 0 && k < s->n_steps && !s->steps[k].given[field])
		k += step;
	return k >= 0 && k < s->n_steps ? k : -1;
}

/* current: the last keyframe at or before the moment, -1: none. */
static struct around find_around(const struct welkin_sequence *s, int field, int current)
{
	struct around a;
	a.k[1] = giving(s, field, current, -1);
	a.k[2] = giving(s, field, current + 1, 1);
	a.k[0] = a.k[1] < 0 ? -1 : giving(s, field, a.k[1] - 1, -1);
	a.k[3] = a.k[2] < 0 ? -1 : giving(s, field, a.k[2] + 1, 1);
	return a;
}

/* A direction, of which a full turn is allowed: 350° and 10° are 20° apart. */
static bool turns(const struct welkin_field *field)
{
	return !strcmp(field->unit, "deg") && field->max - field->min >= 360;
}

static bool is_number(const struct welkin_field *field)
{
	return field->type == WELKIN_TYPE_DOUBLE || field->type == WELKIN_TYPE_VEC3 ||
	       field->type == WELKIN_TYPE_TRIPLE || field->type == WELKIN_TYPE_TIME ||
	       (field->type == WELKIN_TYPE_INT && !field->names);
}

static int read_values(const struct welkin_field *field, const struct welkin_request *request, double out[3])
{
	const char *at = (const char *)request + field->offset;
	int n = 1;
	if (field->type == WELKIN_TYPE_TIME)
		out[0] = (double)*(const int64_t *)(const void *)at;
	else if (field->type == WELKIN_TYPE_INT)
		out[0] = *(const int32_t *)(const void *)at;
	else
		memcpy(out, value_numbers(field, (struct welkin_request *)request, &n), sizeof(double) * (size_t)n);
	return n;
}

static void write_values(const struct welkin_field *field, struct welkin_request *request, const double in[3])
{
	char *at = (char *)request + field->offset;
	int n;
	if (field->type == WELKIN_TYPE_TIME)
		*(int64_t *)(void *)at = (int64_t)llround(in[0]);
	else if (field->type == WELKIN_TYPE_INT)
		*(int32_t *)(void *)at = (int32_t)lround(in[0]);
	else {
		double *to = value_numbers(field, request, &n);
		for (int i = 0; i < n; i++)
			to[i] = fmin(fmax(in[i], field->min), field->max);
	}
}

/* Slope at a keyframe between two secants: Fritsch and Butland's harmonic mean (SIAM J. Sci. Stat. Comput. 5, 1984),
 * which never leaves the range of its neighbours, so what is allowed at keyframes is allowed between. */
static double slope(double before, double h_before, double after, double h_after)
{
	if (before * after <= 0)
		return 0;
	const double a = 2 * h_after + h_before, b = h_after + 2 * h_before;
	return (a + b) / (a / before + b / after);
}

/* v and t of the four keyframes; those on the outside may be missing. */
static double between(const double v[4], const double t[4], const struct around *a, double at, int interpolation)
{
	const double h = t[2] - t[1], u = (at - t[1]) / h, secant = (v[2] - v[1]) / h;
	if (interpolation == LINEAR)
		return v[1] + (v[2] - v[1]) * u;
	const double from = a->k[0] < 0 ? secant : slope((v[1] - v[0]) / (t[1] - t[0]), t[1] - t[0], secant, h);
	const double to = a->k[3] < 0 ? secant : slope(secant, h, (v[3] - v[2]) / (t[3] - t[2]), t[3] - t[2]);
	const double c2 = 3 * secant - 2 * from - to, c3 = from + to - 2 * secant;
	return v[1] + h * u * (from + u * (c2 + u * c3));
}

/* Each angle by at most half a turn from the one before. */
static void unwind(double v[4], const struct around *a)
{
	for (int i = 1; i < 4; i++)
		if (a->k[i] >= 0 && a->k[i - 1] >= 0)
			v[i] = v[i - 1] + remainder(v[i] - v[i - 1], 360);
}

static void interpolate(
	const struct welkin_sequence *s, int index, const struct around *a, double at, struct welkin_request *out)
{
	const struct welkin_field *field = &welkin_fields[index];
	double values[4][3] = { { 0 } }, t[4] = { 0 }, result[3] = { 0 };
	int n = 1;
	for (int i = 0; i < 4; i++) {
		if (a->k[i] < 0)
			continue;
		n = read_values(field, &s->steps[a->k[i]].request, values[i]);
		t[i] = s->at_s[a->k[i]];
	}
	for (int c = 0; c < n; c++) {
		double v[4] = { values[0][c], values[1][c], values[2][c], values[3][c] };
		if (turns(field))
			unwind(v, a);
		result[c] = between(v, t, a, at, s->interpolation);
		if (turns(field) && (result[c] < field->min || result[c] > field->max))
			result[c] = remainder(result[c], 360);
	}
	write_values(field, out, result);
}

static void apply_keyframes(const struct welkin_sequence *s, double at, struct welkin_draft *draft)
{
	int current = -1;
	while (current + 1 < s->n_steps && s->at_s[current + 1] <= at)
		current++;
	for (int f = 0; f < welkin_field_count; f++) {
		const struct around a = find_around(s, f, current);
		if (a.k[1] < 0 && a.k[2] < 0)
			continue;
		draft->given[f] = 1;
		if (a.k[1] >= 0 && a.k[2] >= 0 && is_number(&welkin_fields[f]))
			interpolate(s, f, &a, at, &draft->request);
		else /* outside, and for what has no between, the nearest holds */
			value_copy(
				&welkin_fields[f], &draft->request, &s->steps[a.k[1] >= 0 ? a.k[1] : a.k[2]].request);
	}
}

void welkin_sequence_draft(const struct welkin_sequence *s, int frame, struct welkin_draft *draft)
{
	*draft = s->base;
	if (s->keyed) {
		apply_keyframes(s, frame / s->fps, draft);
		return;
	}
	const struct welkin_draft *step = &s->steps[frame];
	for (int f = 0; f < welkin_field_count; f++)
		if (step->given[f]) {
			draft->given[f] = 1;
			value_copy(&welkin_fields[f], &draft->request, &step->request);
		}
}
