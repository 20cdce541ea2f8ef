/* Reading scenes: what comes of sound files, what is said of those at fault, and that the process that reads them can
 * do nothing else. In this process, and through `welkin loader`. */
#include "server/bundle.h"
#include "server/loader.h"
#include "tests/lib_http.h"
#include "tests/lib_scene_dir.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static const char any_key[33] = "0123456789abcdef0123456789abcdef";
static const struct mesh_limits limits = { 3000000, 4096, (uint64_t)512 << 20 };

/* ---- in this process ---- */

struct read {
	bool sound;
	struct error err;
	struct mesh_build build;
	struct scene_about about;
};

static struct read read_list(const struct scene_file *list, size_t n)
{
	struct scene_file copy[8];
	memcpy(copy, list, n * sizeof *copy);
	const struct scene_files files = { .list = copy, .n = n };
	struct read r = { .build.limits = limits };
	r.sound = scene_parse(&files, &r.build, &r.about, &r.err);
	return r;
}

static struct read read_obj(const char *obj)
{
	return read_list(&(struct scene_file){ "a.obj", (const unsigned char *)obj, strlen(obj) }, 1);
}

static void expect_fault(struct read r, const char *part)
{
	if (r.sound)
		fail_msg("read without a fault, which should say \"%s\"", part);
	if (!strstr(r.err.text, part))
		fail_msg("\"%s\" does not say \"%s\"", r.err.text, part);
	mesh_build_finish(&r.build);
}

static void expect_sound(const struct read *r, size_t triangles)
{
	if (!r->sound)
		fail_msg("%s", r->err.text);
	assert_int_equal(r->build.n_indices, 3 * triangles);
}

static double area(const struct mesh_build *b)
{
	double sum = 0;
	for (size_t i = 0; i < b->n_indices; i += 3) {
		double u[3], v[3], n2 = 0;
		for (int k = 0; k < 3; k++) {
			const float p = b->vertices[b->indices[i]].position[k];
			u[k] = (double)b->vertices[b->indices[i + 1]].position[k] - p;
			v[k] = (double)b->vertices[b->indices[i + 2]].position[k] - p;
		}
		for (int k = 0; k < 3; k++)
			n2 += pow(u[k] * v[(k + 1) % 3] - u[(k + 1) % 3] * v[k], 2);
		sum += sqrt(n2) / 2;
	}
	return sum;
}

static void test_triangles_of_an_obj(void **state)
{
	(void)state;
	struct read r = read_obj("v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvn 0 2 0\nf 1//1 4//1 3//1 2//1\n");
	expect_sound(&r, 2);
	assert_int_equal(r.build.n_vertices, 4); /* shared */
	for (size_t i = 0; i < 4; i++)
		assert_true(r.build.vertices[i].normal[1] == 1); /* made a unit */
	assert_true(fabs(area(&r.build) - 1) < 1e-6);
	mesh_build_finish(&r.build);
	/* Backwards, with a byte order mark, carriage returns, tabs, a continued line and no end. */
	r = read_obj("\xEF\xBB\xBFo a\r\nv 0 0 0\r\nv\t1 0 0\r\nv 0 0 \\\r\n 1e0 # here\r\ng b\r\nf -3 -1 -2");
	expect_sound(&r, 1);
	assert_true(r.build.vertices[0].normal[1] == 1); /* computed */
	mesh_build_finish(&r.build);
	/* A star with five points, which no fan of triangles covers, standing upright. */
	r = read_obj(
		"v 0 3 0\nv -.7 1 0\nv -2.9 .9 0\nv -1.1 -.4 0\nv -1.8 -2.4 0\nv 0 -1.2 0\nv 1.8 -2.4 0\nv 1.1 -.4 0\n"
		"v 2.9 .9 0\nv .7 1 0\nf 1 2 3 4 5 6 7 8 9 10\n");
	expect_sound(&r, 8);
	assert_true(fabs(area(&r.build) - 10.60) < 0.01); /* by the shoelace formula */
	mesh_build_finish(&r.build);
}

/* Smooth over a bend of 20°, sharp over one of 90°. */
static void test_normals_that_are_not_given(void **state)
{
	(void)state;
	struct read r = read_obj("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 1\nv 2 .36 0\nv 2 .36 1\nf 1 3 4 2\nf 2 4 6 5\n");
	expect_sound(&r, 4);
	assert_int_equal(r.build.n_vertices, 6);
	mesh_build_finish(&r.build);
	r = read_obj("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 1\nv 1 1 0\nv 1 1 1\nf 1 3 4 2\nf 2 4 6 5\n");
	expect_sound(&r, 4);
	assert_int_equal(r.build.n_vertices, 8);
	mesh_build_finish(&r.build);
}

static void test_what_has_no_area_goes(void **state)
{
	(void)state;
	struct read r = read_obj("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 2 0 0\nf 1 2 4\nf 1 1 2\nf 1 3 2\n");
	expect_sound(&r, 1);
	mesh_build_finish(&r.build);
	r = read_obj("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
	assert_true(r.sound);
	struct error err = { "" };
	assert_false(mesh_build_write(&r.build, -1, any_key, &err));
	assert_non_null(strstr(err.text, "no triangle"));
	mesh_build_finish(&r.build);
}

static void test_faults_of_an_obj(void **state)
{
	(void)state;
	static const char *const cases[][2] = {
		{ "", "no faces" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 4\n", "a.obj, line 4: there is no vertex 4 among the 3" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 0\n", "no vertex 0" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf -1 -2 -4\n", "no vertex -4" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 18446744073709551617\n", "no vertex" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1/1 2/1 3/1\n", "no texture coordinate 1 among the 0" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1//7 2//7 3//7\n", "no normal 7" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2\n", "a face with 2 corners" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 x\n", "\"x\" is not a corner" },
		{ "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3x\n", "is not a corner" },
		{ "v nan 0 0\n", "line 1: \"nan\" is not a number" },
		{ "v inf 0 0\n", "\"inf\" is not a number" },
		{ "v 1e39 0 0\n", "too large" },
		{ "v 1e999999999999 0 0\n", "too large" },
		{ "v 2e8 0 0\n", "1e8 m" },
		{ "v 0 0\n", "a number is missing" },
		{ "v 0 0 0\nvn 0 0", "line 2: a number is missing" },
		{ "mtllib a.mtl\n", "the material library a.mtl is missing" },
	};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
		expect_fault(read_obj(cases[i][0]), cases[i][1]);
	static const unsigned char utf16[] = { 0xFF, 0xFE, 'v', 0, ' ', 0 };
	expect_fault(read_list(&(struct scene_file){ "a.obj", utf16, sizeof utf16 }, 1), "not a text file");
	expect_fault(read_list(&(struct scene_file){ "a.txt", utf16, sizeof utf16 }, 1), "no Wavefront OBJ");
	const struct scene_file two[] = { { "a.obj", utf16, 0 }, { "b/B.OBJ", utf16, 0 } };
	expect_fault(read_list(two, 2), "2 OBJ files");
}

static void test_limits(void **state)
{
	(void)state;
	struct scene_file file = { "a.obj", NULL, 0 };
	const char obj[] = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\n";
	file.data = (const unsigned char *)obj;
	file.size = sizeof obj - 1;
	const struct scene_files files = { .list = &file, .n = 1 };
	struct read r = { .build.limits = { 1, 16, 1 << 20 } };
	r.sound = scene_parse(&files, &r.build, &r.about, &r.err);
	expect_fault(r, "more than the 1 triangles");
	r = (struct read){ .build.limits = { 2, 16, 300 } };
	r.sound = scene_parse(&files, &r.build, &r.about, &r.err);
	assert_true(r.sound);
	assert_false(mesh_build_write(&r.build, -1, any_key, &r.err));
	r.sound = false;
	expect_fault(r, "are allowed");
}

/* ---- materials and textures ---- */

static const unsigned char pixels[] = { 255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255 };

static struct read read_material(const char *mtl, const unsigned char *png, size_t png_size)
{
	const struct scene_file list[] = { { "a.obj", (const unsigned char *)scene_square_obj,
						   strlen(scene_square_obj) },
		{ "a.mtl", (const unsigned char *)mtl, strlen(mtl) }, { "textures/t.png", png, png_size } };
	return read_list(list, png ? 3 : 2);
}

static void test_materials(void **state)
{
	(void)state;
	size_t size;
	unsigned char *png = scene_png(2, 2, 8, 2, pixels, &size);
	struct read r = read_material(
		"# c\nnewmtl other\nKd 0 0 0\nnewmtl stone\nKa .1 .2 .3\nKd .4 .5 .6\nKs .7\nNs 12\nd 0.25\n"
		"illum 2\nmap_Kd -s 1 1 -o 0.5 C:\\art\\T.PNG\nnorm ./textures/t.png\n",
		png, size);
	expect_sound(&r, 2);
	assert_int_equal(r.build.n_materials, 1); /* what nothing has is not there */
	assert_string_equal(r.about.materials[0], "stone");
	const struct mesh_material *m = &r.build.materials[0];
	assert_true(m->ambient[1] == 0.2F && m->diffuse[2] == 0.6F && m->specular[2] == 0.7F && m->shininess == 12);
	assert_true(m->opacity == 0.25F);
	assert_int_equal(m->albedo_texture, 0);
	assert_int_equal(m->normal_texture, 1);
	const struct build_texture *t = &r.build.textures[0];
	assert_true(t->srgb && !r.build.textures[1].srgb);
	assert_int_equal(t->width, 2);
	const unsigned char rgba[] = { 255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255 };
	assert_memory_equal(t->pixels, rgba, sizeof rgba);
	mesh_build_finish(&r.build);
	free(png);
}

/* map_d becomes the alpha of the colours: its grey, or its own alpha; without colours these are white. */
static void test_opacity_maps(void **state)
{
	(void)state;
	const unsigned char grey[4] = { 0, 80, 160, 255 };
	size_t size;
	unsigned char *png = scene_png(2, 2, 8, 0, grey, &size);
	struct read r = read_material("newmtl stone\nKd .4 .5 .6\nmap_d -imfchan l t.png\n", png, size);
	expect_sound(&r, 2);
	const struct mesh_material *m = &r.build.materials[0];
	assert_true(m->alpha == 1 && m->opacity == 1 && m->albedo_texture == 0 && r.build.textures[0].srgb);
	for (int i = 0; i < 4; i++) {
		const unsigned char white[4] = { 255, 255, 255, grey[i] };
		assert_memory_equal(r.build.textures[0].pixels + 4 * i, white, 4);
	}
	mesh_build_finish(&r.build);
	free(png);
}

/* Grey bumps that rise to the east tilt the normal to the west. */
static void test_bumps_become_normals(void **state)
{
	(void)state;
	static const unsigned char ramp[] = { 0, 60, 120, 180, 0, 60, 120, 180, 0, 60, 120, 180, 0, 60, 120, 180 };
	size_t size;
	unsigned char *png = scene_png(4, 4, 8, 0, ramp, &size);
	struct read r = read_material("newmtl stone\nmap_Bump -bm 4 t.png\n", png, size);
	expect_sound(&r, 2);
	const unsigned char *n = r.build.textures[r.build.materials[0].normal_texture].pixels + 4 * (4 + 1);
	/* slope 4 · 120 / 510 over a texel */
	const double slope = 4 * 120 / 510.0, length = sqrt(1 + slope * slope);
	assert_true(fabs(n[0] - (127.5 - 127.5 * slope / length)) < 1);
	assert_true(fabs(n[1] - 127.5) < 1);
	assert_true(fabs(n[2] - (127.5 + 127.5 / length)) < 1);
	mesh_build_finish(&r.build);
	free(png);
}

/* Hills of N by N posts, 10 m apart, and a map of slopes: theirs, or others that know nothing of them; upright: the
 * hills stand up as a wall. */
static bool level_normals(bool theirs, bool upright)
{
	enum { N = 24 };
	unsigned char rows[N * N * 3];
	char *text = malloc(N * N * 128), *at = text;
	assert_non_null(text);
	at += sprintf(at, "mtllib a.mtl\nusemtl stone\n");
	for (int j = 0; j < N; j++)
		for (int i = 0; i < N; i++) {
			const double h = 12 * sin(0.5 * i) * cos(0.4 * j),
				     s[2] = { 0.6 * cos(0.5 * i) * cos(0.4 * j), 0.48 * sin(0.5 * i) * sin(0.4 * j) };
			at += upright ? sprintf(at, "v %d %d %g\nvt %g %g\n", 10 * i, -10 * j, h, (i + 0.5) / N,
						1 - (j + 0.5) / N)
				      : sprintf(at, "v %d %g %d\nvt %g %g\n", 10 * i, h, 10 * j, (i + 0.5) / N,
						1 - (j + 0.5) / N);
			/* to the east and to the north; the others are of twice the frequency */
			const double e = theirs ? s[0] : 0.5 * cos(1.0 * i), n = theirs ? s[1] : 0.5 * cos(0.8 * j),
				     length = sqrt(1 + e * e + n * n);
			rows[3 * (j * N + i)] = (unsigned char)lround(127.5 - 127.5 * e / length);
			rows[3 * (j * N + i) + 1] = (unsigned char)lround(127.5 - 127.5 * n / length);
			rows[3 * (j * N + i) + 2] = (unsigned char)lround(127.5 + 127.5 / length);
		}
	for (int j = 0; j + 1 < N; j++)
		for (int i = 1; i < N; i++) {
			const int a = j * N + i, b = a + N;
			at += sprintf(at, "f %d/%d %d/%d %d/%d %d/%d\n", a, a, b, b, b + 1, b + 1, a + 1, a + 1);
		}
	size_t size;
	unsigned char *png = scene_png(N, N, 8, 2, rows, &size);
	static const char mtl[] = "newmtl stone\nnorm t.png\n";
	const struct scene_file list[] = { { "a.obj", (const unsigned char *)text, (size_t)(at - text) },
		{ "a.mtl", (const unsigned char *)mtl, strlen(mtl) }, { "t.png", png, size } };
	struct read r = read_list(list, 3);
	expect_sound(&r, 2 * (N - 1) * (N - 1));
	const bool level = r.build.materials[0].level_normals;
	mesh_build_finish(&r.build);
	free(png);
	free(text);
	return level;
}

/* A normal map made of a terrain's own heights would have its slopes twice on the mesh's normals. */
static void test_normal_maps_of_terrain(void **state)
{
	(void)state;
	assert_true(level_normals(true, false));
	assert_false(level_normals(false, false));
	assert_false(level_normals(true, true));
}

static void test_faults_of_materials(void **state)
{
	(void)state;
	size_t size, bomb_size;
	unsigned char *png = scene_png(2, 2, 8, 2, pixels, &size);
	expect_fault(read_material("Kd 1 1 1\nnewmtl stone\n", NULL, 0), "a.mtl, line 1: Kd before the first newmtl");
	expect_fault(read_material("newmtl stone\nKd a\n", NULL, 0), "\"a\" is not a number");
	expect_fault(read_material("newmtl stone\nNs\n", NULL, 0), "a number is missing");
	expect_fault(read_material("newmtl stone\nmap_Kd\n", NULL, 0), "a map needs the name of a file");
	expect_fault(read_material("newmtl stone\nmap_Kd no.png\n", png, size), "the texture no.png is missing");
	for (size_t cut = 0; cut < size - 12; cut += 7)
		expect_fault(read_material("newmtl stone\nmap_Kd t.png\n", png, cut), "t.png");
	/* A file of 16 KiB that would take a gigabyte: told by its header. */
	unsigned char *rows = calloc(4, 20000);
	unsigned char *bomb = scene_png(20000, 1, 8, 6, rows, &bomb_size);
	expect_fault(read_material("newmtl stone\nmap_Kd t.png\n", bomb, bomb_size), "up to 4096 by 4096");
	free(rows);
	free(bomb);
	free(png);
}

/* ---- height maps and scene.json ---- */

static void put_height(unsigned char *at, unsigned value)
{
	at[0] = (unsigned char)(value >> 8);
	at[1] = (unsigned char)value;
}

static struct read read_json(const char *json, const unsigned char *png, size_t size)
{
	const struct scene_file list[] = { { "scene.json", (const unsigned char *)json, strlen(json) },
		{ "h.png", png, size }, { "a.obj", (const unsigned char *)scene_square_obj, strlen(scene_square_obj) },
		{ "a.mtl", (const unsigned char *)"newmtl stone\n", 13 } };
	return read_list(list, 4);
}

static void test_height_map(void **state)
{
	(void)state;
	unsigned char heights[3 * 2 * 2];
	size_t size;
	for (unsigned i = 0; i < 6; i++) /* a plane that rises 100 m per 10 m to the south */
		put_height(heights + 2 * i, i < 3 ? 0 : 65535);
	unsigned char *png = scene_png(3, 2, 16, 0, heights, &size);
	struct read r = read_json("{\"heightmap\":{\"file\":\"h.png\",\"spacing_m\":10,\"low_m\":-50,\"high_m\":50},"
				  "\"latitude_deg\":47.5,\"title\":\"A plane\"}",
		png, size);
	expect_sound(&r, 4);
	const struct mesh_vertex *v = r.build.vertices;
	assert_true(v[0].position[0] == -10 && v[0].position[1] == -50 && v[0].position[2] == -5);
	assert_true(v[5].position[0] == 10 && v[5].position[1] == 50 && v[5].position[2] == 5);
	assert_true(fabs(v[4].normal[1] - 1 / sqrt(101)) < 1e-6 && v[4].normal[2] < -0.99F);
	assert_true(v[0].uv[1] == 1 && v[5].uv[0] == 1);
	assert_true(r.about.latitude_deg == 47.5 && isnan(r.about.longitude_deg));
	assert_string_equal(r.about.title, "A plane");
	mesh_build_finish(&r.build);
	free(png);
	png = scene_png(3, 2, 8, 0, heights, &size);
	expect_fault(
		read_json("{\"heightmap\":{\"file\":\"h.png\",\"spacing_m\":10,\"low_m\":0,\"high_m\":50}}", png, size),
		"16-bit greyscale");
	free(png);
}

static void test_faults_of_scene_json(void **state)
{
	(void)state;
	static const char *const cases[][2] = {
		{ "[]", "not a JSON object" },
		{ "{", "not a JSON object" },
		{ "{\"latitude\":5}", "there is no \"latitude\"" },
		{ "{\"latitude_deg\":95}", "-90 to 90" },
		{ "{\"latitude_deg\":\"5\"}", "has to be a number" },
		{ "{\"title\":5}", "has to be a string" },
		{ "{\"title\":\"\xFF\"}", "has to be a string" },
		{ "{\"up\":\"x\"}", "\"y\" or \"z\"" },
		{ "{\"model\":\"b.obj\"}", "the model b.obj is missing" },
		{ "{\"heightmap\":{\"file\":\"h.png\"}}", "a height map needs" },
		{ "{\"heightmap\":{\"file\":\"h.png\",\"spacing_m\":1,\"low_m\":5,\"high_m\":5}}", "above" },
		{ "{\"heightmap\":{\"file\":\"x.png\",\"spacing_m\":1,\"low_m\":0,\"high_m\":5}}", "x.png is missing" },
		{ "{\"heightmap\":{\"size\":1}}", "there is no \"heightmap\": {\"size\"}" },
	};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
		expect_fault(read_json(cases[i][0], pixels, 8), cases[i][1]);
}

static void test_the_up_axis(void **state)
{
	(void)state;
	struct read r = read_json("{\"up\":\"z\"}", pixels, 0);
	expect_sound(&r, 2);
	/* the square at y = 3 stands upright to the north */
	for (size_t i = 0; i < r.build.n_vertices; i++)
		assert_true(r.build.vertices[i].position[2] == -3);
	mesh_build_finish(&r.build);
}

/* ---- scenes that are made ---- */

static void test_made_scenes(void **state)
{
	(void)state;
	static const struct {
		const char *name;
		size_t least, most;
	} scenes[] = { { "mountains", 96000, 100000 }, { "city", 11500, 12500 } };
	for (size_t i = 0; i < 2; i++) {
		struct mesh_build a = { .limits = limits }, b = { .limits = limits };
		struct scene_about about;
		struct error err;
		assert_true(
			scene_make(scenes[i].name, &a, &about, &err) && scene_make(scenes[i].name, &b, &about, &err));
		assert_in_range(a.n_indices / 3, scenes[i].least, scenes[i].most);
		assert_int_equal(a.n_vertices, b.n_vertices);
		assert_memory_equal(a.vertices, b.vertices, a.n_vertices * sizeof *a.vertices);
		const int fd = memfd_create("made", 0);
		assert_true(mesh_build_write(&a, fd, any_key, &err));
		const off_t size = lseek(fd, 0, SEEK_END);
		void *map = mmap(NULL, (size_t)size, PROT_READ, MAP_SHARED, fd, 0);
		assert_true(mesh_valid(map, (size_t)size));
		munmap(map, (size_t)size);
		close(fd);
		mesh_build_finish(&a);
		mesh_build_finish(&b);
	}
	struct mesh_build none = { .limits = limits };
	struct scene_about about;
	struct error err;
	assert_false(scene_make("sea", &none, &about, &err));
}

/* ---- through the loader's process ---- */

static char dir[64];

static int make_dir(void **state)
{
	(void)state;
	scene_dir_make(dir);
	return 0;
}

static int remove_dir(void **state)
{
	(void)state;
	scene_dir_remove(dir);
	return 0;
}

static enum loaded load_folder(const char *folder, double timeout_s, size_t memory, struct error *err)
{
	const struct bundle_limits bounds = { limits, (uint64_t)1 << 30 };
	const struct loader_config config = {
		.program = daemon_binary(), .memory_bytes = memory, .timeout_s = timeout_s, .cancel_fd = -1
	};
	char key[33];
	int mesh_fd = -1;
	struct scene_about about;
	const int bundle = bundle_of_folder(folder, &bounds, key, err);
	if (bundle < 0)
		return LOAD_FAULT;
	const enum loaded loaded = loader_run(&config, bundle, key, &mesh_fd, &about, err);
	close(bundle);
	if (mesh_fd >= 0)
		close(mesh_fd);
	return loaded;
}

static const size_t plenty = (size_t)3 << 30;

static void test_a_folder_through_the_process(void **state)
{
	(void)state;
	struct error err = { "" };
	char folder[128], key[33], again[33];
	const struct bundle_limits bounds = { limits, (uint64_t)1 << 30 };
	scene_dir_text(dir, "square", "a.obj", scene_square_obj);
	scene_dir_text(dir, "square", "a.mtl", "newmtl stone\n");
	snprintf(folder, sizeof folder, "%s/square", dir);
	if (load_folder(folder, 60, plenty, &err) != LOADED)
		fail_msg("%s", err.text);
	const uint64_t before = bundle_folder_state(folder);
	close(bundle_of_folder(folder, &bounds, key, &err));
	/* Another file is another key; one that nothing reads is none. */
	scene_dir_text(dir, "square", "README.md", "hello");
	assert_int_equal(bundle_folder_state(folder), before);
	scene_dir_text(dir, "square", "a.mtl", "newmtl stone \n");
	assert_int_not_equal(bundle_folder_state(folder), before);
	close(bundle_of_folder(folder, &bounds, again, &err));
	assert_string_not_equal(key, again);
	scene_dir_text(dir, "square", "a.mtl", "newmtl stone\n");
	close(bundle_of_folder(folder, &bounds, again, &err));
	assert_string_equal(key, again);
}

/* A face whose corners take long to cut, and time that is short; a mesh for which memory is short. */
static void test_time_and_memory_end(void **state)
{
	(void)state;
	struct error err = { "" };
	char folder[128], *text = malloc(64 << 20), *at = text;
	assert_non_null(text);
	for (int i = 0; i < 1000000; i++)
		at += sprintf(at, "v %d 0 %d\n", i % 1000, i / 1000);
	for (int i = 1; i < 998000; i++)
		at += sprintf(at, "f %d %d %d\n", i, i + 1000, i + 1);
	scene_dir_text(dir, "large", "a.obj", text);
	free(text);
	snprintf(folder, sizeof folder, "%s/large", dir);
	assert_int_equal(load_folder(folder, 0.05, plenty, &err), LOAD_FAILED);
	assert_non_null(strstr(err.text, "too long"));
#if !defined(__SANITIZE_ADDRESS__)
	assert_int_not_equal(load_folder(folder, 60, (size_t)200 << 20, &err), LOADED);
	assert_true(err.text[0]);
#endif
}

/* Two million triangles of a height map, in half a GiB. */
static void test_a_large_height_map(void **state)
{
	(void)state;
	enum { N = 1025 };
	struct error err = { "" };
	char folder[128];
	size_t size;
	unsigned char *heights = malloc(2 * N * N);
	assert_non_null(heights);
	for (int i = 0; i < N * N; i++) {
		const unsigned h = (unsigned)(30000 + 20000 * sin(0.02 * (i % N)) * cos(0.017 * (double)(i / N)));
		heights[2 * i] = (unsigned char)(h >> 8);
		heights[2 * i + 1] = (unsigned char)h;
	}
	unsigned char *png = scene_png(N, N, 16, 0, heights, &size);
	scene_dir_write(dir, "dem", "h.png", png, size);
	scene_dir_text(dir, "dem", "scene.json",
		"{\"heightmap\":{\"file\":\"h.png\",\"spacing_m\":30,\"low_m\":0,\"high_m\":6553.5}}");
	free(png);
	free(heights);
	snprintf(folder, sizeof folder, "%s/dem", dir);
#if defined(__SANITIZE_ADDRESS__)
	const size_t memory = plenty;
#else
	const size_t memory = (size_t)512 << 20;
#endif
	if (load_folder(folder, 60, memory, &err) != LOADED)
		fail_msg("%s", err.text);
}

static void test_models_of_debian(void **state)
{
	(void)state;
	static const char *const models[][2] = {
		{ "OBJ/box.obj", "12" },
		{ "OBJ/concave_polygon.obj", "64" },
		{ "OBJ/regr01.obj", "2706" },
		{ "OBJ/WusonOBJ.obj", "3732" },
		{ "OBJ/box_without_lineending.obj", "12" },
		{ "OBJ/cube_usemtl.obj", "12" },
		{ "OBJ/cube_mtllib_after_g.obj", "12" },
		{ "OBJ/box_longline.obj", "478" },
		{ "OBJ/box_mat_with_spaces.obj", "12" },
		{ "OBJ/cube_with_vertexcolors.obj", "12" },
		{ "OBJ/cube_with_vertexcolors_uni.obj", "12" },
		{ "OBJ/empty_mat.obj", "256" },
		{ "OBJ/multiple_spaces.obj", "1" },
		{ "OBJ/regr_3429812.obj", "4" },
		{ "OBJ/space_in_material_name.obj", "64" },
		{ "OBJ/testmixed.obj", "12" },
		{ "OBJ/spider.obj", "the texture .\\wal67ar_small.jpg is missing" },
		{ "OBJ/box_UTF16BE.obj", "not one in UTF-8" },
		{ "OBJ/number_formats.obj", "is not a number" },
		{ "OBJ/point_cloud.obj", "no faces" },
		{ "OBJ/testline.obj", "no faces" },
		{ "OBJ/testpoints.obj", "no faces" },
		{ "invalid/empty.obj", "no faces" },
		{ "invalid/malformed.obj", "no vertex 12" },
		{ "invalid/malformed2.obj", "a face with 0 corners" },
	};
	if (access("/usr/share/assimp/models", R_OK)) {
		print_message("skipped: assimp-testmodels is not installed\n");
		skip();
	}
	for (size_t i = 0; i < sizeof models / sizeof *models; i++) {
		char command[512], path[128];
		struct error err = { "" };
		snprintf(path, sizeof path, "%s/models", dir);
		mkdir(path, 0755);
		/* the model and every library there is */
		snprintf(command, sizeof command,
			"rm -f %s/*; cp /usr/share/assimp/models/%s /usr/share/assimp/models/OBJ/*.mtl %s/", path,
			models[i][0], path);
		assert_int_equal(system(command), 0);
		const enum loaded loaded = load_folder(path, 60, plenty, &err);
		const bool wanted = models[i][1][0] >= '0' && models[i][1][0] <= '9';
		if (wanted ? loaded != LOADED : loaded != LOAD_FAULT || !strstr(err.text, models[i][1]))
			fail_msg("%s: %d %s", models[i][0], loaded, err.text);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_triangles_of_an_obj),
		cmocka_unit_test(test_normals_that_are_not_given),
		cmocka_unit_test(test_what_has_no_area_goes),
		cmocka_unit_test(test_faults_of_an_obj),
		cmocka_unit_test(test_limits),
		cmocka_unit_test(test_materials),
		cmocka_unit_test(test_opacity_maps),
		cmocka_unit_test(test_bumps_become_normals),
		cmocka_unit_test(test_normal_maps_of_terrain),
		cmocka_unit_test(test_faults_of_materials),
		cmocka_unit_test(test_height_map),
		cmocka_unit_test(test_faults_of_scene_json),
		cmocka_unit_test(test_the_up_axis),
		cmocka_unit_test(test_made_scenes),
		cmocka_unit_test_setup_teardown(test_a_folder_through_the_process, make_dir, remove_dir),
		cmocka_unit_test_setup_teardown(test_time_and_memory_end, make_dir, remove_dir),
		cmocka_unit_test_setup_teardown(test_a_large_height_map, make_dir, remove_dir),
		cmocka_unit_test_setup_teardown(test_models_of_debian, make_dir, remove_dir),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
