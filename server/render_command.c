#include "server/render.h"

#include "api/api.h"
#include "api/text.h"
#include "gpu/operator_methods.h"
#include "server/buffer.h"
#include "server/clock.h"
#include "server/domain.h"
#include "server/frames.h"
#include "server/log.h"
#include "server/product.h"
#include "server/scenes.h"
#include "server/supervisor.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/*
 * One render without a daemon, for job arrays and scripts: the same parser, renderer process and
 * encoders as behind HTTP, so the file is the same, byte for byte.
 */

enum { EXIT_DONE = 0, EXIT_FAILED = 1, EXIT_BAD_REQUEST = 2 };
enum { MAX_REQUEST_BYTES = 8 << 20, MAX_FIELD_ARGUMENTS = 256, MAX_FRAMES = 1000000 };

/* The largest image that fields allow: a person who renders to disk knows their own memory. */
static const double max_pixels = 16384.0 * 16384.0;

enum output { OUTPUT_PNG, OUTPUT_EXR, OUTPUT_JSON };

struct command {
	const char *request_path; /* NULL: none */
	bool sequence;            /* the request file is one */
	const char *out_path;
	enum output output;
	char in_folder[4096]; /* out_path where a folder was named */
	const char *device, *shader_dir, *method_dir, *scene_dir;
	char *fields[MAX_FIELD_ARGUMENTS]; /* NAME=VALUE */
	int n_fields;
};

/* ---- command line ---- */

static int complain(const char *format, ...) __attribute__((format(printf, 1, 2)));

static int complain(const char *format, ...)
{
	va_list args;
	va_start(args, format);
	fputs("welkin render: ", stderr);
	vfprintf(stderr, format, args);
	fputs("\n", stderr);
	va_end(args);
	return EXIT_BAD_REQUEST;
}

static const char *setting(const char *option, const char *variable, const char *fallback)
{
	const char *value = option ? option : getenv(variable);
	return value ? value : fallback;
}

/* Before the request is read: they bring fields of their own. */
static int read_methods(const struct command *command)
{
	struct error err;
	const char *dir = setting(command->method_dir, "WELKIN_METHOD_DIR", "");
	return operator_methods_read(dir, &err) ? EXIT_DONE : complain("%s", err.text);
}

static int help(void)
{
	const int status = read_methods(&(struct command){ 0 });
	char *fields = welkin_fields_help();
	if (status || !fields)
		return status ? status : complain("out of memory");
	printf("Usage: welkin render [REQUEST.json|-] -o OUT.png|OUT.exr|OUT.json [--device auto|software|N]\n"
	       "                     [--shader-dir DIR] [--method-dir DIR] [--scene-dir DIR] [NAME=VALUE ...]\n"
	       "       welkin render --sequence SEQUENCE.json|- -o frame_%%04d.png|frame_%%04d.exr|DIR/ [...]\n"
	       "\n"
	       "Renders one request to a file, as the daemon would. The request is a JSON object of nested fields, on\n"
	       "standard input for -; NAME=VALUE sets or overrides one field by its dotted name, and is enough "
	       "without\n"
	       "a request file. OUT.json holds radiances for a request with \"directions\" and \"wavelengths_nm\", "
	       "else\n"
	       "what a render of the image reports about itself. Faults of the request: one line each, status 2. A\n"
	       "render that fails: status 1.\n"
	       "\n"
	       "--sequence takes what POST /v1/sequences takes and writes each frame to a file of its own, whose "
	       "number\n"
	       "takes the place of %%04d (in DIR/ as frame_0000.png); NAME=VALUE sets a field of all frames.\n"
	       "\n"
	       "Environment: WELKIN_DEVICE, WELKIN_SHADER_DIR, WELKIN_METHOD_DIR, WELKIN_SCENE_DIR and "
	       "WELKIN_RENDERER, as for welkin "
	       "serve.\n"
	       "\n"
	       "Fields, with what they allow and their [default]:\n%s",
		fields);
	free(fields);
	return EXIT_DONE;
}

/* Where the number of a frame goes: the one %d or %0Nd of the pattern. */
static bool find_number(const char *pattern, int *at, int *length, int *digits)
{
	bool found = false;
	for (const char *c = strchr(pattern, '%'); c; c = strchr(c + 1, '%')) {
		int n = 1;
		*digits = 0;
		if (c[1] == '0' && isdigit((unsigned char)c[2])) {
			*digits = c[2] - '0';
			n = 3;
		}
		if (found || c[n] != 'd')
			return false;
		found = true;
		*at = (int)(c - pattern);
		*length = n + 1;
	}
	return found;
}

static bool frame_path(const char *pattern, int frame, char *path, size_t size)
{
	int at = 0, length = 0, digits = 0;
	if (!find_number(pattern, &at, &length, &digits))
		return false;
	return snprintf(path, size, "%.*s%0*d%s", at, pattern, digits, frame, pattern + at + length) < (int)size;
}

static bool read_extension(struct command *command)
{
	const char *dot = strrchr(command->out_path, '.');
	static const char *const names[] = { [OUTPUT_PNG] = ".png", [OUTPUT_EXR] = ".exr", [OUTPUT_JSON] = ".json" };
	for (int i = OUTPUT_PNG; dot && i <= OUTPUT_JSON; i++) {
		if (!strcmp(dot, names[i])) {
			command->output = (enum output)i;
			return true;
		}
	}
	return false;
}

/* --name VALUE or --name=VALUE; NULL when argv[*i] is something else. */
static const char *option_value(int argc, char **argv, int *i, const char *name, bool *missing)
{
	const size_t length = strlen(name);
	if (strncmp(argv[*i], name, length))
		return NULL;
	if (argv[*i][length] == '=')
		return argv[*i] + length + 1;
	if (argv[*i][length])
		return NULL;
	*missing = *i + 1 >= argc;
	return *missing ? "" : argv[++*i];
}

static int read_arguments(struct command *command, int argc, char **argv)
{
	for (int i = 1; i < argc; i++) {
		const char *value;
		bool missing = false;
		if ((value = option_value(argc, argv, &i, "-o", &missing)) ||
			(value = option_value(argc, argv, &i, "--out", &missing)))
			command->out_path = value;
		else if ((value = option_value(argc, argv, &i, "--device", &missing)))
			command->device = value;
		else if ((value = option_value(argc, argv, &i, "--shader-dir", &missing)))
			command->shader_dir = value;
		else if ((value = option_value(argc, argv, &i, "--method-dir", &missing)))
			command->method_dir = value;
		else if ((value = option_value(argc, argv, &i, "--scene-dir", &missing)))
			command->scene_dir = value;
		else if ((value = option_value(argc, argv, &i, "--sequence", &missing))) {
			if (command->request_path)
				return complain("two request files, %s and %s", command->request_path, value);
			command->request_path = value;
			command->sequence = true;
		} else if (argv[i][0] == '-' && argv[i][1])
			return complain("unknown option %s; see welkin render --help", argv[i]);
		else if (strchr(argv[i], '=') && command->n_fields == MAX_FIELD_ARGUMENTS)
			return complain("more than %d fields", MAX_FIELD_ARGUMENTS);
		else if (strchr(argv[i], '='))
			command->fields[command->n_fields++] = argv[i];
		else if (command->request_path)
			return complain("two request files, %s and %s", command->request_path, argv[i]);
		else
			command->request_path = argv[i];
		if (missing)
			return complain("%s needs a value", argv[i]);
	}
	if (!command->out_path)
		return complain("-o OUT.png, OUT.exr or OUT.json is missing; see welkin render --help");
	int at, length, digits;
	if (command->sequence && command->out_path[strlen(command->out_path) - 1] == '/') {
		snprintf(command->in_folder, sizeof command->in_folder, "%s", command->out_path);
		strncat(command->in_folder, "frame_%04d.png",
			sizeof command->in_folder - strlen(command->in_folder) - 1);
		command->out_path = command->in_folder;
	}
	if (!read_extension(command))
		return complain("can't tell the format of %s: it has to end in .png, .exr or .json", command->out_path);
	if (command->sequence &&
		(command->output == OUTPUT_JSON || !find_number(command->out_path, &at, &length, &digits)))
		return complain(
			"-o %s: a sequence needs a name such as frame_%%04d.png, with one number in it, or a folder/",
			command->out_path);
	if (!command->request_path && !command->n_fields)
		return complain("no request: name a file, - for standard input, or at least one NAME=VALUE");
	return EXIT_DONE;
}

/* ---- the request ---- */

/* The whole file, NUL-terminated, malloc'd; NULL with errno. */
static char *read_file(const char *path, size_t *size)
{
	FILE *file = strcmp(path, "-") ? fopen(path, "rb") : stdin;
	char *text = file ? malloc(MAX_REQUEST_BYTES + 1) : NULL;
	if (!text) {
		if (file && file != stdin)
			fclose(file);
		return NULL;
	}
	*size = fread(text, 1, MAX_REQUEST_BYTES, file);
	int failed = ferror(file) ? errno : 0;
	if (!failed && *size == MAX_REQUEST_BYTES && fgetc(file) != EOF)
		failed = EFBIG;
	if (file != stdin)
		fclose(file);
	if (failed) {
		free(text);
		errno = failed;
		return NULL;
	}
	text[*size] = 0;
	return text;
}

/* Only looks; faults are for welkin_parse_json() to find. */
static bool asks_for_radiance(const char *text)
{
	cJSON *json = cJSON_Parse(text);
	const bool asks = cJSON_GetObjectItemCaseSensitive(json, "directions") ||
			  cJSON_GetObjectItemCaseSensitive(json, "wavelengths_nm");
	cJSON_Delete(json);
	return asks;
}

/* A field of the command line replaces the file's; given twice on the command line it is a fault. */
static void parse_fields(const struct command *command, struct welkin_draft *draft, struct welkin_faults *faults)
{
	bool replaced[WELKIN_FIELDS_MAX] = { false };
	for (int i = 0; i < command->n_fields; i++) {
		char *name = command->fields[i], *value = strchr(name, '=');
		*value++ = 0;
		const int field = welkin_field_find(name);
		if (field >= 0 && !replaced[field]) {
			draft->given[field] = 0;
			replaced[field] = true;
		}
		welkin_parse_argument(draft, name, value, faults);
	}
}

static int print_faults(const struct welkin_faults *faults)
{
	for (int i = 0; i < faults->n && i < WELKIN_FAULTS_MAX; i++) {
		const struct welkin_fault *f = &faults->list[i];
		complain("%s%s%s%s%s", f->field, *f->field ? ": " : "", f->detail, *f->allowed ? "; allowed: " : "",
			f->allowed);
	}
	if (faults->n > WELKIN_FAULTS_MAX)
		complain("and %d more faults", faults->n - WELKIN_FAULTS_MAX);
	return EXIT_BAD_REQUEST;
}

/* ---- the scene ---- */

struct scene_wait {
	struct scenes_waiter waiter;
	pthread_mutex_t lock;
	pthread_cond_t told_it;
	bool told;
};

static void scene_told(struct scenes_waiter *waiter)
{
	struct scene_wait *wait = waiter->cls;
	pthread_mutex_lock(&wait->lock);
	wait->told = true;
	pthread_cond_signal(&wait->told_it);
	pthread_mutex_unlock(&wait->lock);
}

static void wait_for_scene(struct scenes *scenes, const char *name, struct scene_wait *wait)
{
	wait->waiter.done = scene_told;
	wait->waiter.cls = wait;
	if (scenes_find(scenes, name, &wait->waiter))
		return;
	pthread_mutex_lock(&wait->lock);
	while (!wait->told)
		pthread_cond_wait(&wait->told_it, &wait->lock);
	pthread_mutex_unlock(&wait->lock);
}

/* The mesh of the scene that the draft names, if it does; what is wrong with it is a fault. */
static bool read_scene(const struct command *command, const struct welkin_draft *draft, struct scene_mesh **mesh,
	struct welkin_faults *faults, struct error *err)
{
	const char *name = draft->request.scene.name;
	/* A person who renders to disk knows their own memory. */
	const struct scenes_config config = { .dir = setting(command->scene_dir, "WELKIN_SCENE_DIR", ""),
		.limits = { { .max_triangles = 100000000, .max_texture = 16384, .max_bytes = (uint64_t)32 << 30 },
			(uint64_t)32 << 30 },
		.loader_bytes = (size_t)64 << 30,
		.load_s = 3600 };
	if (faults->n || !draft->given[welkin_field_find("scene.name")] || !*name)
		return true;
	struct scenes *scenes = scenes_start(&config, err);
	struct scene_wait wait = { .lock = PTHREAD_MUTEX_INITIALIZER, .told_it = PTHREAD_COND_INITIALIZER };
	if (!scenes)
		return false;
	wait_for_scene(scenes, name, &wait);
	*mesh = wait.waiter.mesh;
	if (wait.waiter.answer == SCENES_UNKNOWN)
		welkin_fault_add(faults, 422, "scene.name", wait.waiter.fault, "there is no scene \"%s\"", name);
	else if (!*mesh)
		welkin_fault_add(faults, 422, "scene.name", "", "this scene can't be used: %s", wait.waiter.fault);
	scenes_destroy(scenes);
	return true;
}

/* photometer->directions stays NULL for an image. */
static int read_request(const struct command *command, struct welkin_request *request,
	struct welkin_photometer *photometer, struct scene_mesh **mesh)
{
	const struct welkin_limits limits = { .max_pixels = max_pixels };
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	if (command->request_path) {
		size_t size = 0;
		char *text = read_file(command->request_path, &size);
		if (!text)
			return complain("can't read %s: %s", command->request_path, strerror(errno));
		const bool radiance = command->output == OUTPUT_JSON && asks_for_radiance(text);
		welkin_parse_json(&draft, text, size, radiance ? photometer : NULL, &faults);
		free(text);
	}
	struct error err;
	parse_fields(command, &draft, &faults);
	if (!read_scene(command, &draft, mesh, &faults, &err))
		return complain("%s", err.text);
	domain_resolve(&draft, command->output == OUTPUT_EXR ? WELKIN_EXR : WELKIN_PNG, &limits,
		photometer->n_directions, *mesh, request, &faults);
	return faults.n ? print_faults(&faults) : EXIT_DONE;
}

/* NULL after complaints. */
static struct welkin_sequence *read_sequence(const struct command *command, const struct frames_limits *limits,
	struct scene_mesh **mesh, struct welkin_request *first)
{
	struct welkin_faults faults = { 0 };
	struct welkin_draft draft = { 0 };
	struct error err;
	size_t size = 0;
	char *text = read_file(command->request_path, &size);
	if (!text) {
		complain("can't read %s: %s", command->request_path, strerror(errno));
		return NULL;
	}
	struct welkin_sequence *s = welkin_sequence_parse(text, size, MAX_FRAMES, &faults);
	free(text);
	if (s)
		parse_fields(command, welkin_sequence_base(s), &faults);
	const enum welkin_format format = command->output == OUTPUT_EXR ? WELKIN_EXR : WELKIN_PNG;
	if (s)
		welkin_sequence_draft(s, 0, &draft);
	const bool found = read_scene(command, &draft, mesh, &faults, &err);
	if (found && s && !faults.n && frames_check(s, format, limits, *mesh, &faults) &&
		frames_request(s, 0, format, limits, *mesh, first, &faults))
		return s;
	if (found)
		print_faults(&faults);
	else
		complain("%s", err.text);
	welkin_sequence_free(s);
	return NULL;
}

/* ---- rendering ---- */

/* Shared with the supervisor's thread. */
struct run {
	struct supervisor *supervisor; /* NULL until supervisor_start() has returned */
	struct buffer_pool pool;
	int methods_fd; /* -1: no methods of the operator's */
	struct buffer *buffer;
	const struct scene_mesh *scene; /* NULL: none */
	struct product *product;
	pthread_mutex_t lock;
	pthread_cond_t changed;
	bool ready, done;
	char failure[256]; /* "" while all is well */
};

static void on_ready(void *cls, const struct welkin_device *device)
{
	struct run *run = cls;
	pthread_mutex_lock(&run->lock);
	snprintf(run->product->device, sizeof run->product->device, "%s", device->name);
	run->ready = true;
	pthread_cond_signal(&run->changed);
	pthread_mutex_unlock(&run->lock);
}

static void on_result(void *cls, const struct welkin_result *result)
{
	struct run *run = cls;
	pthread_mutex_lock(&run->lock);
	run->product->result = *result;
	run->product->result.message[sizeof result->message - 1] = 0;
	run->done = true;
	pthread_cond_signal(&run->changed);
	pthread_mutex_unlock(&run->lock);
}

static void on_lost(void *cls, const char *reason, bool was_ready)
{
	struct run *run = cls;
	(void)was_ready;
	pthread_mutex_lock(&run->lock);
	if (!*run->failure)
		snprintf(run->failure, sizeof run->failure, "the renderer failed: %s", reason);
	pthread_cond_signal(&run->changed);
	pthread_mutex_unlock(&run->lock);
}

static void on_tick(void *cls)
{
	(void)cls;
}

/* Waits for *flag or a failure. */
static bool wait_for(struct run *run, const bool *flag)
{
	pthread_mutex_lock(&run->lock);
	while (!*flag && !*run->failure)
		pthread_cond_wait(&run->changed, &run->lock);
	const bool well = !*run->failure;
	pthread_mutex_unlock(&run->lock);
	return well;
}

/* Until it is ready; the reason is in run->failure otherwise. */
static bool start_renderer(const struct command *command, struct run *run)
{
	const struct supervisor_config config = { .program = setting(NULL, "WELKIN_RENDERER", ""),
		.device = setting(command->device, "WELKIN_DEVICE", "auto"),
		.shader_dir = setting(command->shader_dir, "WELKIN_SHADER_DIR", ""),
		.slice_ms = 50, /* nobody else waits for the device */
		.table_mib = 256,
		.methods_fd = run->methods_fd,
		.cold = true,
		.watchdog_s = 60,
		.startup_s = 180,
		.ready = on_ready,
		.result = on_result,
		.lost = on_lost,
		.tick = on_tick,
		.cls = run };
	struct error err;
	run->supervisor = supervisor_start(&config, &err);
	if (!run->supervisor) {
		snprintf(run->failure, sizeof run->failure, "%.200s", err.text);
		return false;
	}
	return wait_for(run, &run->ready);
}

/* Fills in run->product's result; the reason is in run->failure otherwise. */
static bool render(struct run *run)
{
	const int64_t sent_us = clock_us();
	struct supervisor_scene scene = { -1, 0 };
	if (run->scene)
		scene = (struct supervisor_scene){ scene_mesh_fd(run->scene), scene_mesh_bytes(run->scene) };
	if (!supervisor_send_job(run->supervisor, &run->product->job, run->buffer->fd, run->scene ? &scene : NULL))
		on_lost(run, "it does not take the job", true);
	const bool done = wait_for(run, &run->done);
	run->product->wall_ms = fmax(clock_ms_between(sent_us, clock_us()), 0.001);
	const struct welkin_result *result = &run->product->result;
	if (done && result->status != WELKIN_DONE)
		snprintf(run->failure, sizeof run->failure, "%.255s",
			*result->message ? result->message : "the render failed");
	return !*run->failure;
}

/* ---- output ---- */

/* What an image's render says about itself, with the request. */
static bool encode_metadata(struct product *product, struct error *err)
{
	char *request = welkin_request_json(&product->job.request);
	struct text text = { 0 };
	text_puts(&text, "{\"request\":");
	text_puts(&text, request ? request : "null");
	text_puts(&text, ",");
	product_add_metadata(product, true, &text);
	text_puts(&text, "}\n");
	product->body.size = text.length;
	product->body.data = request ? (unsigned char *)text_take(&text) : NULL;
	free(request);
	return product->body.data || error_set(err, "out of memory");
}

static bool write_all(int fd, const unsigned char *data, size_t size)
{
	while (size) {
		const ssize_t n = write(fd, data, size);
		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			return false;
		data += n;
		size -= (size_t)n;
	}
	return true;
}

/* Under another name first: whoever waits for the file never sees half of it, and a failure leaves
 * the old one alone. */
static bool write_file(const char *path, const struct welkin_bytes *bytes, struct error *err)
{
	char temporary[4096];
	if (snprintf(temporary, sizeof temporary, "%s.XXXXXX", path) >= (int)sizeof temporary)
		return error_set(err, "the name of the output is too long");
	const int fd = mkstemp(temporary);
	if (fd < 0)
		return error_set(err, "can't write beside %s: %s", path, strerror(errno));
	const mode_t mask = umask(0);
	umask(mask);
	bool written = fchmod(fd, 0666 & ~mask) == 0 && write_all(fd, bytes->data, bytes->size);
	const int failed = errno;
	written = close(fd) == 0 && written;
	if (written && rename(temporary, path) == 0)
		return true;
	error_set(err, "can't write %s: %s", path, strerror(written ? errno : failed));
	unlink(temporary);
	return false;
}

static void print_timings(const char *path, const struct product *p, int64_t start_us)
{
	const struct welkin_image *image = &p->job.request.image;
	fprintf(stderr, "%s: ", path);
	if (p->job.kind == WELKIN_JOB_RADIANCE)
		fprintf(stderr, "%d directions x %d wavelengths", p->job.n_directions, p->job.n_wavelengths);
	else
		fprintf(stderr, "%d x %d", image->width, image->height);
	fprintf(stderr, ", %s on %s:", welkin_method_names[p->job.request.atmosphere.method], p->device);
	for (int i = 0; i < p->result.n_passes && i < WELKIN_MAX_PASSES; i++)
		fprintf(stderr, " %.31s %.1f ms,", p->result.passes[i].name, p->result.passes[i].ms);
	fprintf(stderr, " read-back %.1f ms, encode %.1f ms, in all %.1f ms, %zu bytes\n", p->result.readback_ms,
		p->encode_ms, clock_ms_between(start_us, clock_us()), p->body.size);
}

static bool encode(const struct command *command, struct run *run, struct error *err)
{
	const long processors = sysconf(_SC_NPROCESSORS_ONLN);
	const int threads = processors > 1 ? (int)processors : 1;
	if (command->output == OUTPUT_JSON && run->product->job.kind == WELKIN_JOB_IMAGE)
		return encode_metadata(run->product, err);
	return product_encode(run->product, run->buffer->map, threads, err);
}

/* For the renderer, which then checks the one that is asked for and no other. */
static bool bundle_methods(struct run *run, const struct welkin_request *request, struct error *err)
{
	static const struct operator_status unasked = { .state = OPERATOR_AVAILABLE };
	const int asked = operator_methods_find(request->atmosphere.method);
	if (asked < 0)
		return true;
	for (int i = 0; i < operator_methods_count(); i++)
		if (i != asked)
			operator_methods_report(i, &unasked);
	run->methods_fd = operator_methods_bundle(err);
	return run->methods_fd >= 0;
}

static bool prepare(struct run *run, const struct welkin_request *request, const struct welkin_photometer *photometer,
	struct error *err)
{
	struct product *p = run->product = calloc(1, sizeof *p);
	if (!p)
		return error_set(err, "out of memory");
	p->references = 1;
	p->job.id = 1;
	p->job.kind = photometer->directions ? WELKIN_JOB_RADIANCE : WELKIN_JOB_IMAGE;
	p->job.n_directions = photometer->n_directions;
	p->job.n_wavelengths = photometer->n_wavelengths;
	p->job.request = *request;
	if (run->scene)
		memcpy(p->job.scene_key, scene_mesh_key(run->scene), sizeof p->job.scene_key);
	run->buffer = buffer_get(&run->pool, welkin_job_bytes(&p->job), err);
	if (run->buffer && photometer->directions) {
		const struct welkin_radiance_layout l =
			welkin_radiance_layout(p->job.n_directions, p->job.n_wavelengths);
		double *values = run->buffer->map;
		memcpy(values + l.directions, photometer->directions, sizeof(double) * 3 * (size_t)p->job.n_directions);
		memcpy(values + l.wavelengths, photometer->wavelengths_nm,
			sizeof(double) * (size_t)p->job.n_wavelengths);
	}
	return run->buffer;
}

static void finish_run(struct run *run)
{
	supervisor_stop(run->supervisor);
	buffer_destroy(run->buffer);
	buffer_pool_finish(&run->pool);
	if (run->methods_fd >= 0)
		close(run->methods_fd);
	product_unref(run->product);
}

/* One frame into the buffer, which fits all of them, and from there to its file. */
static bool render_frame(const struct command *command, struct run *run, const struct welkin_sequence *s,
	const struct frames_limits *limits, int frame, struct error *err)
{
	const int64_t start_us = clock_us();
	struct welkin_faults faults = { 0 };
	struct product *p = run->product;
	char path[4096];
	if (!frame_path(command->out_path, frame, path, sizeof path))
		return error_set(err, "the name of the output is too long");
	if (!frames_request(s, frame, (enum welkin_format)p->job.request.image.format, limits, run->scene,
		    &p->job.request, &faults))
		return error_set(err, "%s: %s", faults.list[0].field, faults.list[0].detail);
	p->job.id = (uint64_t)frame + 1;
	p->job.sequence = 1;
	p->job.frame = frame;
	run->done = false;
	free(p->body.data);
	p->body = (struct welkin_bytes){ 0 };
	if (!render(run))
		return error_set(err, "frame %d: %.200s", frame, run->failure);
	if (!encode(command, run, err) || !write_file(path, &p->body, err))
		return false;
	print_timings(path, p, start_us);
	return true;
}

static int render_sequence(const struct command *command)
{
	const struct frames_limits limits = { { max_pixels }, INFINITY };
	static const struct welkin_photometer none;
	struct run run = { .lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER, .methods_fd = -1 };
	struct scene_mesh *scene = NULL;
	struct welkin_request first;
	struct error err = { "" };
	bool done = false;
	struct welkin_sequence *s = read_sequence(command, &limits, &scene, &first);
	if (!s) {
		scene_mesh_unref(scene);
		return EXIT_BAD_REQUEST;
	}
	run.scene = scene;
	buffer_pool_init(&run.pool, 0);
	if (!bundle_methods(&run, &first, &err) || !prepare(&run, &first, &none, &err)) {
		complain("%s", err.text);
	} else if (!start_renderer(command, &run)) {
		complain("%s", run.failure);
	} else {
		int frame = 0;
		while (frame < welkin_sequence_frames(s) && render_frame(command, &run, s, &limits, frame, &err))
			frame++;
		done = frame == welkin_sequence_frames(s);
		if (!done)
			complain("%s", err.text);
	}
	finish_run(&run);
	scene_mesh_unref(scene);
	welkin_sequence_free(s);
	return done ? EXIT_DONE : EXIT_FAILED;
}

static int render_to_file(const struct command *command, const struct welkin_request *request,
	const struct welkin_photometer *photometer, const struct scene_mesh *scene, int64_t start_us)
{
	struct run run = {
		.scene = scene, .lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER, .methods_fd = -1
	};
	struct error err;
	bool done = false;
	buffer_pool_init(&run.pool, 0);
	if (!bundle_methods(&run, request, &err) || !prepare(&run, request, photometer, &err))
		complain("%s", err.text);
	else if (!start_renderer(command, &run) || !render(&run))
		complain("%s", run.failure);
	else if (!encode(command, &run, &err) || !write_file(command->out_path, &run.product->body, &err))
		complain("%s", err.text);
	else
		done = true;
	if (done)
		print_timings(command->out_path, run.product, start_us);
	finish_run(&run);
	return done ? EXIT_DONE : EXIT_FAILED;
}

int welkin_render_command(int argc, char **argv)
{
	const int64_t start_us = clock_us();
	struct command command = { 0 };
	struct welkin_request request;
	struct welkin_photometer photometer = { 0 };
	struct scene_mesh *scene = NULL;
	for (int i = 1; i < argc; i++) {
		if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h"))
			return help();
	}
	int status = read_arguments(&command, argc, argv);
	if (!status)
		status = read_methods(&command);
	log_set_level("error");
	if (!status && command.sequence)
		return render_sequence(&command);
	if (!status)
		status = read_request(&command, &request, &photometer, &scene);
	if (!status)
		status = render_to_file(&command, &request, &photometer, scene, start_us);
	scene_mesh_unref(scene);
	welkin_photometer_finish(&photometer);
	return status;
}
