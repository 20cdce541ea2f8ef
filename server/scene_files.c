#include "server/scene_files.h"

#include <archive.h>
#include <archive_entry.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* ---- names ---- */

bool scene_file_has_suffix(const char *name, const char *suffix)
{
	const size_t n = strlen(name), s = strlen(suffix);
	return n > s && !strcasecmp(name + n - s, suffix);
}

static void tidy_name(const char *name, char tidy[SCENE_PATH_MAX])
{
	while (name[0] == '.' && (name[1] == '/' || name[1] == '\\'))
		name += 2;
	snprintf(tidy, SCENE_PATH_MAX, "%s", name);
	for (char *c = tidy; *c; c++)
		if (*c == '\\')
			*c = '/';
	for (size_t n = strlen(tidy); n && (tidy[n - 1] == ' ' || tidy[n - 1] == '\r' || tidy[n - 1] == '\t');)
		tidy[--n] = 0;
}

static const char *last_part(const char *name)
{
	const char *slash = strrchr(name, '/');
	return slash ? slash + 1 : name;
}

const struct scene_file *scene_files_find(const struct scene_files *files, const char *name)
{
	char tidy[SCENE_PATH_MAX];
	tidy_name(name, tidy);
	for (size_t i = 0; i < files->n; i++)
		if (!strcmp(files->list[i].name, tidy))
			return &files->list[i];
	for (size_t i = 0; i < files->n; i++)
		if (!strcasecmp(files->list[i].name, tidy))
			return &files->list[i];
	for (size_t i = 0; i < files->n; i++)
		if (*last_part(tidy) && !strcasecmp(last_part(files->list[i].name), last_part(tidy)))
			return &files->list[i];
	return NULL;
}

/* ---- the list ---- */

static bool own(struct scene_files *files, char *memory)
{
	if (!memory)
		return false;
	files->owned[files->n_owned++] = memory;
	return true;
}

static bool room_for_files(struct scene_files *files, struct error *err)
{
	if (!files->list) {
		files->list = calloc(SCENE_FILES_MAX, sizeof *files->list);
		files->owned = calloc(2 * SCENE_FILES_MAX, sizeof *files->owned);
	}
	if (!files->list || !files->owned)
		return error_set(err, "out of memory");
	return files->n < SCENE_FILES_MAX || error_set(err, "more than %d files", SCENE_FILES_MAX);
}

/* data stays where it is. */
static bool add_file(
	struct scene_files *files, const char *name, size_t length, const void *data, size_t size, struct error *err)
{
	char *copy;
	if (!room_for_files(files, err))
		return false;
	if (length >= SCENE_PATH_MAX || length == 0 || memchr(name, 0, length))
		return error_set(err, "a file's name is too long or empty");
	if (!own(files, copy = strndup(name, length)))
		return error_set(err, "out of memory");
	files->list[files->n++] = (struct scene_file){ copy, data, size };
	return true;
}

void scene_files_finish(struct scene_files *files)
{
	for (size_t i = 0; i < files->n_owned; i++)
		free(files->owned[i]);
	free(files->owned);
	free(files->list);
	*files = (struct scene_files){ 0 };
}

/* ---- archives ---- */

/* The content of the entry in hand, of at most `left` bytes; what an entry says of its size is not believed. */
static char *read_entry(struct archive *a, uint64_t left, size_t *size, struct error *err)
{
	char *data = NULL;
	size_t room = 0, n = 0;
	for (;;) {
		if (n == room) {
			const size_t wanted = room ? room * 2 : 65536;
			char *grown = realloc(data, wanted);
			if (!grown)
				break;
			data = grown;
			room = wanted;
		}
		const la_ssize_t got = archive_read_data(a, data + n, room - n);
		if (got < 0) {
			error_set(err, "the archive is damaged: %s",
				archive_error_string(a) ? archive_error_string(a) : "it can't be unpacked");
			free(data);
			return NULL;
		}
		n += (size_t)got;
		if (n > left) {
			error_set(err, "unpacked, the archive is larger than allowed");
			free(data);
			return NULL;
		}
		if (got == 0) {
			*size = n;
			return data;
		}
	}
	error_set(err, "no memory to unpack the archive");
	free(data);
	return NULL;
}

static bool unpack_entry(
	struct scene_files *files, struct archive *a, struct archive_entry *entry, uint64_t *left, struct error *err)
{
	const char *name = archive_entry_pathname(entry);
	if (!name || archive_entry_filetype(entry) != AE_IFREG)
		return true; /* folders, links: nothing that a scene needs */
	/* what Finder and Windows add */
	if (!strncmp(name, "__MACOSX/", 9) || !strncmp(last_part(name), "._", 2))
		return true;
	if (!room_for_files(files, err))
		return false;
	char tidy[SCENE_PATH_MAX];
	if (strlen(name) >= sizeof tidy)
		return error_set(err, "a file's name is too long");
	tidy_name(name, tidy);
	size_t size = 0;
	char *data = read_entry(a, *left, &size, err);
	if (!data)
		return false;
	own(files, data);
	*left -= size;
	return !*tidy || add_file(files, tidy, strlen(tidy), data, size, err);
}

static bool unpack(struct scene_files *files, const void *data, size_t size, uint64_t left, struct error *err)
{
	struct archive *a = archive_read_new();
	struct archive_entry *entry;
	int got = ARCHIVE_FATAL;
	bool sound = true;
	if (!a)
		return error_set(err, "out of memory");
	archive_read_support_format_zip(a);
	archive_read_support_format_tar(a);
	archive_read_support_filter_gzip(a);
	if (archive_read_open_memory(a, data, size) == ARCHIVE_OK)
		while (sound && (got = archive_read_next_header(a, &entry)) >= ARCHIVE_WARN && got != ARCHIVE_EOF)
			sound = unpack_entry(files, a, entry, &left, err);
	if (sound && got != ARCHIVE_EOF)
		sound = error_set(err, "it is not a sound ZIP or tar archive: %s",
			archive_error_string(a) ? archive_error_string(a) : "unknown format");
	if (sound && !files->n)
		sound = error_set(err, "the archive holds no files");
	archive_read_free(a);
	return sound;
}

/* ---- bundles ---- */

bool scene_files_open(struct scene_files *files, const void *bundle, size_t size, struct error *err)
{
	struct bundle_header header;
	const char *at = bundle, *end = at + size;
	*files = (struct scene_files){ 0 };
	if (size < sizeof header)
		return error_set(err, "the bundle is too short");
	memcpy(&header, bundle, sizeof header);
	at += sizeof header;
	if (memcmp(header.magic, "welkbndl", 8) || header.n_files > SCENE_FILES_MAX)
		return error_set(err, "not a bundle");
	for (uint32_t i = 0; i < header.n_files; i++) {
		struct bundle_file file;
		if ((size_t)(end - at) < sizeof file)
			return error_set(err, "the bundle is cut short");
		memcpy(&file, at, sizeof file);
		at += sizeof file;
		const size_t left = (size_t)(end - at);
		if (file.name_length > left || file.size > left - file.name_length)
			return error_set(err, "the bundle is cut short");
		const char *data = at + file.name_length;
		const bool sound = header.kind == BUNDLE_ARCHIVE
					   ? unpack(files, data, file.size, header.max_unpacked, err)
					   : add_file(files, at, file.name_length, data, file.size, err);
		if (!sound)
			return false;
		const size_t used = ((size_t)file.name_length + file.size + 7) & ~(size_t)7;
		at = used > left ? end : at + used;
	}
	return true;
}
