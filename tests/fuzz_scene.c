/* libFuzzer target: whatever a scene's files hold, reading them gives an error of one line or a mesh that is valid. It
 * runs the parsers without the process and the sandbox that they have around them in the server. The first byte says
 * what the rest is. */
#include "server/scene_parse.h"

#undef NDEBUG
#include <assert.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const char mtl[] =
	"newmtl a\nKd 1 0.5 0\nmap_Kd t.png\nnorm t.png\nnewmtl b\nmap_Bump -bm 2 t.png\nd 0.5\nNs 9\n";
static const char obj[] =
	"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf -1 -2 -3\n";
static const char map[] =
	"{\"heightmap\":{\"file\":\"t.png\",\"spacing_m\":2,\"low_m\":0,\"high_m\":10,\"albedo\":\"t.png\"}}";

/* 1 × 1, grey */
static const unsigned char png[] = { 0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R', 0, 0,
	0, 1, 0, 0, 0, 1, 8, 0, 0, 0, 0, 0x3a, 0x7e, 0x9b, 0x55, 0, 0, 0, 10, 'I', 'D', 'A', 'T', 0x78, 0x9c, 0x63,
	0x68, 0, 0, 0, 0x82, 0, 0x81, 0x77, 0xcd, 0x72, 0xb6, 0, 0, 0, 0, 'I', 'E', 'N', 'D', 0xae, 0x42, 0x60, 0x82 };

static struct scene_file file(const char *name, const void *data, size_t size)
{
	return (struct scene_file){ name, data, size };
}

static void check_mesh(const struct mesh_build *build)
{
	static const char key[] = "0123456789abcdef0123456789abcdef";
	struct error err = { "" };
	const int fd = memfd_create("fuzz", 0);
	assert(fd >= 0);
	if (mesh_build_write(build, fd, key, &err)) {
		const size_t bytes = (size_t)lseek(fd, 0, SEEK_END);
		void *map_of = mmap(NULL, bytes, PROT_READ, MAP_SHARED, fd, 0);
		assert(map_of != MAP_FAILED && mesh_valid(map_of, bytes));
		munmap(map_of, bytes);
	} else {
		assert(err.text[0]);
	}
	close(fd);
}

static void read_files(const struct scene_files *files)
{
	struct mesh_build build = { .limits = { 20000, 256, 4 << 20 } };
	struct scene_about about;
	struct error err = { "" };
	if (scene_parse(files, &build, &about, &err))
		check_mesh(&build);
	else
		assert(err.text[0] && !strchr(err.text, '\n'));
	mesh_build_finish(&build);
}

static void read_bundle(const uint8_t *data, size_t size, uint32_t kind)
{
	struct bundle_header header = { .magic = "welkbndl", .kind = kind, .n_files = 1, .max_unpacked = 1 << 20 };
	struct bundle_file one = { size, 1, 0 };
	struct scene_files files;
	struct error err = { "" };
	const size_t bytes = sizeof header + sizeof one + 1 + size;
	unsigned char *bundle = malloc(bytes);
	assert(bundle);
	if (kind == BUNDLE_FILES) /* the framing itself is fuzzed */
		header.n_files = size ? data[0] : 0;
	memcpy(bundle, &header, sizeof header);
	memcpy(bundle + sizeof header, &one, sizeof one);
	bundle[sizeof header + sizeof one] = 'x';
	memcpy(bundle + sizeof header + sizeof one + 1, data, size);
	if (kind == BUNDLE_FILES && size)
		memcpy(bundle + sizeof header, data, size);
	if (scene_files_open(&files, bundle, bytes, &err))
		read_files(&files);
	else
		assert(err.text[0]);
	scene_files_finish(&files);
	free(bundle);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	const uint8_t what = size ? data[0] % 8 : 0;
	const uint8_t *rest = data + (size > 0);
	const size_t n = size - (size > 0);
	struct scene_file list[3];
	struct scene_files files = { .list = list };
	switch (what) {
	case 0:
		list[files.n++] = file("a.obj", rest, n);
		break;
	case 1:
		list[files.n++] = file("a.obj", obj, sizeof obj - 1);
		list[files.n++] = file("a.mtl", rest, n);
		list[files.n++] = file("t.png", png, sizeof png);
		break;
	case 2:
		list[files.n++] = file("a.obj", obj, sizeof obj - 1);
		list[files.n++] = file("a.mtl", mtl, sizeof mtl - 1);
		list[files.n++] = file("t.png", rest, n);
		break;
	case 3:
		list[files.n++] = file("scene.json", map, sizeof map - 1);
		list[files.n++] = file("t.png", rest, n);
		break;
	case 4:
		list[files.n++] = file("scene.json", rest, n);
		list[files.n++] = file("a.obj", obj, sizeof obj - 1);
		list[files.n++] = file("t.png", png, sizeof png);
		break;
	case 6:
		list[files.n++] = file("noise_base.png", rest, n);
		break;
	case 7:
		list[files.n++] = file("noise_detail.raw", rest, n);
		break;
	default:
		read_bundle(rest, n, n & 1 ? BUNDLE_ARCHIVE : BUNDLE_FILES);
		return 0;
	}
	read_files(&files);
	return 0;
}
