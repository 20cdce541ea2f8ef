#ifndef WELKIN_TESTS_LIB_SCENE_DIR_H
#define WELKIN_TESTS_LIB_SCENE_DIR_H

#include <stddef.h>
#include <stdint.h>

/* Folders of scenes for tests, under /tmp, and the files that go into them. A failure fails the test. */

/* A fresh folder; remove it with scene_dir_remove(). */
void scene_dir_make(char path[64]);
void scene_dir_remove(const char *path);

/* Writes FOLDER/NAME/FILE, making FOLDER/NAME where it is not there. */
void scene_dir_write(const char *folder, const char *name, const char *file, const void *data, size_t size);
void scene_dir_text(const char *folder, const char *name, const char *file, const char *text);

/* A PNG of one colour type and depth (8 or 16), rows as PNG has them without filter bytes; malloc'd. */
unsigned char *scene_png(
	uint32_t width, uint32_t height, int depth, int colour_type, const unsigned char *rows, size_t *size);

/* A stored (not deflated) ZIP archive of n files; malloc'd. */
struct zip_file {
	const char *name;
	const void *data;
	size_t size;
};
unsigned char *scene_zip(const struct zip_file *files, int n, size_t *size);

extern const char scene_square_obj[]; /* a square of side 2 at height 3, with texture coordinates and a.mtl */

#endif
