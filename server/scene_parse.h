#ifndef WELKIN_SERVER_SCENE_PARSE_H
#define WELKIN_SERVER_SCENE_PARSE_H

#include "server/scene_files.h"

/*
 * From a scene's files to a mesh: in the loader process, since every byte may be hostile. scene.json is optional beside
 * a Wavefront OBJ:
 *
 *     {"title": "…", "licence": "…", "source": "…",
 *      "latitude_deg": 35.36, "longitude_deg": 138.73, "altitude_m": 0, "heading_deg": 0, "scale": 1,
 *      "model": "x.obj", "up": "y" or "z",
 *      or "heightmap": {"file": "x.png", "spacing_m": 30, "low_m": 0, "high_m": 6553.5, "albedo": "y.png"}}
 */

enum { SCENE_MATERIALS_LISTED = 32 };

/* What is known of a scene beside its mesh: plain data, for it comes from the loader process. NaN: not said. */
struct scene_about {
	double latitude_deg, longitude_deg, altitude_m, heading_deg, scale;
	char title[96], licence[128], source[160];
	char materials[SCENE_MATERIALS_LISTED][48]; /* the first of them */
	char up;                                    /* 'y' or 'z' */
};

/* The pure part: nothing but memory. The reason is one line for whoever made the files. */
bool scene_parse(
	const struct scene_files *files, struct mesh_build *build, struct scene_about *about, struct error *err);

/* A scene that is made, by name. */
bool scene_make(const char *name, struct mesh_build *build, struct scene_about *about, struct error *err);

/* ---- between the files that implement it ---- */

struct scene_description {
	char model[SCENE_PATH_MAX];     /* "": the only OBJ there is */
	char heightmap[SCENE_PATH_MAX]; /* "": none */
	char albedo[SCENE_PATH_MAX];
	double spacing_m, low_m, high_m;
};

bool scene_json_read(const struct scene_file *file, struct scene_description *description, struct scene_about *about,
	struct error *err);
bool scene_obj_read(const struct scene_files *files, const struct scene_file *model, struct mesh_build *build,
	struct scene_about *about, struct error *err);
bool scene_heightmap_read(const struct scene_files *files, const struct scene_description *description,
	struct mesh_build *build, struct error *err);

/* Noise of clouds, noise_base and noise_detail as .png or .raw, where a folder has them (gpu/mesh.h says how they lie).
 * What does not repeat is refused: clouds would show the seam. */
bool scene_volumes_read(const struct scene_files *files, struct mesh_build *build, struct error *err);

enum texture_use { TEXTURE_COLOUR, TEXTURE_NORMALS, TEXTURE_BUMPS, TEXTURE_NUMBERS, TEXTURE_VOLUME };
/* The index in the build of that PNG, which a model refers to; -1 with the reason. Of bumps, grey heights become
 * normals; what has colours counts as normals. */
int scene_png_texture(const struct scene_files *files, const char *name, enum texture_use use, double bump_scale,
	struct mesh_build *build, struct error *err);
/* Colours with the opacity of another PNG as their alpha: its own alpha where it has any, else its grey. colours "":
 * white. */
int scene_png_with_opacity(const struct scene_files *files, const char *colours, const char *opacity,
	struct mesh_build *build, struct error *err);
/* 16-bit grey samples, malloc'd. */
uint16_t *scene_png_heights(
	const struct scene_file *file, uint32_t max_side, uint32_t *width, uint32_t *height, struct error *err);

#endif
