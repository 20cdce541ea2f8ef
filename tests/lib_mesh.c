#include "tests/lib_mesh.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

struct square {
	struct mesh_header header;
	struct mesh_vertex vertices[4];
	uint32_t indices[6];
	struct mesh_part parts[2];
	struct mesh_material materials[1];
	struct mesh_texture textures[1];
	uint8_t pixels[2 * 2 * 4];
};

struct mesh_header *lib_mesh_square(float height, const char *key)
{
	struct square *s = calloc(1, sizeof *s);
	static const uint32_t indices[] = { 0, 1, 2, 2, 1, 3 };
	if (!s)
		return NULL;
	s->header = (struct mesh_header){ .magic = "welkmesh",
		.version = MESH_VERSION,
		.weather_texture = -1,
		.base_volume = -1,
		.detail_volume = -1,
		.n_vertices = 4,
		.n_indices = 6,
		.n_parts = 2,
		.n_materials = 1,
		.n_textures = 1,
		.bytes = sizeof *s,
		.vertices = offsetof(struct square, vertices),
		.indices = offsetof(struct square, indices),
		.parts = offsetof(struct square, parts),
		.materials = offsetof(struct square, materials),
		.textures = offsetof(struct square, textures),
		.low = { -1, height, -1 },
		.high = { 1, height, 1 } };
	snprintf(s->header.key, sizeof s->header.key, "%s", key);
	for (int i = 0; i < 4; i++)
		s->vertices[i] = (struct mesh_vertex){ { i & 1 ? 1 : -1, height, i & 2 ? 1 : -1 }, { 0, 1, 0 },
			{ (float)(i & 1), (float)(i >> 1) } };
	memcpy(s->indices, indices, sizeof indices);
	s->parts[0] = (struct mesh_part){ 0, 3, 0 };
	s->parts[1] = (struct mesh_part){ 3, 3, 0 };
	s->materials[0] = (struct mesh_material){
		.diffuse = { 1, 1, 1 }, .opacity = 1, .albedo_texture = 0, .normal_texture = -1
	};
	s->textures[0] = (struct mesh_texture){ 2, 2, offsetof(struct square, pixels), 1, 0 };
	return &s->header;
}

int lib_mesh_memfd(const struct mesh_header *mesh, bool sealed)
{
	const int fd = memfd_create("mesh", MFD_CLOEXEC | MFD_ALLOW_SEALING);
	if (fd < 0 || write(fd, mesh, mesh->bytes) != (ssize_t)mesh->bytes)
		return -1;
	if (sealed && fcntl(fd, F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW))
		return -1;
	return fd;
}
