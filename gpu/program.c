#include "gpu/program.h"

#include "api/embed.h"
#include "shaders/shared.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
	PROGRAMS_MAX = 512,
	PROGRAMS_MANY = 160,
	ADDED_MAX = 64,
	FILES_MAX = 48,
	DEPTH_MAX = 8,
	STRETCHES_MAX = 2 * FILES_MAX + 64
};

const struct fetched program_fetched[PROGRAM_FETCHED] = {
	{ "direction_texels", BIND_DIRECTIONS, UNIT_DIRECTIONS, GL_RGBA32F },
	{ "surface_texels", BIND_SURFACES, UNIT_SURFACES, GL_RGBA32UI },
	{ "node_texels", BIND_BVH, UNIT_BVH, GL_RGBA32UI },
	{ "triangle_texels", BIND_TRIANGLES, UNIT_TRIANGLES, GL_RGBA32UI },
	{ "vertex_texels", BIND_VERTICES, UNIT_VERTICES, GL_RGBA32UI },
	{ "material_texels", BIND_MATERIALS, UNIT_MATERIALS, GL_RGBA32UI },
	{ "ambient_texels", BIND_AMBIENT, UNIT_AMBIENT, GL_R32F },
	{ "radiance_texels", BIND_RADIANCE, UNIT_RADIANCE, GL_RGBA32F },
	{ "cloud_lattice_texels", BIND_CLOUD_LATTICE, UNIT_CLOUD_LATTICE, GL_RGBA32F },
	{ "cloud_shade_texels", BIND_CLOUD_SHADE, UNIT_CLOUD_SHADE, GL_RGBA32F },
	{ "cloud_before_texels", BIND_CLOUD_BEFORE, UNIT_CLOUD_BEFORE, GL_RGBA16F },
	{ "cloud_light_texels", BIND_CLOUD_LIGHT, UNIT_CLOUD_LIGHT_OF_RAYS, GL_RGBA32F },
	{ "cloud_place_texels", BIND_CLOUD_PLACE, UNIT_CLOUD_PLACE, GL_RGBA32F },
	{ "cloud_kept_texels", BIND_CLOUD_LIGHT, UNIT_CLOUD_KEPT, GL_RGBA16F },
	{ "cloud_kept_words", BIND_CLOUD_LIGHT, UNIT_CLOUD_KEPT_WORDS, GL_RGBA32UI },
};

/* A file that is not in the folder of shaders. */
struct added {
	char name[64], shown[64];
	char *text;
};

struct programs {
	char dir[512];
	int n_added;
	struct added added[ADDED_MAX];
	int n;
	struct program list[PROGRAMS_MAX];
};

/* A kernel being put together. Its lines are numbered through and mapped back to files in messages:
 * #line would be simpler, but Mesa forgets its file number in some of them. */
struct assembly {
	const char *dir;
	const struct programs *programs; /* whose added files count; NULL: none */
	FILE *out;
	int line; /* written so far */
	int n_files, n_stretches;
	char files[FILES_MAX][64];
	struct {
		int first, file, line; /* from output line `first` on: lines of that file from `line` on */
	} stretches[STRETCHES_MAX];
};

static const struct added *find_added(const struct programs *programs, const char *name)
{
	for (int i = 0; programs && i < programs->n_added; i++)
		if (strcmp(programs->added[i].name, name) == 0)
			return &programs->added[i];
	return NULL;
}

static char *read_text(const char *dir, const char *name, struct error *err)
{
	if (dir[0] == '\0') {
		for (const struct embedded_file *f = welkin_embedded_shaders; f->name; f++)
			if (strcmp(f->name, name) == 0)
				return strdup((const char *)f->data);
		error_set(err, "there is no shader %s", name);
		return NULL;
	}
	char path[640];
	snprintf(path, sizeof path, "%s/%s", dir, name);
	FILE *file = fopen(path, "rb");
	char *text = NULL, *buffer = NULL;
	size_t size = 0;
	if (!file) {
		error_set(err, "can't read shader %s", path);
		return NULL;
	}
	FILE *memory = open_memstream(&buffer, &size);
	if (memory) {
		char block[4096];
		for (size_t n; (n = fread(block, 1, sizeof block, file)) > 0;)
			fwrite(block, 1, n, memory);
		if (fclose(memory) == 0 && !ferror(file))
			text = buffer;
	}
	if (!text) {
		error_set(err, "can't read shader %s", path);
		free(buffer);
	}
	fclose(file);
	return text;
}

/* The name in `#include "name"`, or false when the line is not one. */
static bool include_name(const char *line, char name[64])
{
	int end = 0;
	return sscanf(line, " # include \"%63[^\"]\"%n", name, &end) == 1 && end > 0;
}

static bool begin_stretch(struct assembly *a, int file, int line, struct error *err)
{
	if (a->n_stretches == STRETCHES_MAX)
		return error_set(err, "%s: too many includes", a->files[file]);
	a->stretches[a->n_stretches].first = a->line + 1;
	a->stretches[a->n_stretches].file = file;
	a->stretches[a->n_stretches++].line = line;
	return true;
}

static bool append_file(struct assembly *a, const char *name, int depth, struct error *err)
{
	for (int i = 0; i < a->n_files; i++)
		if (strcmp(a->files[i], name) == 0)
			return true;
	if (a->n_files == FILES_MAX || depth > DEPTH_MAX)
		return error_set(err, "%s: too many includes", name);
	const int number = a->n_files++;
	snprintf(a->files[number], sizeof a->files[number], "%s", name);
	const struct added *added = find_added(a->programs, name);
	char *text = added ? strdup(added->text) : read_text(a->dir, name, err);
	if (!text)
		return false;
	int line_number = 1;
	bool ok = begin_stretch(a, number, 1, err);
	for (char *line = text, *next; ok && *line; line = next, line_number++) {
		const size_t length = strcspn(line, "\n");
		next = line + length + (line[length] == '\n');
		char included[64];
		if (include_name(line, included)) {
			ok = append_file(a, included, depth + 1, err) && begin_stretch(a, number, line_number + 1, err);
		} else {
			fprintf(a->out, "%.*s\n", (int)length, line);
			a->line++;
		}
	}
	free(text);
	return ok;
}

/* "A=1 B=2" as #define lines; returns how many. */
static int define_choices(FILE *out, const char *choices)
{
	int lines = 0;
	for (const char *p = choices; *p; p += strspn(p, " ")) {
		const int name = (int)strcspn(p, "= "), length = (int)strcspn(p, " ");
		fprintf(out, "#define %.*s %.*s\n", name, p, length - name - 1, p + name + 1);
		p += length;
		lines++;
	}
	return lines;
}

static char *assemble(struct assembly *a, const char *name, const char *choices, struct error *err)
{
	char *source = NULL;
	size_t size = 0;
	a->out = open_memstream(&source, &size);
	if (!a->out) {
		error_set(err, "out of memory");
		return NULL;
	}
	fputs("#version 450 core\n#define WELKIN_GLSL 1\n", a->out);
	a->line = 2 + define_choices(a->out, choices);
	const bool ok = append_file(a, name, 0, err);
	if (fclose(a->out) == 0 && ok)
		return source;
	free(source);
	return NULL;
}

char *programs_source(const char *shader_dir, const char *name, const char *choices, struct error *err)
{
	struct assembly a = { .dir = shader_dir };
	return assemble(&a, name, choices, err);
}

/* Writes "file:line" for an output line. */
static void write_place(FILE *out, const struct assembly *a, int line)
{
	int i = a->n_stretches - 1;
	while (i > 0 && a->stretches[i].first > line)
		i--;
	const char *file = a->files[a->stretches[i].file];
	const struct added *added = find_added(a->programs, file);
	fprintf(out, "%s:%d", added ? added->shown : file, a->stretches[i].line + line - a->stretches[i].first);
}

/* Drivers write "0:12(5): error: …" or "0(12) : error …"; we say "sky.glsl:7(5): error: …". */
static void explain(const struct assembly *a, const char *name, const char *log, struct error *err)
{
	char text[1500] = "";
	FILE *out = fmemopen(text, sizeof text - 1, "w");
	for (const char *p = log; out && *p;) {
		const int length = (int)strcspn(p, "\n");
		int source, line, used = 0;
		if (sscanf(p, "%d:%d%n", &source, &line, &used) == 2 ||
			sscanf(p, "%d(%d)%n", &source, &line, &used) == 2)
			write_place(out, a, line);
		fprintf(out, "%.*s\n", length - used, p + used);
		p += length + (p[length] == '\n');
	}
	if (out)
		fclose(out);
	error_set(err, "shader %s: %s", name, text);
}

/* Compiles a file as one stage and attaches it; the reason names the file. */
static bool attach(const struct programs *programs, unsigned program, unsigned stage, const char *name,
	const char *choices, struct error *err)
{
	struct assembly a = { .dir = programs->dir, .programs = programs };
	char *source = assemble(&a, name, choices, err);
	if (!source)
		return false;
	char log[900] = "";
	GLint ok = 0;
	const unsigned shader = glCreateShader(stage);
	glShaderSource(shader, 1, &(const char *){ source }, NULL);
	glCompileShader(shader);
	glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
	glGetShaderInfoLog(shader, sizeof log, NULL, log);
	if (ok)
		glAttachShader(program, shader);
	else
		explain(&a, name, log, err);
	glDeleteShader(shader);
	free(source);
	return ok;
}

static bool attach_stages(
	const struct programs *programs, unsigned program, const char *name, const char *choices, struct error *err)
{
	const size_t stem = strlen(name) - 4;
	if (strcmp(name + stem, "vert") != 0)
		return attach(programs, program, GL_COMPUTE_SHADER, name, choices, err);
	char fragment[64];
	snprintf(fragment, sizeof fragment, "%.*sfrag", (int)stem, name);
	return attach(programs, program, GL_VERTEX_SHADER, name, choices, err) &&
	       attach(programs, program, GL_FRAGMENT_SHADER, fragment, choices, err);
}

static unsigned build(const struct programs *programs, const char *name, const char *choices, struct error *err)
{
	const unsigned id = glCreateProgram();
	char log[900] = "";
	GLint ok = 0;
	if (attach_stages(programs, id, name, choices, err)) {
		glLinkProgram(id);
		glGetProgramiv(id, GL_LINK_STATUS, &ok);
		glGetProgramInfoLog(id, sizeof log, NULL, log);
		if (!ok)
			error_set(err, "shader %s: %s", name, log);
	}
	if (ok)
		return id;
	glDeleteProgram(id);
	return 0;
}

struct programs *programs_create(const char *shader_dir)
{
	struct programs *p = calloc(1, sizeof *p);
	if (p)
		snprintf(p->dir, sizeof p->dir, "%s", shader_dir);
	return p;
}

void programs_destroy(struct programs *programs)
{
	if (!programs)
		return;
	for (int i = 0; i < programs->n; i++)
		glDeleteProgram(programs->list[i].id);
	for (int i = 0; i < programs->n_added; i++)
		free(programs->added[i].text);
	free(programs);
}

bool programs_add_file(struct programs *programs, const char *name, const char *shown, char *text)
{
	if (!text || programs->n_added == ADDED_MAX) {
		free(text);
		return false;
	}
	struct added *added = &programs->added[programs->n_added++];
	snprintf(added->name, sizeof added->name, "%s", name);
	snprintf(added->shown, sizeof added->shown, "%s", shown);
	added->text = text;
	return true;
}

bool programs_many(const struct programs *programs)
{
	return programs->n >= PROGRAMS_MANY;
}

const struct program *programs_get(struct programs *programs, const char *name, const char *choices, struct error *err)
{
	char full[192];
	snprintf(full, sizeof full, "%s%s%s", name, *choices ? " " : "", choices);
	for (int i = 0; i < programs->n; i++)
		if (strcmp(programs->list[i].name, full) == 0)
			return &programs->list[i];
	if (programs->n == PROGRAMS_MAX) {
		error_set(err, "more than %d programs", PROGRAMS_MAX);
		return NULL;
	}
	const unsigned id = build(programs, name, choices, err);
	if (!id)
		return NULL;
	struct program *p = &programs->list[programs->n++];
	snprintf(p->name, sizeof p->name, "%s", full);
	p->id = id;
	if (strcmp(name + strlen(name) - 4, "vert") != 0)
		glGetProgramiv(id, GL_COMPUTE_WORK_GROUP_SIZE, p->group);
	p->has_tile = glGetUniformLocation(id, "tile") == LOCATION_TILE;
	p->has_batch = glGetUniformLocation(id, "batch") == LOCATION_BATCH;
	p->has_samples = glGetUniformLocation(id, "samples") == LOCATION_SAMPLES;
	p->has_iteration = glGetUniformLocation(id, "iteration") == LOCATION_ITERATION;
	p->has_planes = glGetUniformLocation(id, "planes") == LOCATION_PLANES;
	p->has_white = glGetUniformLocation(id, "white") == LOCATION_WHITE;
	p->has_rows = glGetUniformLocation(id, "rows") == LOCATION_ROWS;
	p->has_groups = glGetUniformLocation(id, "group_list") == LOCATION_GROUPS;
	p->has_box = glGetUniformLocation(id, "box") == LOCATION_BOX;
	for (int i = 0; i < PROGRAM_FETCHED; i++)
		p->fetches |= glGetUniformLocation(id, program_fetched[i].sampler) >= 0 ? 1u << i : 0;
	return p;
}
