#include "server/bundle.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

/* Goes into every key: a new way of making meshes from the same files makes other meshes. */
static const char way[] = "welkin scenes 1";

enum { DEPTH_MAX = 4 };

/* ---- the block ---- */

struct bundle {
	int fd;
	uint64_t end;
	struct bundle_header header;
	struct sha256_ctx hash;
};

static bool put(struct bundle *b, const void *data, size_t size, struct error *err)
{
	const char *at = data;
	while (size) {
		const ssize_t n = pwrite(b->fd, at, size, (off_t)b->end);
		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			return error_set(err, "no memory for its files: %s", strerror(errno));
		at += n;
		size -= (size_t)n;
		b->end += (uint64_t)n;
	}
	return true;
}

static bool begin(struct bundle *b, enum bundle_kind kind, const struct bundle_limits *limits, struct error *err)
{
	const uint32_t kind32 = kind;
	*b = (struct bundle){ .fd = memfd_create("welkin-bundle", MFD_CLOEXEC | MFD_ALLOW_SEALING) };
	if (b->fd < 0)
		return error_set(err, "memfd: %s", strerror(errno));
	memcpy(b->header.magic, "welkbndl", 8);
	b->header.kind = kind32;
	b->header.limits = limits->mesh;
	b->header.max_unpacked = limits->max_files_bytes;
	sha256_init(&b->hash);
	sha256_update(&b->hash, sizeof way, (const uint8_t *)way);
	sha256_update(&b->hash, sizeof kind32, (const uint8_t *)&kind32);
	return put(b, &b->header, sizeof b->header, err); /* once more at the end, with the key */
}

static bool begin_file(struct bundle *b, const char *name, uint64_t size, struct error *err)
{
	const struct bundle_file file = { size, (uint32_t)strlen(name), 0 };
	if (b->header.n_files == SCENE_FILES_MAX)
		return error_set(err, "more than %d files", SCENE_FILES_MAX);
	b->header.n_files++;
	sha256_update(&b->hash, sizeof file, (const uint8_t *)&file);
	sha256_update(&b->hash, file.name_length, (const uint8_t *)name);
	return put(b, &file, sizeof file, err) && put(b, name, file.name_length, err);
}

static bool put_hashed(struct bundle *b, const void *data, size_t size, struct error *err)
{
	sha256_update(&b->hash, size, data);
	return put(b, data, size, err);
}

/* The next file begins at a multiple of 8, counted from the end of the one before. */
static bool end_file(struct bundle *b, uint64_t content, struct error *err)
{
	static const char zeros[8];
	return put(b, zeros, (size_t)(-content & 7), err);
}

static int finish(struct bundle *b, bool sound, char key[33], struct error *err)
{
	uint8_t digest[16];
	if (sound) {
		sha256_digest(&b->hash, sizeof digest, digest);
		for (int i = 0; i < 16; i++)
			snprintf(key + 2 * i, 3, "%02x", digest[i]);
		memcpy(b->header.key, key, sizeof b->header.key);
		b->end = 0;
		sound = put(b, &b->header, sizeof b->header, err);
	}
	if (sound && fcntl(b->fd, F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL))
		sound = error_set(err, "sealing: %s", strerror(errno));
	if (sound)
		return b->fd;
	if (b->fd >= 0)
		close(b->fd);
	return -1;
}

/* ---- folders ---- */

struct listed {
	char name[SCENE_PATH_MAX];
	uint64_t size;
	struct timespec changed;
	bool by_name; /* only that it is there matters: an image that is not a PNG */
};

struct listing {
	struct listed *files;
	int n;
};

static bool is_wanted(const char *name, bool *by_name)
{
	static const char *const read[] = { ".obj", ".mtl", ".png", ".raw", ".json", NULL };
	static const char *const known[] = { ".jpg", ".jpeg", ".tga", ".bmp", ".tif", ".tiff", ".dds", ".gif", ".exr",
		".hdr", ".webp", NULL };
	for (int i = 0; read[i]; i++)
		if (scene_file_has_suffix(name, read[i])) {
			*by_name = false;
			return true;
		}
	for (int i = 0; known[i]; i++)
		if (scene_file_has_suffix(name, known[i]))
			return *by_name = true;
	return false;
}

static bool list_folder(struct listing *list, const char *root, const char *below, int depth, struct error *err)
{
	char path[1024];
	snprintf(path, sizeof path, "%s%s%s", root, *below ? "/" : "", below);
	DIR *dir = opendir(path);
	const struct dirent *entry;
	bool sound = true;
	if (!dir)
		return error_set(err, "can't read %.300s: %s", path, strerror(errno));
	while (sound && (entry = readdir(dir))) {
		struct listed file = { 0 };
		struct stat st;
		if (entry->d_name[0] == '.' || fstatat(dirfd(dir), entry->d_name, &st, 0))
			continue;
		const int length =
			snprintf(file.name, sizeof file.name, "%s%s%s", below, *below ? "/" : "", entry->d_name);
		if (length >= (int)sizeof file.name)
			continue;
		if (S_ISDIR(st.st_mode) && depth < DEPTH_MAX) {
			sound = list_folder(list, root, file.name, depth + 1, err);
		} else if (S_ISREG(st.st_mode) && is_wanted(file.name, &file.by_name)) {
			if (list->n == SCENE_FILES_MAX) {
				sound = error_set(err, "more than %d files", SCENE_FILES_MAX);
				break;
			}
			file.size = (uint64_t)st.st_size;
			file.changed = st.st_mtim;
			list->files[list->n++] = file;
		}
	}
	closedir(dir);
	return sound;
}

static int by_name(const void *a, const void *b)
{
	return strcmp(((const struct listed *)a)->name, ((const struct listed *)b)->name);
}

static bool list_files(struct listing *list, const char *path, struct error *err)
{
	*list = (struct listing){ calloc(SCENE_FILES_MAX, sizeof *list->files), 0 };
	if (!list->files)
		return error_set(err, "out of memory");
	if (!list_folder(list, path, "", 0, err))
		return false;
	qsort(list->files, (size_t)list->n, sizeof *list->files, by_name);
	return true;
}

uint64_t bundle_folder_state(const char *path)
{
	struct listing list;
	uint64_t state = 0;
	if (list_files(&list, path, NULL)) {
		struct sha256_ctx hash;
		sha256_init(&hash);
		sha256_update(&hash, (size_t)list.n * sizeof *list.files, (const uint8_t *)list.files);
		sha256_digest(&hash, sizeof state, (uint8_t *)&state);
		state |= 1;
	}
	free(list.files);
	return state;
}

/* As many bytes as it was listed with: a file that changes meanwhile is an error now and read again later. */
static bool put_file(struct bundle *b, const char *folder, const struct listed *file, struct error *err)
{
	char path[1400];
	unsigned char buffer[65536];
	snprintf(path, sizeof path, "%s/%s", folder, file->name);
	const uint64_t size = file->by_name ? 0 : file->size;
	if (!begin_file(b, file->name, size, err))
		return false;
	const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	if (fd < 0)
		return error_set(err, "can't read %s: %s", file->name, strerror(errno));
	uint64_t left = size;
	bool sound = true;
	while (left && sound) {
		const ssize_t n = read(fd, buffer, left < sizeof buffer ? left : sizeof buffer);
		if (n < 0 && errno == EINTR)
			continue;
		sound = n > 0 ? put_hashed(b, buffer, (size_t)n, err)
			      : error_set(err, "%s changed while it was read", file->name);
		left -= n > 0 ? (uint64_t)n : 0;
	}
	close(fd);
	return sound && end_file(b, strlen(file->name) + size, err);
}

int bundle_of_folder(const char *path, const struct bundle_limits *limits, char key[33], struct error *err)
{
	struct listing list;
	struct bundle b = { .fd = -1 };
	bool sound = list_files(&list, path, err);
	uint64_t bytes = 0;
	for (int i = 0; sound && i < list.n; i++)
		bytes += list.files[i].by_name ? 0 : list.files[i].size;
	if (bytes > limits->max_files_bytes)
		sound = error_set(err, "its files are %llu MiB, more than the %llu that are allowed",
			(unsigned long long)(bytes >> 20), (unsigned long long)(limits->max_files_bytes >> 20));
	sound = sound && begin(&b, BUNDLE_FILES, limits, err);
	for (int i = 0; sound && i < list.n; i++)
		sound = put_file(&b, path, &list.files[i], err);
	free(list.files);
	return finish(&b, sound, key, err);
}

/* ---- the others ---- */

int bundle_of_archive(
	const void *data, size_t size, const struct bundle_limits *limits, char key[33], struct error *err)
{
	struct bundle b;
	const bool sound = begin(&b, BUNDLE_ARCHIVE, limits, err) && begin_file(&b, "archive", size, err) &&
			   put_hashed(&b, data, size, err) && end_file(&b, strlen("archive") + size, err);
	return finish(&b, sound, key, err);
}

int bundle_of_builtin(const char *name, const struct bundle_limits *limits, char key[33], struct error *err)
{
	struct bundle b;
	const bool sound = begin(&b, BUNDLE_BUILTIN, limits, err) && begin_file(&b, name, 0, err) &&
			   end_file(&b, strlen(name), err);
	return finish(&b, sound, key, err);
}
