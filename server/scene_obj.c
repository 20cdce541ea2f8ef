#include "server/scene_parse.h"

#include <assimp/cfileio.h>
#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Wavefront OBJ and MTL, read by Assimp from memory: it sees the scene's files and no others. */

/* ---- Assimp's file system ---- */

struct vfs {
	struct aiFileIO io;
	const struct scene_files *files;
	const struct scene_file *model;
	bool library;                 /* a material library was opened */
	char missing[SCENE_PATH_MAX]; /* one that was looked for in vain; "": none */
};

struct open_file {
	struct aiFile file;
	const struct scene_file *content;
	size_t at;
};

static struct open_file *opened(struct aiFile *file)
{
	return (struct open_file *)(void *)file->UserData;
}

static size_t file_read(struct aiFile *file, char *to, size_t size, size_t count)
{
	struct open_file *f = opened(file);
	const size_t left = f->content->size - f->at, n = size ? left / size : 0, got = n < count ? n : count;
	memcpy(to, f->content->data + f->at, got * size);
	f->at += got * size;
	return got;
}

static size_t file_write(struct aiFile *file, const char *from, size_t size, size_t count)
{
	(void)file, (void)from, (void)size, (void)count;
	return 0;
}

static size_t file_tell(struct aiFile *file)
{
	return opened(file)->at;
}

static size_t file_size(struct aiFile *file)
{
	return opened(file)->content->size;
}

static enum aiReturn file_seek(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
	struct open_file *f = opened(file);
	const size_t size = f->content->size;
	const size_t from = origin == aiOrigin_SET ? 0 : origin == aiOrigin_CUR ? f->at : size;
	/* Assimp seeks backwards by wrapping round. */
	if (from + offset > size)
		return aiReturn_FAILURE;
	f->at = from + offset;
	return aiReturn_SUCCESS;
}

static void file_flush(struct aiFile *file)
{
	(void)file;
}

static struct aiFile *file_open(struct aiFileIO *io, const char *name, const char *mode)
{
	struct vfs *vfs = (struct vfs *)(void *)io->UserData;
	const bool library = strcmp(name, vfs->model->name) != 0;
	const struct scene_file *content = mode[0] != 'r' ? NULL
					   : library      ? scene_files_find(vfs->files, name)
							  : vfs->model;
	struct open_file *f = content ? calloc(1, sizeof *f) : NULL;
	if (library && f)
		vfs->library = true;
	else if (library && !vfs->missing[0])
		snprintf(vfs->missing, sizeof vfs->missing, "%s", name);
	if (!f)
		return NULL;
	f->content = content;
	f->file = (struct aiFile){ file_read, file_write, file_tell, file_size, file_seek, file_flush,
		(aiUserData)(void *)f };
	return &f->file;
}

static void file_close(struct aiFileIO *io, struct aiFile *file)
{
	(void)io;
	if (file)
		free(opened(file));
}

/* ---- materials ---- */

static void colour_of(const struct aiMaterial *material, const char *key, float out[3])
{
	struct aiColor4D c;
	if (aiGetMaterialColor(material, key, 0, 0, &c) != aiReturn_SUCCESS)
		return;
	out[0] = c.r;
	out[1] = c.g;
	out[2] = c.b;
}

static float number_of(const struct aiMaterial *material, const char *key, float fallback)
{
	float value = fallback;
	unsigned n = 1;
	return aiGetMaterialFloatArray(material, key, 0, 0, &value, &n) == aiReturn_SUCCESS && n == 1 ? value
												      : fallback;
}

/* The name of a texture; false where the material has none of that kind. */
static bool texture_of(const struct aiMaterial *material, enum aiTextureType type, char name[SCENE_PATH_MAX])
{
	struct aiString path;
	if (aiGetMaterialTexture(material, type, 0, &path, NULL, NULL, NULL, NULL, NULL, NULL) != aiReturn_SUCCESS)
		return false;
	snprintf(name, SCENE_PATH_MAX, "%.199s", path.data);
	return name[0];
}

static bool add_textures(const struct scene_files *files, const struct aiMaterial *from, struct mesh_material *m,
	struct mesh_build *build, struct error *err)
{
	char name[SCENE_PATH_MAX];
	if (texture_of(from, aiTextureType_DIFFUSE, name)) {
		m->albedo_texture = scene_png_texture(files, name, TEXTURE_COLOUR, 1, build, err);
		if (m->albedo_texture < 0)
			return false;
	}
	if (texture_of(from, aiTextureType_NORMALS, name)) {
		m->normal_texture = scene_png_texture(files, name, TEXTURE_NORMALS, 1, build, err);
		return m->normal_texture >= 0;
	}
	if (texture_of(from, aiTextureType_HEIGHT, name)) {
		m->normal_texture = scene_png_texture(
			files, name, TEXTURE_BUMPS, number_of(from, "$mat.bumpscaling", 1), build, err);
		return m->normal_texture >= 0;
	}
	return true;
}

static bool all_finite(const float *values, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (!isfinite(values[i]))
			return false;
	return true;
}

static bool add_material(const struct scene_files *files, const struct aiMaterial *from, struct mesh_build *build,
	struct scene_about *about, struct error *err)
{
	struct mesh_material m = mesh_build_plain();
	struct aiString name = { 0 };
	aiGetMaterialString(from, AI_MATKEY_NAME, &name);
	colour_of(from, "$clr.ambient", m.ambient);
	colour_of(from, "$clr.diffuse", m.diffuse);
	colour_of(from, "$clr.specular", m.specular);
	m.shininess = number_of(from, "$mat.shininess", m.shininess);
	m.opacity = number_of(from, "$mat.opacity", m.opacity);
	if (!all_finite(m.ambient, offsetof(struct mesh_material, albedo_texture) / sizeof(float)))
		return error_set(err, "the material %.40s has a number that is not finite", name.data);
	if (!add_textures(files, from, &m, build, err))
		return false;
	const int index = mesh_build_material(build, &m, err);
	if (index >= 0 && index < SCENE_MATERIALS_LISTED)
		snprintf(about->materials[index], sizeof about->materials[index], "%.47s", name.data);
	return index >= 0;
}

/* ---- triangles ---- */

/* Beyond this metres are lost to single precision, and squares of areas overflow soon after. */
static const float farthest_m = 1e8F;

static bool take_vertex(const struct aiMesh *mesh, unsigned index, char up, struct mesh_vertex *v, struct error *err)
{
	const struct aiVector3D *p = &mesh->mVertices[index];
	const struct aiVector3D *n = mesh->mNormals ? &mesh->mNormals[index] : NULL;
	const struct aiVector3D *t = mesh->mTextureCoords[0] ? &mesh->mTextureCoords[0][index] : NULL;
	*v = (struct mesh_vertex){ { p->x, up == 'z' ? p->z : p->y, up == 'z' ? -p->y : p->z }, { 0 },
		{ t ? t->x : 0, t ? t->y : 0 } };
	if (n) {
		v->normal[0] = n->x;
		v->normal[1] = up == 'z' ? n->z : n->y;
		v->normal[2] = up == 'z' ? -n->y : n->z;
	}
	if (!all_finite(v->position, sizeof *v / sizeof(float)))
		return error_set(err, "a vertex has a number that is not finite");
	for (int k = 0; k < 3; k++)
		if (fabsf(v->position[k]) > farthest_m)
			return error_set(err, "a vertex is %g m away from the origin; 1e8 m are allowed",
				(double)fabsf(v->position[k]));
	return true;
}

static bool add_mesh(const struct aiMesh *mesh, char up, struct mesh_build *build, struct error *err)
{
	if (!mesh_build_reserve(build, (size_t)mesh->mNumFaces * 3, (size_t)mesh->mNumFaces * 3, err))
		return false;
	for (unsigned f = 0; f < mesh->mNumFaces; f++) {
		const struct aiFace *face = &mesh->mFaces[f];
		uint32_t corner[3];
		if (face->mNumIndices != 3)
			continue; /* points and lines have no surface */
		for (int k = 0; k < 3; k++) {
			struct mesh_vertex v;
			if (face->mIndices[k] >= mesh->mNumVertices)
				return error_set(err, "a face refers to a vertex that is not there");
			if (!take_vertex(mesh, face->mIndices[k], up, &v, err))
				return false;
			corner[k] = mesh_build_vertex(build, &v);
		}
		mesh_build_triangle(build, corner[0], corner[1], corner[2]);
	}
	return true;
}

static bool add_scene(const struct scene_files *files, const struct aiScene *scene, struct mesh_build *build,
	struct scene_about *about, struct error *err)
{
	for (unsigned m = 0; m < scene->mNumMaterials; m++) {
		const size_t before = build->n_indices;
		bool used = false;
		for (unsigned i = 0; i < scene->mNumMeshes; i++)
			if (scene->mMeshes[i]->mMaterialIndex == m) {
				used = true;
				if (!add_mesh(scene->mMeshes[i], about->up, build, err))
					return false;
			}
		/* Assimp adds a material of its own that nothing uses. */
		if (!used || before == build->n_indices)
			continue;
		if (!add_material(files, scene->mMaterials[m], build, about, err) ||
			!mesh_build_part(build, (uint32_t)build->n_materials - 1, err))
			return false;
	}
	return true;
}

/* A face in the last line that lost its end, as a file does that was cut off while it was copied. */
static bool cut_short(const struct scene_file *file)
{
	const unsigned char *data = file->data;
	size_t n = file->size;
	if (!n || data[n - 1] == '\n')
		return false;
	size_t line = n;
	while (line && data[line - 1] != '\n')
		line--;
	int words = 0;
	bool space = true;
	for (size_t i = line; i < n; i++) {
		const bool blank = data[i] == ' ' || data[i] == '\t' || data[i] == '\r';
		words += space && !blank;
		space = blank;
	}
	return (data[line] == 'f' || data[line] == 'v') && words < 4 && words > 0 &&
	       !(data[line + 1] == 't' && words > 2);
}

bool scene_obj_read(const struct scene_files *files, const struct scene_file *model, struct mesh_build *build,
	struct scene_about *about, struct error *err)
{
	struct vfs vfs = { .files = files, .model = model };
	vfs.io = (struct aiFileIO){ file_open, file_close, (aiUserData)(void *)&vfs };
	if (cut_short(model))
		return error_set(err, "%.150s is cut short: its last line is not complete", model->name);
	const struct aiScene *scene = aiImportFileEx(model->name, aiProcess_Triangulate, &vfs.io);
	if (!scene)
		return error_set(err, "%.150s: %.300s", model->name, aiGetErrorString());
	bool sound = true;
	if (vfs.missing[0] && !vfs.library)
		sound = error_set(err, "%.150s: the material library %.150s is missing", model->name, vfs.missing);
	sound = sound && add_scene(files, scene, build, about, err);
	aiReleaseImport(scene);
	return sound && mesh_build_mend(build, err) && mesh_build_weld(build, err);
}
