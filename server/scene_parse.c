#include "server/scene_parse.h"

#include <math.h>
#include <string.h>

/* The only file with that suffix; NULL with *n of them. */
static const struct scene_file *only_file(const struct scene_files *files, const char *suffix, int *n)
{
	const struct scene_file *found = NULL;
	*n = 0;
	for (size_t i = 0; i < files->n; i++)
		if (scene_file_has_suffix(files->list[i].name, suffix)) {
			found = &files->list[i];
			++*n;
		}
	return *n == 1 ? found : NULL;
}

static const struct scene_file *find_model(
	const struct scene_files *files, const struct scene_description *d, struct error *err)
{
	int n;
	if (d->model[0]) {
		const struct scene_file *file = scene_files_find(files, d->model);
		if (!file)
			error_set(err, "the model %.150s is missing", d->model);
		return file;
	}
	const struct scene_file *file = only_file(files, ".obj", &n);
	if (n == 0)
		error_set(err, "there is no Wavefront OBJ, and no scene.json that names a height map");
	else if (n > 1)
		error_set(err, "there are %d OBJ files; a scene.json has to say which is the \"model\"", n);
	return file;
}

/* A painted map of clouds. */
static bool read_weather(const struct scene_files *files, struct mesh_build *build, struct error *err)
{
	if (!scene_files_find(files, "weather.png"))
		return true;
	build->weather = 1 + scene_png_texture(files, "weather.png", TEXTURE_NUMBERS, 1, build, err);
	return build->weather > 0;
}

/* Does it hold what clouds are made from? It may be all. */
static bool for_clouds(const struct mesh_build *build)
{
	return build->weather || build->base_volume || build->detail_volume;
}

static bool any_model(const struct scene_files *files)
{
	int n;
	only_file(files, ".obj", &n);
	return n > 0;
}

static bool parse(
	const struct scene_files *files, struct mesh_build *build, struct scene_about *about, struct error *err)
{
	struct scene_description d = { 0 };
	*about = (struct scene_about){ NAN, NAN, NAN, NAN, NAN, .up = 'y' };
	const struct scene_file *json = scene_files_find(files, "scene.json");
	if (json && !scene_json_read(json, &d, about, err))
		return false;
	if (!read_weather(files, build, err) || !scene_volumes_read(files, build, err))
		return false;
	if (for_clouds(build) && !d.heightmap[0] && !d.model[0] && !any_model(files))
		return true;
	if (d.heightmap[0])
		return scene_heightmap_read(files, &d, build, err);
	const struct scene_file *model = find_model(files, &d, err);
	return model && scene_obj_read(files, model, build, about, err);
}

bool scene_parse(
	const struct scene_files *files, struct mesh_build *build, struct scene_about *about, struct error *err)
{
	if (parse(files, build, about, err))
		return true;
	/* It quotes names from the files: one line whatever is in them. */
	for (char *c = err->text; *c; c++)
		if ((unsigned char)*c < 0x20 || *c == 0x7F)
			*c = '?';
	return false;
}
