#include "gpu/tables.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TABLES_MAX = 256, KEY_MAX = 1664 };

struct table {
	unsigned texture;  /* 0 and object NULL: the slot is free */
	unsigned previous; /* iterated: where the last run's result is while building; 0 otherwise */
	int runs;          /* of the kernel so far */
	const void *kind;  /* its desc, for a table */
	const struct table_desc *desc;
	void *object; /* of tables_keep() */
	void (*destroy)(void *object);
	char pass[32];
	unsigned char key[KEY_MAX];
	size_t key_size;
	double bytes;
	uint64_t used;   /* when, in needs */
	uint64_t holder; /* the oldest frame at work that needs it; 0: none */
};

struct frame_tables {
	struct passes *passes;
	struct programs *programs;
	double budget_bytes;
	uint64_t clock;  /* counts needs */
	uint64_t pinned; /* tables used since then are in use by the slice in hand */
	uint64_t holder; /* the frame that the slice is of; 0: none */
	struct table list[TABLES_MAX];
	struct tables_report report;
};

struct frame_tables *tables_create(struct passes *passes, struct programs *programs, double budget_mib)
{
	struct frame_tables *t = calloc(1, sizeof *t);
	if (!t)
		return NULL;
	t->passes = passes;
	t->programs = programs;
	t->budget_bytes = budget_mib * 1048576;
	return t;
}

static void forget(struct table *table)
{
	if (table->texture)
		glDeleteTextures(1, &table->texture);
	if (table->previous)
		glDeleteTextures(1, &table->previous);
	if (table->object)
		table->destroy(table->object);
	memset(table, 0, sizeof *table);
}

void tables_destroy(struct frame_tables *tables)
{
	if (!tables)
		return;
	for (int i = 0; i < TABLES_MAX; i++)
		forget(&tables->list[i]);
	free(tables);
}

void tables_begin_slice(struct frame_tables *tables, uint64_t holder)
{
	tables->pinned = tables->clock + 1;
	tables->holder = holder;
	tables->report.n = 0;
}

void tables_release(struct frame_tables *tables, uint64_t holder)
{
	for (int i = 0; i < TABLES_MAX; i++)
		if (tables->list[i].holder == holder)
			tables->list[i].holder = 0;
}

const struct tables_report *tables_report(const struct frame_tables *tables)
{
	return &tables->report;
}

double tables_bytes(const struct frame_tables *tables)
{
	double sum = 0;
	for (int i = 0; i < TABLES_MAX; i++)
		sum += tables->list[i].bytes;
	return sum;
}

static double texel_bytes(unsigned format)
{
	switch (format) {
	case GL_RGBA32F:
		return 16;
	case GL_RGBA16F:
	case GL_RG32F:
	case GL_RGBA16:
		return 8;
	case GL_RG16F:
	case GL_R32F:
	case GL_RGBA8:
	case GL_R11F_G11F_B10F:
		return 4;
	case GL_R16F:
	case GL_RG8:
		return 2;
	case GL_R8:
		return 1;
	default:
		return 16;
	}
}

/* Of one texture; what feeds back has two until it is built. */
static double texture_bytes(const struct table_desc *desc)
{
	return (double)desc->width * desc->height * (desc->depth > 0 ? desc->depth : 1) *
	       texel_bytes(desc->internal_format);
}

static double building_bytes(const struct table_desc *desc)
{
	return texture_bytes(desc) * (desc->feedback ? 2 : 1);
}

static bool occupied(const struct table *table)
{
	return table->texture || table->object;
}

static struct table *find(struct frame_tables *tables, const void *kind, const void *key, size_t key_size)
{
	for (int i = 0; i < TABLES_MAX; i++) {
		struct table *t = &tables->list[i];
		if (occupied(t) && t->kind == kind && t->key_size == key_size && memcmp(t->key, key, key_size) == 0)
			return t;
	}
	return NULL;
}

static void use(struct frame_tables *tables, struct table *table)
{
	table->used = ++tables->clock;
	if (tables->holder && (!table->holder || tables->holder < table->holder))
		table->holder = tables->holder;
}

/* Tables of the slice in hand stay, and so do those of older frames: were two frames to take each other's
 * unfinished tables away, neither would ever be done. What is not a table stays for all of its own frame: a mesh larger
 * than the budget would be made anew in every slice, and its frame never be done. */
static bool may_go(const struct frame_tables *tables, const struct table *table)
{
	if (table->used >= tables->pinned)
		return false;
	if (!tables->holder || !table->holder)
		return true;
	return table->object ? table->holder > tables->holder : table->holder >= tables->holder;
}

/* A free slot, after letting go of the tables that were used longest ago, down to what leaves room
 * for `bytes`. What has to stay does so whatever the budget: it is what may be kept. */
static struct table *make_room(struct frame_tables *tables, double bytes)
{
	for (;;) {
		struct table *oldest = NULL, *slot = NULL;
		for (int i = 0; i < TABLES_MAX; i++) {
			struct table *t = &tables->list[i];
			if (!occupied(t))
				slot = t;
			else if (may_go(tables, t) && (!oldest || t->used < oldest->used))
				oldest = t;
		}
		if ((slot && tables_bytes(tables) + bytes <= tables->budget_bytes) || !oldest)
			return slot;
		forget(oldest);
	}
}

/* Is there no room for so much because of what older frames hold? */
static bool crowded_out(const struct frame_tables *tables, double bytes)
{
	double held = 0;
	for (int i = 0; i < TABLES_MAX; i++)
		if (tables->holder && tables->list[i].holder && tables->list[i].holder < tables->holder)
			held += tables->list[i].bytes;
	return held > 0 && held + bytes > tables->budget_bytes;
}

static unsigned create_texture(const struct table_desc *desc)
{
	unsigned texture;
	const bool flat = desc->depth == 0;
	glCreateTextures(flat ? GL_TEXTURE_2D : GL_TEXTURE_3D, 1, &texture);
	if (flat)
		glTextureStorage2D(texture, 1, desc->internal_format, desc->width, desc->height);
	else
		glTextureStorage3D(texture, 1, desc->internal_format, desc->width, desc->height, desc->depth);
	glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
	glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
	const GLint wrap = desc->repeats ? GL_REPEAT : GL_CLAMP_TO_EDGE;
	glTextureParameteri(texture, GL_TEXTURE_WRAP_S, wrap);
	glTextureParameteri(texture, GL_TEXTURE_WRAP_T, wrap);
	glTextureParameteri(texture, GL_TEXTURE_WRAP_R, wrap);
	return texture;
}

static int runs_needed(const struct table_desc *desc)
{
	return desc->iterations > 1 ? desc->iterations : 1;
}

static struct table *add(
	struct frame_tables *tables, const struct table_desc *desc, const void *key, size_t key_size, struct error *err)
{
	struct table *t = make_room(tables, building_bytes(desc));
	if (!t) {
		error_set(err, "more than %d tables in use at once", TABLES_MAX);
		return NULL;
	}
	t->texture = create_texture(desc);
	t->previous = desc->feedback ? create_texture(desc) : 0;
	t->kind = t->desc = desc;
	t->bytes = building_bytes(desc);
	t->key_size = key_size;
	memcpy(t->key, key, key_size);
	snprintf(t->pass, sizeof t->pass, "table-%s", desc->name);
	return t;
}

/* One run of the table's kernel. */
static bool run(struct frame_tables *tables, struct table *t, int batch, struct error *err)
{
	const struct table_desc *desc = t->desc;
	char file[64];
	snprintf(file, sizeof file, "tables/%s.comp", desc->name);
	const struct program *program = programs_get(tables->programs, file, desc->choices ? desc->choices : "", err);
	if (!program)
		return false;
	if (t->previous) {
		const unsigned last = t->texture;
		t->texture = t->previous;
		t->previous = last;
		passes_texture(tables->passes, (unsigned)desc->unit, last);
	}
	struct pass pass = { .name = t->pass,
		.program = program,
		.image = t->texture,
		.image_format = desc->internal_format,
		.batch = batch,
		.iteration = t->runs,
		.threads = { desc->width, desc->height, desc->depth } };
	if (desc->threads[0] > 0)
		memcpy(pass.threads, desc->threads, sizeof pass.threads);
	passes_run(tables->passes, &pass);
	t->runs++;
	return true;
}

static void report(struct frame_tables *tables, const struct table *t, bool built)
{
	struct tables_report *list = &tables->report;
	int i = 0;
	while (i < list->n && strcmp(list->entries[i].pass, t->pass) != 0)
		i++;
	if (i == TABLES_REPORT_MAX)
		return;
	if (i == list->n) {
		memset(&list->entries[i], 0, sizeof list->entries[i]);
		snprintf(list->entries[i].pass, sizeof t->pass, "%s", t->pass);
		list->n++;
	}
	if (built)
		list->entries[i].built++;
	else
		list->entries[i].kept++;
}

enum table_state tables_need(struct frame_tables *tables, const struct table_desc *desc, const void *key,
	size_t key_size, int batch, struct error *err)
{
	if (key_size > KEY_MAX) {
		error_set(err, "table %s: key of %zu bytes", desc->name, key_size);
		return TABLE_FAILED;
	}
	struct table *t = find(tables, desc, key, key_size);
	/* What one run makes goes over the budget; what takes many of them waits for its turn. */
	if (!t && runs_needed(desc) > 1 && crowded_out(tables, building_bytes(desc)))
		return TABLE_WAITING;
	if (!t && !(t = add(tables, desc, key, key_size, err)))
		return TABLE_FAILED;
	use(tables, t);
	const bool building = t->runs < runs_needed(desc);
	if (building && !run(tables, t, batch, err)) {
		forget(t);
		return TABLE_FAILED;
	}
	report(tables, t, building);
	if (building && desc->iterations > 1)
		return TABLE_BUILDING;
	if (t->previous) {
		glDeleteTextures(1, &t->previous);
		t->previous = 0;
		t->bytes = texture_bytes(desc);
	}
	passes_texture(tables->passes, (unsigned)desc->unit, t->texture);
	return TABLE_READY;
}

bool tables_need_picture(struct frame_tables *tables, const void *kind, const void *key, size_t key_size,
	const struct table_desc *desc, const void *rgba8, struct error *err)
{
	struct table *t = key_size <= KEY_MAX ? find(tables, kind, key, key_size) : NULL;
	if (!t) {
		t = key_size <= KEY_MAX ? make_room(tables, texture_bytes(desc)) : NULL;
		if (!t)
			return error_set(err, "no slot for one more picture on the device");
		t->texture = create_texture(desc);
		if (desc->depth > 0)
			glTextureSubImage3D(t->texture, 0, 0, 0, 0, desc->width, desc->height, desc->depth, GL_RGBA,
				GL_UNSIGNED_BYTE, rgba8);
		else
			glTextureSubImage2D(
				t->texture, 0, 0, 0, desc->width, desc->height, GL_RGBA, GL_UNSIGNED_BYTE, rgba8);
		t->kind = kind;
		t->bytes = texture_bytes(desc);
		t->key_size = key_size;
		memcpy(t->key, key, key_size);
	}
	use(tables, t);
	passes_texture(tables->passes, (unsigned)desc->unit, t->texture);
	return true;
}

unsigned tables_texture(const struct frame_tables *tables, int unit)
{
	const struct table *last = NULL;
	for (int i = 0; i < TABLES_MAX; i++) {
		const struct table *t = &tables->list[i];
		if (t->desc && t->desc->unit == unit && (!last || t->used > last->used))
			last = t;
	}
	return last ? last->texture : 0;
}

void *tables_kept(struct frame_tables *tables, const void *kind, const void *key, size_t key_size)
{
	struct table *t = find(tables, kind, key, key_size);
	if (!t)
		return NULL;
	use(tables, t);
	return t->object;
}

bool tables_keep(struct frame_tables *tables, const void *kind, const void *key, size_t key_size, void *object,
	double bytes, void (*destroy)(void *object), struct error *err)
{
	struct table *t = key_size <= KEY_MAX ? make_room(tables, bytes) : NULL;
	if (!t) {
		destroy(object);
		return error_set(err, "no slot for one more object on the device");
	}
	t->kind = kind;
	t->object = object;
	t->destroy = destroy;
	t->bytes = bytes;
	t->key_size = key_size;
	memcpy(t->key, key, key_size);
	use(tables, t);
	return true;
}
