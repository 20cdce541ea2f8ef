#include "gpu/operator_methods.h"

#include "api/text.h"
#include "gpu/sky_tables.h"

#include <assert.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

enum { NAMES_MAX = 4096, BLAMES_TO_DISABLE = 2, FIRST_BUNDLE_FD = 10 };
/* Places for methods: some of the names are of none. */
enum { METHODS_ROOM = WELKIN_METHODS_MAX - 4 };

/* An entry with what only this file needs. */
struct entry {
	struct operator_method method;
	struct operator_status status; /* under the lock */
	int blames;                    /* under the lock */
	const char *fields[METHOD_PARAMETERS_MAX + METHOD_FIELDS_MAX + 1];
	char parameter_names[METHOD_PARAMETERS_MAX][64];
	struct method_range ranges[METHOD_DOMAIN_MAX + 1];
};

static struct {
	int n, left_out, built_in, values;
	unsigned changes;
	pthread_mutex_t lock;
	struct entry list[OPERATOR_METHODS_MAX];
} all = { .lock = PTHREAD_MUTEX_INITIALIZER };

/* A file as it was found: its text, or why there is none. The head of a bundle's record. */
struct found {
	char file[256];
	char reason[256];
	size_t size;
};

__attribute__((format(printf, 2, 3))) static void refuse(struct entry *e, const char *format, ...)
{
	va_list args;
	va_start(args, format);
	vsnprintf(e->status.reason, sizeof e->status.reason, format, args);
	va_end(args);
	e->status.state = OPERATOR_UNAVAILABLE;
	if (e->method.index >= 0)
		welkin_method_hidden[e->method.index] = 1;
}

/* ---- into the registry ---- */

static enum table_state need_depth(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	(void)batch; /* columns are the same for all bands */
	return need_optical_depth(tables, scene, err);
}

static bool taken(const char *name)
{
	for (int i = 0; welkin_method_names[i]; i++)
		if (!strcmp(welkin_method_names[i], name))
			return true;
	return !strcmp(name, "auto"); /* says that the method is to be chosen */
}

/* Room for one more name, behind those of the methods; names that follow them (of no method) stay last. */
static void insert_name(const char *name)
{
	const char **at = &welkin_method_names[welkin_method_count];
	int n = 0;
	while (at[n])
		n++;
	memmove(at + 1, at, (size_t)(n + 1) * sizeof *at);
	*at = name;
}

/* The name from the file's, and a place in the registry. false: it has none. */
static bool place(struct entry *e)
{
	struct operator_method *m = &e->method;
	const size_t length = strlen(m->file) - strlen(".glsl");
	m->index = -1;
	if (!method_name_valid(m->file, length)) {
		refuse(e,
			"%.100s: the file's name has to be up to %d of a-z, 0-9 and single _, a letter first, and "
			".glsl",
			m->file, METHOD_NAME_SIZE - 1);
		return false;
	}
	memcpy(m->name, m->file, length);
	if (taken(m->name)) {
		refuse(e, "%s: a built-in method has that name", m->file);
		m->name[0] = '\0';
		return false;
	}
	if (welkin_method_count >= METHODS_ROOM) {
		refuse(e, "%s: there are %d methods already", m->file, METHODS_ROOM);
		m->name[0] = '\0';
		return false;
	}
	insert_name(m->name);
	m->index = welkin_method_count++;
	welkin_methods[m->index] = &m->method;
	welkin_methods[m->index + 1] = NULL;
	return true;
}

static void parameter_name(char out[64], const char *method, const char *parameter)
{
	char name[64]; /* a detour, for the compiler sees all of them in one static object */
	snprintf(name, sizeof name, "method.%.24s.%.24s", method, parameter);
	memcpy(out, name, sizeof name);
}

/* Parameters become request fields, each with a value of its own in the request. */
static void add_parameters(struct entry *e)
{
	struct operator_method *m = &e->method;
	const struct method_head *head = &m->head;
	int n = 0;
	if (all.values + head->n_parameters > WELKIN_METHOD_VALUES) {
		refuse(e, "%s: with its %d parameters all methods together would have more than %d", m->file,
			head->n_parameters, WELKIN_METHOD_VALUES);
		return;
	}
	m->method.first_value = all.values;
	m->method.n_values = head->n_parameters;
	for (int i = 0; i < head->n_parameters; i++) {
		const struct method_parameter *p = &head->parameters[i];
		parameter_name(e->parameter_names[i], m->name, p->name);
		const struct welkin_field field = { .name = e->parameter_names[i],
			.type = WELKIN_TYPE_DOUBLE,
			.unit = p->unit,
			.min = p->min,
			.max = p->max,
			.default_text = p->default_text,
			.help = p->help,
			.offset =
				offsetof(struct welkin_request, method_values) + (size_t)all.values++ * sizeof(double),
			.of_method = 1 + m->index };
		const bool added = welkin_field_add(&field);
		assert(added); /* fields.c leaves room for all values */
		(void)added;
		e->fields[n++] = e->parameter_names[i];
	}
	for (int i = 0; i < head->n_fields; i++)
		e->fields[n++] = head->fields[i];
}

static void describe(struct entry *e)
{
	struct operator_method *m = &e->method;
	const struct method_head *head = &m->head;
	for (int i = 0; i < head->n_domain; i++) {
		const struct method_bound *b = &head->domain[i];
		e->ranges[i] = (struct method_range){ b->field, b->min, b->max, b->why };
	}
	m->method = (struct method){ .name = m->name,
		.summary = head->summary,
		.source = head->source,
		.fields = e->fields,
		.domain = e->ranges,
		.physical = head->physical,
		.operators = 1,
		.tables = head->multiple        ? need_multiple
			  : head->optical_depth ? need_depth
						: NULL };
}

static void digest(const char *file, const char *text, char out[17])
{
	uint64_t hash = 14695981039346656037u; /* FNV-1a, 64 bits */
	for (const char *p = file; *p; p++)
		hash = (hash ^ (unsigned char)*p) * 1099511628211u;
	for (const char *p = text; *p; p++)
		hash = (hash ^ (unsigned char)*p) * 1099511628211u;
	snprintf(out, 17, "%016llx", (unsigned long long)hash);
}

/* One file into list and registry. text, malloc'd, becomes the entry's; NULL where found says why. */
static void enter(const struct found *found, char *text)
{
	struct entry *e = &all.list[all.n++];
	struct operator_method *m = &e->method;
	struct error err = { "" };
	int line;
	memset(e, 0, sizeof *e);
	memcpy(m->file, found->file, sizeof m->file);
	m->text = text;
	if (!place(e))
		return;
	if (!text) {
		refuse(e, "%s: %s", m->file, found->reason);
	} else if (!method_head_parse(&m->head, text, &line, &err)) {
		memset(&m->head, 0, sizeof m->head);
		refuse(e, "%s:%d: %s", m->file, line, err.text);
	}
	describe(e);
	digest(m->file, text ? text : "", m->digest);
	add_parameters(e);
}

void operator_methods_forget(void)
{
	for (int i = 0; i < all.n; i++)
		free((void *)all.list[i].method.text);
	/* Ours stand between the built-in ones and names that are of no method. */
	if (all.built_in)
		memmove(&welkin_method_names[all.built_in], &welkin_method_names[welkin_method_count],
			(size_t)(WELKIN_METHODS_MAX + 1 - welkin_method_count) * sizeof welkin_method_names[0]);
	if (all.built_in)
		welkin_method_count = all.built_in;
	for (int i = welkin_method_count; i < WELKIN_METHODS_MAX; i++) {
		welkin_methods[i] = NULL;
		welkin_method_hidden[i] = 0;
	}
	welkin_fields_reset();
	all.n = all.left_out = all.values = 0;
	all.built_in = welkin_method_count;
	all.changes++;
}

/* ---- the folder ---- */

static int compare(const void *a, const void *b)
{
	return strcmp(*(char *const *)a, *(char *const *)b);
}

static bool is_method_file(const char *name)
{
	const size_t length = strlen(name);
	return name[0] != '.' && length > 5 && length < sizeof((struct found *)0)->file &&
	       !strcmp(name + length - 5, ".glsl");
}

/* The text, malloc'd, or NULL with the reason in found. Never waits: a pipe is not a regular file. */
static char *read_text(int dir, struct found *found)
{
	const int fd = openat(dir, found->file, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
	struct stat st;
	char *text = NULL;
	const char *fault = NULL;
	if (fd < 0 || fstat(fd, &st))
		fault = strerror(errno);
	else if (!S_ISREG(st.st_mode))
		fault = "is not a regular file";
	else if (st.st_size > OPERATOR_FILE_MAX)
		fault = "is larger than 256 KiB";
	else if (!(text = malloc(OPERATOR_FILE_MAX + 1)))
		fault = "there is no memory to read it";
	while (!fault && found->size < OPERATOR_FILE_MAX) {
		const ssize_t n = read(fd, text + found->size, OPERATOR_FILE_MAX - found->size);
		if (n < 0 && errno == EINTR)
			continue;
		if (n < 0)
			fault = strerror(errno);
		if (n <= 0)
			break;
		found->size += (size_t)n;
	}
	if (!fault) {
		text[found->size] = '\0';
		if (!found->size)
			fault = "is empty";
		else if (strlen(text) != found->size || utf8_check(text, found->size) < found->size)
			fault = "is not text in UTF-8";
	}
	if (fd >= 0)
		close(fd);
	if (!fault)
		return text;
	snprintf(found->reason, sizeof found->reason, "%s", fault);
	found->size = 0;
	free(text);
	return NULL;
}

/* Names of the files, sorted, malloc'd each; at most NAMES_MAX are looked at. */
static int list_files(DIR *dir, char *names[NAMES_MAX])
{
	int n = 0;
	for (const struct dirent *d; n < NAMES_MAX && (d = readdir(dir));) {
		if (!is_method_file(d->d_name))
			continue;
		names[n] = strdup(d->d_name);
		n += names[n] != NULL;
	}
	qsort(names, (size_t)n, sizeof *names, compare);
	return n;
}

bool operator_methods_read(const char *path, struct error *err)
{
	static char *names[NAMES_MAX];
	operator_methods_forget();
	if (!*path)
		return true;
	DIR *dir = opendir(path);
	if (!dir)
		return error_set(err, "can't read the folder of methods %s: %s", path, strerror(errno));
	const int n = list_files(dir, names);
	for (int i = 0; i < n; i++) {
		if (i < OPERATOR_METHODS_MAX) {
			struct found found = { .size = 0 };
			snprintf(found.file, sizeof found.file, "%s", names[i]);
			char *text = read_text(dirfd(dir), &found);
			enter(&found, text);
		}
		free(names[i]);
	}
	closedir(dir);
	all.left_out = n > OPERATOR_METHODS_MAX ? n - OPERATOR_METHODS_MAX : 0;
	return true;
}

/* ---- the bundle ---- */

static bool write_all(int fd, const void *data, size_t size)
{
	for (const char *at = data; size;) {
		const ssize_t n = write(fd, at, size);
		if (n <= 0)
			return false;
		at += n;
		size -= (size_t)n;
	}
	return true;
}

int operator_methods_bundle(struct error *err)
{
	const int low = memfd_create("welkin-methods", MFD_CLOEXEC);
	const int fd = low < 0 ? -1 : fcntl(low, F_DUPFD_CLOEXEC, FIRST_BUNDLE_FD);
	bool ok = fd >= 0;
	if (low >= 0)
		close(low);
	for (int i = 0; ok && i < all.n; i++) {
		const struct operator_method *m = &all.list[i].method;
		struct found found = { .size = m->text ? strlen(m->text) : 0 };
		memcpy(found.file, m->file, sizeof found.file);
		snprintf(found.reason, sizeof found.reason, "%s", m->text ? "" : "could not be read");
		ok = write_all(fd, &found, sizeof found) && write_all(fd, m->text ? m->text : "", found.size);
	}
	if (ok)
		return fd;
	error_set(err, "no memory for the operator's methods: %s", strerror(errno));
	if (fd >= 0)
		close(fd);
	return -1;
}

bool operator_methods_receive(int fd, struct error *err)
{
	struct found found;
	ssize_t got;
	off_t at = 0;
	operator_methods_forget();
	while ((got = pread(fd, &found, sizeof found, at)) == (ssize_t)sizeof found) {
		at += (off_t)sizeof found;
		char *text = found.size && found.size <= OPERATOR_FILE_MAX ? malloc(found.size + 1) : NULL;
		if (all.n == OPERATOR_METHODS_MAX || (found.size && !text) ||
			(text && pread(fd, text, found.size, at) != (ssize_t)found.size)) {
			free(text);
			return error_set(err, "the bundle of methods is damaged");
		}
		if (text)
			text[found.size] = '\0';
		at += (off_t)found.size;
		enter(&found, text);
	}
	return got == 0 ||
	       error_set(err, "the bundle of methods can't be read: %s", got < 0 ? strerror(errno) : "cut short");
}

/* ---- asking ---- */

int operator_methods_count(void)
{
	return all.n;
}

int operator_methods_left_out(void)
{
	return all.left_out;
}

const struct operator_method *operator_methods_at(int i)
{
	return &all.list[i].method;
}

int operator_methods_find(int method)
{
	for (int i = 0; i < all.n; i++)
		if (all.list[i].method.index == method && method >= 0)
			return i;
	return -1;
}

/* ---- states ---- */

struct operator_status operator_methods_status(int i)
{
	pthread_mutex_lock(&all.lock);
	const struct operator_status status = all.list[i].status;
	pthread_mutex_unlock(&all.lock);
	return status;
}

static bool set_status(struct entry *e, const struct operator_status *status)
{
	if (e->status.state == OPERATOR_UNAVAILABLE || e->status.state == status->state)
		return false;
	e->status = *status;
	e->status.reason[sizeof e->status.reason - 1] = '\0';
	e->status.reason[strcspn(e->status.reason, "\n")] = '\0'; /* a driver says much more than where */
	if (status->state == OPERATOR_UNAVAILABLE && e->method.index >= 0)
		welkin_method_hidden[e->method.index] = 1;
	all.changes++;
	return true;
}

bool operator_methods_report(int i, const struct operator_status *status)
{
	pthread_mutex_lock(&all.lock);
	const bool changed = set_status(&all.list[i], status);
	pthread_mutex_unlock(&all.lock);
	return changed;
}

bool operator_methods_blame(int i, const char *how)
{
	struct entry *e = &all.list[i];
	struct operator_status status = { .state = OPERATOR_UNAVAILABLE };
	snprintf(status.reason, sizeof status.reason, "%s: the renderer was lost while it worked for this method (%s)",
		e->method.file, how);
	pthread_mutex_lock(&all.lock);
	const bool changed = ++e->blames >= BLAMES_TO_DISABLE && set_status(e, &status);
	pthread_mutex_unlock(&all.lock);
	return changed;
}

unsigned operator_methods_changes(void)
{
	pthread_mutex_lock(&all.lock);
	const unsigned changes = all.changes;
	pthread_mutex_unlock(&all.lock);
	return changes;
}

static const char state_letters[] = "?+-";

void operator_methods_states(char text[OPERATOR_METHODS_MAX + 1])
{
	pthread_mutex_lock(&all.lock);
	for (int i = 0; i < all.n; i++)
		text[i] = state_letters[all.list[i].status.state];
	text[all.n] = '\0';
	pthread_mutex_unlock(&all.lock);
}

void operator_methods_take_states(const char *text)
{
	for (int i = 0; i < all.n && text[i]; i++) {
		const char *letter = strchr(state_letters, text[i]);
		const struct operator_status status = { .state = letter ? (enum operator_state)(letter - state_letters)
									: OPERATOR_UNCHECKED,
			.reason = "the server says so" };
		operator_methods_report(i, &status);
	}
}

/* ---- the kernel ---- */

char *operator_methods_kernel(const struct operator_method *method)
{
	const struct method_head *head = &method->head;
	struct text text = { 0 };
	text_puts(&text, "#include \"sky.glsl\"\n#include \"atmosphere.glsl\"\n");
	if (head->multiple)
		text_puts(&text, "#include \"multiple_table.glsl\"\n");
	else if (head->optical_depth)
		text_puts(&text, "#include \"sun_column.glsl\"\n");
	if (head->n_parameters)
		text_puts(&text, "layout(std140, binding = BIND_METHOD) uniform MethodBlock {\n");
	for (int i = 0; i < head->n_parameters; i++)
		text_printf(&text, "\tfloat %s;\n", head->parameters[i].name);
	if (head->n_parameters)
		text_puts(&text, "} parameters;\n");
	text_printf(&text, "#include \"operator/%s\"\n", method->file);
	return text_take(&text);
}
