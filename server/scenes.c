#include "server/scenes.h"
#include "api/text.h"
#include "server/clock.h"
#include "server/loader.h"
#include "server/log.h"
#include "server/scene_mesh.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

enum { ENTRIES_MAX = 1024, UPLOADS_WAITING_MAX = 4, LOOK_US = 2000000, RETRY_US = 5000000 };

enum source { MADE, FOLDER, UPLOAD };
enum state { UNREAD, READ, FAULTY, GONE };

struct entry {
	char name[WELKIN_NAME_SIZE];
	enum source source;
	enum state state;
	uint64_t files;  /* FOLDER: bundle_folder_state() when it was last looked at */
	int archive_fd;  /* UPLOAD: its bundle */
	char key[33];    /* UPLOAD */
	char fault[400]; /* FAULTY */
	bool passing;    /* the fault may be over the next time */
	int64_t failed_us;
	struct scene_about about; /* READ: stays when the mesh has to go */
	struct mesh_header header;
	struct scene_mesh *mesh; /* NULL: not in memory */
	uint64_t used;
	bool seen; /* FOLDER: while the folders are looked at */
	struct scenes_waiter *waiting;
};

struct upload {
	struct upload *next;
	void *archive;
	size_t size;
	struct scenes_waiter *waiter;
};

struct scenes {
	struct scenes_config config;
	char dir[512], loader[512];
	pthread_t thread;
	bool running;
	int cancel_fd;
	pthread_mutex_t lock;
	pthread_cond_t changed;
	bool stopping;
	struct entry *entries[ENTRIES_MAX]; /* by name */
	int n;
	struct upload *uploads; /* to be read, oldest first */
	int n_uploads;
	struct scenes_waiter *settling;
	uint64_t clock;
	struct scenes_stats stats;
};

/* ---- waiters: collected under the lock, told after it ---- */

static void answer(struct scenes_waiter *waiter, enum scenes_answer what, const char *fault)
{
	waiter->answer = what;
	snprintf(waiter->fault, sizeof waiter->fault, "%s", fault);
}

static void tell(struct scenes_waiter *first)
{
	while (first) {
		struct scenes_waiter *w = first;
		first = w->next;
		w->done(w);
	}
}

static void move_to(struct scenes_waiter **told, struct scenes_waiter *w)
{
	w->next = *told;
	*told = w;
}

/* What a waiter hears about an entry that is not about to be read. */
static void answer_for(struct scenes *s, struct entry *e, struct scenes_waiter *w)
{
	if (e->state == READ && e->mesh) {
		answer(w, SCENES_FOUND, "");
		w->mesh = scene_mesh_ref(e->mesh);
		e->used = ++s->clock;
	} else {
		answer(w, e->state == GONE ? SCENES_UNKNOWN : SCENES_FAULTY, e->fault);
	}
	snprintf(w->name, sizeof w->name, "%s", e->name);
}

/* ---- the list ---- */

static struct entry *find(const struct scenes *s, const char *name)
{
	for (int i = 0; i < s->n; i++)
		if (!strcmp(s->entries[i]->name, name))
			return s->entries[i];
	return NULL;
}

static struct entry *add_entry(struct scenes *s, const char *name, enum source source)
{
	struct entry *e = s->n < ENTRIES_MAX ? calloc(1, sizeof *e) : NULL;
	if (!e)
		return NULL;
	snprintf(e->name, sizeof e->name, "%.63s", name);
	e->source = source;
	e->archive_fd = -1;
	int at = s->n++;
	for (; at && strcmp(s->entries[at - 1]->name, name) > 0; at--)
		s->entries[at] = s->entries[at - 1];
	s->entries[at] = e;
	return e;
}

static void let_mesh_go(struct scenes *s, struct entry *e)
{
	if (!e->mesh)
		return;
	s->stats.meshes--;
	s->stats.bytes -= e->mesh->bytes + heights_bytes(e->mesh->heights);
	scene_mesh_unref(e->mesh);
	e->mesh = NULL;
}

static void forget(struct scenes *s, struct entry *e)
{
	let_mesh_go(s, e);
	e->state = GONE;
	if (e->archive_fd >= 0)
		close(e->archive_fd);
	e->archive_fd = -1;
}

/* Lets go of what was used longest ago until the budget holds; `kept` stays whatever its size. */
static void keep_budget(struct scenes *s, const struct entry *kept)
{
	while (s->stats.bytes > s->config.cache_bytes) {
		struct entry *oldest = NULL;
		for (int i = 0; i < s->n; i++) {
			struct entry *e = s->entries[i];
			if (e->mesh && e != kept && (!oldest || e->used < oldest->used))
				oldest = e;
		}
		if (!oldest)
			return;
		let_mesh_go(s, oldest);
	}
}

static void names_of(const struct scenes *s, char *text, size_t size)
{
	size_t n = (size_t)snprintf(text, size, "one of ");
	const char *comma = "";
	for (int i = 0; i < s->n; i++) {
		const struct entry *e = s->entries[i];
		if (e->state == GONE)
			continue;
		if (n + strlen(e->name) + 8 > size) {
			snprintf(text + n, size - n, ", …");
			return;
		}
		n += (size_t)snprintf(text + n, size - n, "%s%s", comma, e->name);
		comma = ", ";
	}
}

/* ---- folders ---- */

static void look_at_folder(struct scenes *s, const char *name, uint64_t files)
{
	struct entry *e = find(s, name);
	if (!e && !(e = add_entry(s, name, FOLDER)))
		return;
	e->seen = true;
	if (e->source != FOLDER || (e->state != GONE && e->files == files))
		return;
	let_mesh_go(s, e);
	e->state = UNREAD;
	e->files = files;
}

/* Without the lock but where the list is touched: folders may be slow. */
static void look_at_folders(struct scenes *s)
{
	const struct dirent *d;
	DIR *dir = s->dir[0] ? opendir(s->dir) : NULL;
	while (dir && (d = readdir(dir))) {
		char path[1024];
		struct stat st;
		snprintf(path, sizeof path, "%s/%s", s->dir, d->d_name);
		if (d->d_name[0] == '.' || stat(path, &st) || !S_ISDIR(st.st_mode))
			continue;
		if (!welkin_name_valid(d->d_name))
			continue;
		const uint64_t files = bundle_folder_state(path);
		pthread_mutex_lock(&s->lock);
		look_at_folder(s, d->d_name, files);
		pthread_mutex_unlock(&s->lock);
	}
	pthread_mutex_lock(&s->lock);
	for (int i = 0; dir && i < s->n; i++) {
		struct entry *e = s->entries[i];
		if (e->source == FOLDER && !e->seen && !e->waiting)
			forget(s, e);
		e->seen = false;
	}
	pthread_mutex_unlock(&s->lock);
	if (dir)
		closedir(dir);
}

/* ---- reading ---- */

static int make_bundle(struct scenes *s, const struct entry *e, char key[33], struct error *err)
{
	char path[1024];
	if (e->source == MADE)
		return bundle_of_builtin(e->name, &s->config.limits, key, err);
	if (e->source == UPLOAD) {
		memcpy(key, e->key, sizeof e->key);
		return dup(e->archive_fd);
	}
	snprintf(path, sizeof path, "%s/%s", s->dir, e->name);
	return bundle_of_folder(path, &s->config.limits, key, err);
}

static enum loaded read_bundle(
	struct scenes *s, int bundle_fd, const char key[33], struct scene_mesh **mesh, struct error *err)
{
	const struct loader_config config = { .program = s->loader,
		.memory_bytes = s->config.loader_bytes,
		.timeout_s = s->config.load_s,
		.cancel_fd = s->cancel_fd };
	struct scene_about about;
	int mesh_fd;
	const enum loaded loaded = loader_run(&config, bundle_fd, key, &mesh_fd, &about, err);
	if (loaded == LOADED)
		*mesh = scene_mesh_create(mesh_fd, &about, err);
	return loaded == LOADED && !*mesh ? LOAD_FAILED : loaded;
}

/* With the lock held. */
static void publish(struct scenes *s, struct entry *e, enum loaded loaded, struct scene_mesh *mesh, const char *fault,
	struct scenes_waiter **told)
{
	let_mesh_go(s, e);
	e->state = loaded == LOADED ? READ : FAULTY;
	e->passing = loaded == LOAD_FAILED;
	e->failed_us = clock_us();
	snprintf(e->fault, sizeof e->fault, "%s", loaded == LOADED ? "" : fault);
	s->stats.loads++;
	s->stats.faults += loaded != LOADED;
	if (mesh) {
		e->mesh = mesh;
		e->about = mesh->about;
		e->header = *mesh->header;
		e->used = ++s->clock;
		s->stats.meshes++;
		s->stats.bytes += mesh->bytes + heights_bytes(mesh->heights);
		keep_budget(s, e);
	}
	while (e->waiting) {
		struct scenes_waiter *w = e->waiting;
		e->waiting = w->next;
		answer_for(s, e, w);
		move_to(told, w);
	}
}

static void log_load(
	const char *name, enum loaded loaded, const struct scene_mesh *mesh, int64_t begun_us, const char *fault)
{
	if (loaded == LOADED)
		log_event(LEVEL_INFO, "scene_read", "name=%s triangles=%u bytes=%zu ms=%.1f", name,
			mesh->header->n_indices / 3, mesh->bytes, clock_ms_between(begun_us, clock_us()));
	else
		log_event(LEVEL_ERROR, "scene_faulty", "name=%s reason=\"%s\"", name, fault);
}

static void read_entry(struct scenes *s, struct entry *e)
{
	struct error err = { "" };
	struct scene_mesh *mesh = NULL;
	struct scenes_waiter *told = NULL;
	const int64_t begun_us = clock_us();
	char key[33];
	/* name, source and archive of an entry change on this thread only */
	const int bundle_fd = make_bundle(s, e, key, &err);
	enum loaded loaded = LOAD_FAULT;
	if (bundle_fd >= 0) {
		loaded = read_bundle(s, bundle_fd, key, &mesh, &err);
		close(bundle_fd);
	}
	log_load(e->name, loaded, mesh, begun_us, err.text);
	pthread_mutex_lock(&s->lock);
	publish(s, e, loaded, mesh, err.text, &told);
	pthread_mutex_unlock(&s->lock);
	tell(told);
}

/* ---- uploads ---- */

static void drop_old_uploads(struct scenes *s, const struct entry *kept)
{
	for (;;) {
		struct entry *oldest = NULL;
		int n = 0;
		for (int i = 0; i < s->n; i++) {
			struct entry *e = s->entries[i];
			if (e->source != UPLOAD || e->state == GONE)
				continue;
			n++;
			if (e != kept && !e->waiting && (!oldest || e->used < oldest->used))
				oldest = e;
		}
		if (n <= s->config.uploads || !oldest)
			return;
		log_event(LEVEL_INFO, "upload_dropped", "name=%s", oldest->name);
		forget(s, oldest);
	}
}

/* A place in the list for an upload that turned out well. Those that are gone make room first. */
static struct entry *entry_for_upload(struct scenes *s, const char *name)
{
	struct entry *e = find(s, name);
	if (e)
		return e;
	for (int i = s->n - 1; i >= 0; i--) {
		struct entry *gone = s->entries[i];
		if (gone->source != UPLOAD || gone->state != GONE || gone->waiting)
			continue;
		s->n--;
		memmove(s->entries + i, s->entries + i + 1, (size_t)(s->n - i) * sizeof(struct entry *));
		free(gone);
	}
	return add_entry(s, name, UPLOAD);
}

static void read_upload(struct scenes *s, struct upload *upload)
{
	struct error err = { "" };
	struct scene_mesh *mesh = NULL;
	struct scenes_waiter *told = upload->waiter;
	const int64_t begun_us = clock_us();
	char key[33] = "", name[WELKIN_NAME_SIZE];
	const int bundle_fd = bundle_of_archive(upload->archive, upload->size, &s->config.limits, key, &err);
	free(upload->archive);
	snprintf(name, sizeof name, "upload-%.20s", key);
	pthread_mutex_lock(&s->lock);
	struct entry *e = find(s, name);
	if (e && (e->state == READ || e->state == UNREAD)) {
		e->used = ++s->clock;
		upload->waiter->known = true;
		answer(told, SCENES_FOUND, "");
		snprintf(told->name, sizeof told->name, "%s", name);
		pthread_mutex_unlock(&s->lock);
		close(bundle_fd);
		told->next = NULL;
		tell(told);
		return;
	}
	pthread_mutex_unlock(&s->lock);
	enum loaded loaded = bundle_fd < 0 ? LOAD_FAILED : read_bundle(s, bundle_fd, key, &mesh, &err);
	log_load(name, loaded, mesh, begun_us, err.text);
	pthread_mutex_lock(&s->lock);
	answer(told, loaded == LOADED ? SCENES_FOUND : SCENES_FAULTY, err.text);
	told->next = NULL;
	if (loaded == LOADED && (e = entry_for_upload(s, name))) {
		if (e->archive_fd >= 0)
			close(e->archive_fd);
		e->archive_fd = bundle_fd;
		memcpy(e->key, key, sizeof e->key);
		snprintf(told->name, sizeof told->name, "%s", name);
		publish(s, e, loaded, mesh, "", &told);
		drop_old_uploads(s, e);
	} else {
		s->stats.loads++;
		s->stats.faults++;
		if (loaded == LOADED)
			answer(told, SCENES_BUSY, "There are too many scenes.");
		scene_mesh_unref(mesh);
		if (bundle_fd >= 0)
			close(bundle_fd);
	}
	pthread_mutex_unlock(&s->lock);
	tell(told);
}

/* ---- the thread ---- */

/* What somebody waits for; then the operator's folders, so that faults are in the log before anybody asks; the rest
 * once there is somebody who wants to see all. */
static struct entry *next_entry(const struct scenes *s)
{
	for (int i = 0; i < s->n; i++)
		if (s->entries[i]->waiting)
			return s->entries[i];
	for (int i = 0; i < s->n; i++) {
		struct entry *e = s->entries[i];
		if (e->state == UNREAD && (s->settling || (s->config.eager && e->source == FOLDER)))
			return e;
	}
	return NULL;
}

/* With the lock held: waits until something is to be done or it is time to look at the folders. */
static void wait_for_work(struct scenes *s, int64_t until_us)
{
	while (!s->stopping && !s->uploads && !s->settling && !next_entry(s) && clock_us() < until_us) {
		struct timespec until = { until_us / 1000000, until_us % 1000000 * 1000 };
		pthread_cond_timedwait(&s->changed, &s->lock, &until);
	}
}

static void settle(struct scenes *s)
{
	struct scenes_waiter *told = s->settling;
	s->settling = NULL;
	for (struct scenes_waiter *w = told; w; w = w->next)
		answer(w, SCENES_FOUND, "");
	pthread_mutex_unlock(&s->lock);
	tell(told);
	pthread_mutex_lock(&s->lock);
}

static void *run(void *cls)
{
	struct scenes *s = cls;
	int64_t look_us = 0;
	pthread_mutex_lock(&s->lock);
	while (!s->stopping) {
		struct upload *upload = s->uploads;
		struct entry *entry = NULL;
		if (upload) {
			s->uploads = upload->next;
			s->n_uploads--;
		} else if (clock_us() < look_us || !s->dir[0]) {
			entry = next_entry(s);
		}
		const bool look = !upload && s->dir[0] && clock_us() >= look_us;
		if (!upload && !entry && !look) {
			if (s->settling)
				settle(s);
			wait_for_work(s, s->dir[0] ? look_us : clock_us() + LOOK_US);
			continue;
		}
		pthread_mutex_unlock(&s->lock);
		if (upload) {
			read_upload(s, upload);
			free(upload);
		} else if (entry) {
			read_entry(s, entry);
		} else {
			look_at_folders(s);
			look_us = clock_us() + LOOK_US;
		}
		pthread_mutex_lock(&s->lock);
	}
	pthread_mutex_unlock(&s->lock);
	return NULL;
}

/* ---- for the server's other threads ---- */

static bool refuse(struct scenes_waiter *waiter)
{
	answer(waiter, SCENES_BUSY, "The server is shutting down.");
	return true;
}

static bool look_up(struct scenes *s, const char *name, struct scenes_waiter *waiter)
{
	struct entry *e = find(s, name);
	if (!e || e->state == GONE) {
		waiter->answer = SCENES_UNKNOWN;
		names_of(s, waiter->fault, sizeof waiter->fault);
		return true;
	}
	const bool again = e->state == FAULTY && e->passing && clock_us() - e->failed_us > RETRY_US;
	if (!e->waiting && !again && (e->mesh || e->state == FAULTY)) {
		answer_for(s, e, waiter);
		return true;
	}
	if (!waiter->done)
		return false;
	waiter->next = e->waiting;
	e->waiting = waiter;
	pthread_cond_signal(&s->changed);
	return false;
}

bool scenes_find(struct scenes *s, const char *name, struct scenes_waiter *waiter)
{
	pthread_mutex_lock(&s->lock);
	const bool there = s->stopping ? refuse(waiter) : look_up(s, name, waiter);
	pthread_mutex_unlock(&s->lock);
	return there;
}

bool scenes_upload(struct scenes *s, void *archive, size_t size, struct scenes_waiter *waiter)
{
	struct upload *upload = calloc(1, sizeof *upload), **at = &s->uploads;
	bool taken = false;
	pthread_mutex_lock(&s->lock);
	if (s->stopping) {
		refuse(waiter);
	} else if (!upload || s->n_uploads >= UPLOADS_WAITING_MAX) {
		answer(waiter, SCENES_BUSY, "Too many uploads wait to be read.");
	} else {
		while (*at)
			at = &(*at)->next;
		*upload = (struct upload){ NULL, archive, size, waiter };
		*at = upload;
		s->n_uploads++;
		taken = true;
		pthread_cond_signal(&s->changed);
	}
	pthread_mutex_unlock(&s->lock);
	if (taken)
		return false;
	free(upload);
	free(archive);
	return true;
}

bool scenes_settle(struct scenes *s, struct scenes_waiter *waiter)
{
	pthread_mutex_lock(&s->lock);
	const bool stopping = s->stopping;
	if (stopping) {
		refuse(waiter);
	} else {
		waiter->next = s->settling;
		s->settling = waiter;
		pthread_cond_signal(&s->changed);
	}
	pthread_mutex_unlock(&s->lock);
	return stopping;
}

struct scenes_stats scenes_stats(struct scenes *s)
{
	pthread_mutex_lock(&s->lock);
	const struct scenes_stats stats = s->stats;
	pthread_mutex_unlock(&s->lock);
	return stats;
}

/* ---- JSON ---- */

static void add_text(struct text *text, const char *name, const char *value)
{
	if (!*value)
		return;
	text_printf(text, ",\"%s\":", name);
	text_json_string(text, value);
}

static void add_number(struct text *text, const char *name, double value)
{
	if (!isfinite(value))
		return;
	text_printf(text, ",\"%s\":", name);
	text_number(text, value);
}

static void add_corner(struct text *text, const char *name, const float corner[3])
{
	text_printf(text, "\"%s\":[", name);
	for (int k = 0; k < 3; k++)
		text_printf(text, "%s%.9g", k ? "," : "", (double)corner[k]);
	text_puts(text, "]");
}

static void add_mesh(struct text *text, const struct entry *e)
{
	const struct mesh_header *h = &e->header;
	const struct scene_about *a = &e->about;
	text_printf(text,
		",\"weather_map\":%s,\"noise_base\":%s,\"noise_detail\":%s,\"triangles\":%u,\"vertices\":%u,"
		"\"textures\":%u,\"bytes\":%llu,\"key\":\"%s\","
		"\"bounds_m\":{",
		h->weather_texture >= 0 ? "true" : "false", h->base_volume >= 0 ? "true" : "false",
		h->detail_volume >= 0 ? "true" : "false", h->n_indices / 3, h->n_vertices, h->n_textures,
		(unsigned long long)h->bytes, h->key);
	add_corner(text, "low", h->low);
	text_puts(text, ",");
	add_corner(text, "high", h->high);
	text_puts(text, "},\"materials\":[");
	for (uint32_t i = 0; i < h->n_materials && i < SCENE_MATERIALS_LISTED; i++) {
		text_puts(text, i ? "," : "");
		text_json_string(text, a->materials[i]);
	}
	text_puts(text, "],\"placing\":{\"local_frame\":\"x east, y up, z south, metres\"");
	add_number(text, "latitude_deg", a->latitude_deg);
	add_number(text, "longitude_deg", a->longitude_deg);
	add_number(text, "altitude_m", isnan(a->altitude_m) ? 0 : a->altitude_m);
	add_number(text, "heading_deg", isnan(a->heading_deg) ? 0 : a->heading_deg);
	add_number(text, "scale", isnan(a->scale) ? 1 : a->scale);
	text_puts(text, "}");
	add_text(text, "title", a->title);
	add_text(text, "licence", a->licence);
	add_text(text, "source_of_data", a->source);
}

static void add_scene(struct text *text, const struct entry *e)
{
	static const char *const sources[] = { "built-in", "folder", "upload" };
	static const char *const states[] = { "unread", "ready", "faulty", "gone" };
	text_puts(text, "{\"name\":");
	text_json_string(text, e->name);
	text_printf(text, ",\"source\":\"%s\",\"state\":\"%s\"", sources[e->source], states[e->state]);
	if (e->state == READ)
		add_mesh(text, e);
	if (e->state == FAULTY)
		add_text(text, "fault", e->fault);
	text_puts(text, "}");
}

char *scenes_json(struct scenes *s, const char *name)
{
	struct text text = { 0 };
	const char *comma = "\n";
	pthread_mutex_lock(&s->lock);
	text_puts(&text, name ? "" : "{\"scenes\":[");
	for (int i = 0; i < s->n; i++) {
		const struct entry *e = s->entries[i];
		if (e->state == GONE || (name && strcmp(e->name, name)))
			continue;
		text_puts(&text, name ? "" : comma);
		add_scene(&text, e);
		comma = ",\n";
	}
	text_puts(&text, name ? "\n" : "\n]}\n");
	pthread_mutex_unlock(&s->lock);
	return text_take(&text);
}

/* ---- start and end ---- */

static void init_lock(struct scenes *s)
{
	pthread_condattr_t attributes;
	pthread_mutex_init(&s->lock, NULL);
	pthread_condattr_init(&attributes);
	pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
	pthread_cond_init(&s->changed, &attributes);
	pthread_condattr_destroy(&attributes);
}

struct scenes *scenes_start(const struct scenes_config *config, struct error *err)
{
	struct scenes *s = calloc(1, sizeof *s);
	struct stat st;
	if (!s) {
		error_set(err, "out of memory");
		return NULL;
	}
	s->config = *config;
	snprintf(s->dir, sizeof s->dir, "%s", config->dir ? config->dir : "");
	snprintf(s->loader, sizeof s->loader, "%s", config->loader ? config->loader : "");
	init_lock(s);
	s->cancel_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	const bool folders = !s->dir[0] || (!stat(s->dir, &st) && S_ISDIR(st.st_mode));
	if (!folders)
		error_set(err, "scene-dir %s: %s", s->dir, errno ? strerror(errno) : "not a folder");
	else if (s->cancel_fd < 0 || !add_entry(s, "mountains", MADE) || !add_entry(s, "city", MADE))
		error_set(err, "out of memory or descriptors");
	else {
		look_at_folders(s); /* so that every name is known from the first moment */
		s->running = !pthread_create(&s->thread, NULL, run, s);
		if (s->running)
			return s;
		error_set(err, "can't start the thread that reads scenes");
	}
	scenes_destroy(s);
	return NULL;
}

void scenes_refuse(struct scenes *s)
{
	const uint64_t one = 1;
	if (!s || !s->running)
		return;
	pthread_mutex_lock(&s->lock);
	s->stopping = true;
	pthread_cond_signal(&s->changed);
	pthread_mutex_unlock(&s->lock);
	if (write(s->cancel_fd, &one, sizeof one) < 0)
		log_event(LEVEL_WARN, "wake_failed", "error=\"%s\"", strerror(errno));
	pthread_join(s->thread, NULL);
	s->running = false;
	struct scenes_waiter *told = s->settling;
	s->settling = NULL;
	for (int i = 0; i < s->n; i++)
		while (s->entries[i]->waiting) {
			struct scenes_waiter *w = s->entries[i]->waiting;
			s->entries[i]->waiting = w->next;
			move_to(&told, w);
		}
	while (s->uploads) {
		struct upload *upload = s->uploads;
		s->uploads = upload->next;
		move_to(&told, upload->waiter);
		free(upload->archive);
		free(upload);
	}
	for (struct scenes_waiter *w = told; w; w = w->next)
		refuse(w);
	tell(told);
}

void scenes_destroy(struct scenes *s)
{
	if (!s)
		return;
	scenes_refuse(s);
	for (int i = 0; i < s->n; i++) {
		scene_mesh_unref(s->entries[i]->mesh);
		if (s->entries[i]->archive_fd >= 0)
			close(s->entries[i]->archive_fd);
		free(s->entries[i]);
	}
	if (s->cancel_fd >= 0)
		close(s->cancel_fd);
	pthread_cond_destroy(&s->changed);
	pthread_mutex_destroy(&s->lock);
	free(s);
}
