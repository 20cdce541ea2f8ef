#ifndef WELKIN_API_API_H
#define WELKIN_API_API_H

#include "api/error.h"
#include "api/request.h"

#include <stdatomic.h>
#include <stddef.h>

/*
 * What a client may ask for: from text (query, JSON) to a resolved request or a list of faults,
 * and back to text (OpenAPI, metadata, problem documents). Pure functions: no state, no I/O,
 * safe from any thread. Strings returned as char * are malloc'd and the caller's; NULL means out
 * of memory.
 */

/* ---- fields.c: the one table of request fields ---- */

enum welkin_type {
	WELKIN_TYPE_DOUBLE,
	WELKIN_TYPE_INT,
	WELKIN_TYPE_BOOL,   /* int32_t; true false 1 0 */
	WELKIN_TYPE_ENUM,   /* int32_t index into names */
	WELKIN_TYPE_FLAGS,  /* uint32_t bits; comma-separated names or a JSON array of names */
	WELKIN_TYPE_VEC3,   /* double[3]; "x,y,z" or a JSON array of three */
	WELKIN_TYPE_TRIPLE, /* double[3]; like VEC3, or one number for all three */
	WELKIN_TYPE_TIME,   /* int64_t ms; RFC 3339 */
	WELKIN_TYPE_SEED,   /* uint32_t */
	WELKIN_TYPE_NAME,   /* char[WELKIN_NAME_SIZE], zeros behind its end; a name that only the server can know, or ""
			     */
};

/* What a NAME may look like; it is fit for a folder's name, a URL and a log line. */
#define WELKIN_NAME_PATTERN "^([A-Za-z0-9][A-Za-z0-9._-]*)?$"
/* Whether it is one and fits into WELKIN_NAME_SIZE; "" is. */
bool welkin_name_valid(const char *name);

struct welkin_field {
	const char *name; /* dotted: "sun.elevation_deg" */
	enum welkin_type type;
	const char *unit;         /* "" where there is none */
	double min, max;          /* inclusive; of every component; ignored for ENUM, FLAGS, BOOL, TIME, NAME */
	const char *default_text; /* as it would be written in a query; "" where it depends, see help */
	const char *help;         /* one or two sentences */
	const char *const *names; /* ENUM, FLAGS, and INT where only some values are allowed: NULL-terminated */
	size_t offset;            /* into struct welkin_request */
	int of_method;            /* 1 + index of the method whose parameter it is; 0: a field of every request */
};

/* Those of the table, then the parameters of the operator's methods ("method.NAME.PARAMETER"), which
 * gpu/operator_methods.h adds once, before a process starts threads. */
extern const struct welkin_field *welkin_fields;
extern int welkin_field_count;
enum { WELKIN_FIELDS_MAX = 256 };

/* Adds a field behind the others; what it points to must live on. false: there is no room. */
bool welkin_field_add(const struct welkin_field *field);
/* Takes the added ones away again. */
void welkin_fields_reset(void);

/* Index of the field of that exact name, or -1. */
int welkin_field_find(const char *name);

/* The method names: generated from gpu/methods/, sorted, then the operator's (in the places that
 * gpu/operator_methods.h gives them), then "auto", NULL-terminated, so the API needs no renderer. */
enum { WELKIN_METHODS_MAX = 64 };
extern const char *welkin_method_names[WELKIN_METHODS_MAX + 1];
/* Not 0: the method cannot be used, so the OpenAPI document (and with it the page) leaves it out. */
extern atomic_uchar welkin_method_hidden[WELKIN_METHODS_MAX];
/* Does it change nothing of this request: a parameter of another method, or of the scene where there is none? Such a
 * field has its default. */
bool welkin_field_idle(const struct welkin_field *field, const struct welkin_request *request);

/* ---- faults ---- */

/* One thing wrong with a request. */
struct welkin_fault {
	char field[64];    /* dotted name; "" for the whole body */
	char detail[200];  /* what is wrong, one sentence */
	char allowed[200]; /* the allowed range or values; "" where there is none */
};

enum { WELKIN_FAULTS_MAX = 64 };

struct welkin_faults {
	int n;      /* found, may exceed what is kept */
	int status; /* HTTP status: 400 malformed (not even of the field's type, or given twice), 422 out of range,
		     * unknown or contradictory; the lower number wins. 503: out of memory */
	struct welkin_fault list[WELKIN_FAULTS_MAX];
};

__attribute__((format(printf, 5, 6))) void welkin_fault_add(
	struct welkin_faults *faults, int status, const char *field, const char *allowed, const char *detail, ...);

/* ---- parsing: collects all faults, does not stop at the first ---- */

/* What a client gave, before defaults: values and which fields were given. Zero it first. */
struct welkin_draft {
	struct welkin_request request;
	uint8_t given[WELKIN_FIELDS_MAX];
};

/* One query argument, already percent-decoded; value NULL where there was no '='. Repeated or
 * unknown names are faults. */
void welkin_parse_argument(
	struct welkin_draft *draft, const char *name, const char *value, struct welkin_faults *faults);

/* A raw query string ("a=1&b=2", without '?'): splits, percent-decodes ('+' is a space), checks
 * UTF-8 and hands each argument to welkin_parse_argument. At most 256 arguments. */
void welkin_parse_query(struct welkin_draft *draft, const char *query, size_t length, struct welkin_faults *faults);

/* ---- noise.c: what /v1/noise takes ---- */

struct welkin_noise_info {
	const char *name, *channels; /* channels: what they hold */
	int side, layers;            /* texels; layers 1: a map */
	bool alpha;                  /* the fourth channel says something too */
};
/* By enum welkin_noise_table. */
extern const struct welkin_noise_info welkin_noise_infos[WELKIN_NOISE_TABLES];

/* Does a field change the tables of noise? Others are faults there. */
bool welkin_noise_field(const struct welkin_field *field);

/* A raw query like welkin_parse_query's, of those fields and of slice, a whole number from 0, which goes to
 * slice->layer. slice->table says of what. */
void welkin_parse_noise(struct welkin_draft *draft, struct welkin_noise_slice *slice, const char *query, size_t length,
	struct welkin_faults *faults);

/* The extra members of a /v1/radiance body. Unit vectors in the world frame. */
struct welkin_photometer {
	int n_directions, n_wavelengths;
	double *directions; /* 3 × n_directions, malloc'd; NULL where the body had none */
	double *wavelengths_nm;
};
void welkin_photometer_finish(struct welkin_photometer *photometer);

/* A JSON object of nested fields. photometer NULL: an image request, where "directions" and
 * "wavelengths_nm" are unknown fields. Not NULL: both are needed (1…16384 directions as
 * {"elevation_deg": e, "azimuth_deg": a} or {"zenith_deg": z, "azimuth_deg": a} or
 * {"vector": [x, y, z]}; 1…64 wavelengths of 360…830 nm). Faults: malformed text (400), depth
 * over 32, invalid UTF-8, a BOM, trailing garbage, duplicate or unknown keys, \u0000, numbers
 * that are not finite or not JSON (007), wrong types. */
void welkin_parse_json(struct welkin_draft *draft, const char *text, size_t length,
	struct welkin_photometer *photometer, struct welkin_faults *faults);

/* ---- sequence.c: many frames from one request ---- */

/* The fields of a request, which every frame begins with, and what differs from frame to frame: either a list "frames"
 * of objects of fields; or "keyframes", each an object of fields with "at_s", between which numbers go by
 * "interpolation" (linear or smooth) over "duration_s" (default: to the last keyframe) at "fps" (default 24). Times go
 * like numbers, full circles the shorter way round, all else holds until the next keyframe that gives it. Fields of
 * the image are the same for all frames. */
struct welkin_sequence;

enum { WELKIN_KEYFRAMES_MAX = 256 };

/* NULL after faults; those of a frame are named like "frames[3].sun.elevation_deg". At most max_frames frames. */
struct welkin_sequence *welkin_sequence_parse(
	const char *text, size_t length, int max_frames, struct welkin_faults *faults);
void welkin_sequence_free(struct welkin_sequence *sequence); /* NULL is fine */
/* What every frame begins with, for the caller to change. */
struct welkin_draft *welkin_sequence_base(struct welkin_sequence *sequence);
int welkin_sequence_frames(const struct welkin_sequence *sequence);
/* One frame, 0 to frames - 1, ready to be resolved. */
void welkin_sequence_draft(const struct welkin_sequence *sequence, int frame, struct welkin_draft *draft);
/* Adds faults that were found in one frame, or keyframe, to those of the sequence. */
void welkin_sequence_faults(
	const char *list, int index, const struct welkin_faults *of_frame, struct welkin_faults *faults);

/* ---- resolving ---- */

/* What the daemon's operator allows. */
struct welkin_limits {
	double max_pixels; /* width × height */
};

/* Fills in every default, the preset's coefficients, the sun from time and place (when not
 * given), the heading towards the sun (when not given), sizes by projection, position from
 * altitude or the other way round, and checks what spans fields: pixel budget, position_m and altitude_m both given,
 * (with a scene, heights above its surface are for server/scenes.h to fill in, which knows it: until then the ground
 * counts as flat),
 * camera below the ground, top below the camera's ground, cubemap 4:3, layers without EXR (only if
 * format is PNG and layers were given), g and others. Enum welkin_format goes in by format. Values that are not used by
 * the request stay as they are. After it, `out` is canonical: equal requests are equal bytes (-0 is 0, headings and
 * azimuths in [0, 360)). Does nothing more when faults->n > 0 on entry. */
void welkin_resolve(const struct welkin_draft *draft, enum welkin_format format, const struct welkin_limits *limits,
	struct welkin_request *out, struct welkin_faults *faults);

/* Position of the sun's centre, geometric (no refraction), topocentric to 0.003°; libnova. time_ms UTC since 1970. */
void welkin_sun_position(
	int64_t time_ms, double latitude_deg, double longitude_deg, double *elevation_deg, double *azimuth_deg);

/* Parses RFC 3339 (with offset, fractions to the millisecond, leap second 60 taken as 59.999). */
bool welkin_parse_time(const char *text, int64_t *time_ms);
/* Writes "2026-06-21T00:00:00Z" (with .mmm when needed) into text[32]. */
void welkin_format_time(int64_t time_ms, char text[32]);

/* ---- text out ---- */

/* Height above the planet's sphere of that radius of a point in the world frame, in a way that keeps its digits. */
double welkin_altitude_of(const double position[3], double radius);
/* Moves a point up or down (y), x and z as they are, until it has that altitude. false: no point there has. */
bool welkin_set_altitude(double position[3], double radius, double altitude);

/* Canonical JSON of a resolved request, every field in table order, nested, shortest numbers that
 * round-trip: goes into files and metadata. */
char *welkin_request_json(const struct welkin_request *request);

/* The same as a URL query of the fields that differ from the defaults. */
char *welkin_request_query(const struct welkin_request *request);

/* FNV-1a or better, 128 bits as 32 hex digits + NUL, of the request's canonical bytes and a salt
 * (build, device). */
void welkin_request_key(const struct welkin_request *request, const char *salt, char key[33]);

/* RFC 9457 document. faults may be NULL. `instance` is the request's path. */
char *welkin_problem_json(int status, const char *type, const char *title, const char *detail, const char *instance,
	const struct welkin_faults *faults);

/* OpenAPI 3.1 of all the resources, generated from the table. */
char *welkin_openapi_json(const char *version);

/* /v1/presets: every preset with the fields it sets. */
char *welkin_presets_json(void);

/* The --help text of the fields, one a line, for `welkin render --help`. */
char *welkin_fields_help(void);

#endif
