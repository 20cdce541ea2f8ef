/*
 * What C and GLSL share: every member of every uniform block lies where the driver says, every shader
 * compiles, and a fault in one is reported by file and line.
 */
#include "api/embed.h"
#include "gpu/scene.h"
#include "tests/lib_gpu.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

struct member {
	const char *name;
	size_t offset;
};

#define M(block, member)                                                                                               \
	{                                                                                                              \
#block "." #member, offsetof(struct block, member)                                                     \
	}
#define A(block, member)                                                                                               \
	{                                                                                                              \
#block "." #member "[0]", offsetof(struct block, member)                                               \
	}

static const struct member frame_members[] = { M(FrameBlock, camera_right), M(FrameBlock, camera_up),
	M(FrameBlock, camera_forward), M(FrameBlock, vertical), M(FrameBlock, sun_direction), M(FrameBlock, width),
	M(FrameBlock, height), M(FrameBlock, projection), M(FrameBlock, cube_face), M(FrameBlock, tan_half_fov),
	M(FrameBlock, fov), M(FrameBlock, camera_altitude), M(FrameBlock, sun_angular_radius),
	M(FrameBlock, exposure_scale), M(FrameBlock, tone_map), M(FrameBlock, dither), M(FrameBlock, seed),
	M(FrameBlock, features), M(FrameBlock, output_format), M(FrameBlock, sun_solid_angle), M(FrameBlock, reserved0),
	M(FrameBlock, limb), M(FrameBlock, limb_law), { 0 } };

static const struct member media_members[] = { M(MediaBlock, planet_radius), M(MediaBlock, top),
	M(MediaBlock, rayleigh_scale_height), M(MediaBlock, aerosol_scale_height), M(MediaBlock, ozone_center),
	M(MediaBlock, ozone_half_width), M(MediaBlock, aerosol_g), M(MediaBlock, aerosol_phase), M(MediaBlock, steps),
	M(MediaBlock, light_steps), M(MediaBlock, turbidity), M(MediaBlock, sun_intensity),
	M(MediaBlock, aerosol_moments), M(MediaBlock, aerosol_higher), A(MediaBlock, rule), { 0 } };

static const struct member bands_members[] = { M(BandsBlock, wavelength), M(BandsBlock, sun_irradiance),
	M(BandsBlock, rayleigh), M(BandsBlock, aerosol_scattering), M(BandsBlock, aerosol_extinction),
	M(BandsBlock, aerosol_scaled_extinction), M(BandsBlock, ozone), M(BandsBlock, ground_albedo),
	M(BandsBlock, red), M(BandsBlock, blue), A(BandsBlock, daylight), M(BandsBlock, daylight_luminance),
	M(BandsBlock, sun_luminance), A(BandsBlock, to_rgb), { 0 } };
static const struct member fitted_members[] = { A(FittedBlock, term), A(FittedBlock, depth), M(FittedBlock, ground),
	M(FittedBlock, least), M(FittedBlock, exponent), M(FittedBlock, geometry), { 0 } };

static const struct member surfaces_members[] = { A(SurfacesBlock, axis), M(SurfacesBlock, camera_high),
	M(SurfacesBlock, camera_low), M(SurfacesBlock, low), M(SurfacesBlock, high), M(SurfacesBlock, sun),
	A(SurfacesBlock, shadow_row), M(SurfacesBlock, shadow_reach), M(SurfacesBlock, shadow_texel),
	M(SurfacesBlock, shading), M(SurfacesBlock, shadow_filter), M(SurfacesBlock, shadow_cascades),
	M(SurfacesBlock, shadow_size), M(SurfacesBlock, shadow_depth), M(SurfacesBlock, shaft_steps),
	M(SurfacesBlock, shadow_region), M(SurfacesBlock, shaft_phi), M(SurfacesBlock, shaft_range),
	M(SurfacesBlock, shaft_reach), M(SurfacesBlock, see_through_root), M(SurfacesBlock, clouds_east),
	M(SurfacesBlock, clouds_south), M(SurfacesBlock, reserved1), { 0 } };

static GLint resource(GLuint program, GLenum interface, const char *name, GLenum property)
{
	const GLuint index = glGetProgramResourceIndex(program, interface, name);
	if (index == GL_INVALID_INDEX)
		fail_msg("the driver knows no %s", name);
	GLint value = -1;
	glGetProgramResourceiv(program, interface, index, 1, &property, 1, NULL, &value);
	return value;
}

static void check_block(const char *block, const struct member *members, int binding, size_t size)
{
	const GLuint id = lib_gpu_program("methods/preetham.comp", "")->id;
	GLint count = 0;
	for (const struct member *m = members; m->name; m++, count++) {
		const GLint offset = resource(id, GL_UNIFORM, m->name, GL_OFFSET);
		if ((size_t)offset != m->offset)
			fail_msg("%s is at %d, in C at %zu", m->name, offset, m->offset);
	}
	/* a member that this test does not know shows here */
	assert_int_equal(resource(id, GL_UNIFORM_BLOCK, block, GL_NUM_ACTIVE_VARIABLES), count);
	assert_int_equal(resource(id, GL_UNIFORM_BLOCK, block, GL_BUFFER_BINDING), binding);
	assert_int_equal(resource(id, GL_UNIFORM_BLOCK, block, GL_BUFFER_DATA_SIZE), size);
}

static void blocks_agree(void **state)
{
	(void)state;
	check_block("FrameBlock", frame_members, BIND_FRAME, sizeof(struct FrameBlock));
	check_block("MediaBlock", media_members, BIND_MEDIA, sizeof(struct MediaBlock));
	check_block("BandsBlock", bands_members, BIND_BANDS, sizeof(struct BandsBlock));
	check_block("SurfacesBlock", surfaces_members, BIND_SURFACES_BLOCK, sizeof(struct SurfacesBlock));
	check_block("FittedBlock", fitted_members, BIND_FITTED, sizeof(struct FittedBlock));
}

static void every_shader_compiles(void **state)
{
	(void)state;
	int n = 0;
	for (const struct embedded_file *f = welkin_embedded_shaders; f->name; f++) {
		const size_t length = strlen(f->name);
		if (length < 5 || strcmp(f->name + length - 5, ".comp") != 0)
			continue;
		assert_true(lib_gpu_program(f->name, "")->id > 0);
		n++;
	}
	static const char *const drawn[] = { "surfaces.vert", "shadow.vert" };
	for (int i = 0; i < 2; i++)
		assert_true(lib_gpu_program(drawn[i], "")->id > 0);
	static const char *const others[][2] = { { "surfaces.comp", "AERIAL_MARCH=1" },
		{ "surfaces_list.comp", "DRAWN=1" }, { "surfaces.comp", "SHADING=1 SHADOW_FILTER=3 PLAIN=1" },
		{ "shafts.comp", "EPIPOLAR=1 SCALED=0" }, { "shafts.comp", "EPIPOLAR=1 BEHIND=1" },
		{ "shafts.comp", "EPIPOLAR=0 SCALED=1" }, { "tables/shafts.comp", "SCALED=0" },
		{ "methods/reference.comp", "SCENE=1" } };
	for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
		assert_true(lib_gpu_program(others[i][0], others[i][1])->id > 0);
	assert_true(n >= 8);
	char choices[64];
	for (int projection = 0; projection <= PROJECTION_CUBEMAP; projection++) {
		snprintf(choices, sizeof choices, "PROJECTION=%d", projection);
		lib_gpu_program("rays.comp", choices);
		lib_gpu_program("sun_disk.comp", choices);
	}
	for (int format = 0; format <= OUTPUT_FLOAT; format++)
		for (int tone = 0; tone <= TONE_NONE; tone++) {
			snprintf(choices, sizeof choices, "FORMAT=%d TONE=%d LAYERS=%d", format, tone, format & 1);
			lib_gpu_program("output.comp", choices);
		}
}

static void a_program_is_made_once(void **state)
{
	(void)state;
	assert_ptr_equal(lib_gpu_program("rays.comp", ""), lib_gpu_program("rays.comp", ""));
	assert_ptr_not_equal(lib_gpu_program("rays.comp", ""), lib_gpu_program("rays.comp", "PROJECTION=1"));
}

static void write_file(const char *dir, const char *name, const char *text)
{
	char path[256];
	snprintf(path, sizeof path, "%s/%s", dir, name);
	FILE *file = fopen(path, "w");
	assert_non_null(file);
	fputs(text, file);
	assert_int_equal(fclose(file), 0);
}

/* Shaders from a directory: a library is included once however often it is asked for, and a fault
 * is named by the file and line that a developer would look in. */
static void shaders_from_a_directory(void **state)
{
	(void)state;
	char dir[] = "/tmp/welkin-shaders-XXXXXX", path[256];
	struct error err = { "" };
	assert_non_null(mkdtemp(dir));
	write_file(dir, "good.glsl", "float one() { return 1.0; }\n");
	write_file(dir, "broken.glsl", "#include \"good.glsl\"\n\nfloat two() { return three; }\n");
	write_file(dir, "good.comp",
		"#include \"good.glsl\"\n#include \"good.glsl\"\nlayout(local_size_x = 8) in;\n"
		"void main() {}\n");
	write_file(dir, "bad.comp", "#include \"broken.glsl\"\nlayout(local_size_x = 8) in;\nvoid main() {}\n");
	write_file(dir, "lost.comp", "#include \"nowhere.glsl\"\nvoid main() {}\n");
	struct programs *programs = programs_create(dir);
	assert_non_null(programs);

	const struct program *good = programs_get(programs, "good.comp", "", &err);
	assert_non_null(good);
	assert_int_equal(good->group[0], 8);
	assert_null(programs_get(programs, "bad.comp", "", &err));
	if (!strstr(err.text, "broken.glsl:3"))
		fail_msg("%s", err.text);
	assert_null(programs_get(programs, "lost.comp", "", &err));
	assert_non_null(strstr(err.text, "nowhere.glsl"));
	assert_null(programs_get(programs, "none.comp", "", &err));
	assert_non_null(strstr(err.text, "none.comp"));

	programs_destroy(programs);
	static const char *const names[] = { "good.glsl", "broken.glsl", "good.comp", "bad.comp", "lost.comp" };
	for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
		snprintf(path, sizeof path, "%s/%s", dir, names[i]);
		unlink(path);
	}
	assert_int_equal(rmdir(dir), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(blocks_agree),
		cmocka_unit_test(every_shader_compiles),
		cmocka_unit_test(a_program_is_made_once),
		cmocka_unit_test(shaders_from_a_directory),
	};
	return cmocka_run_group_tests_name("shared", tests, lib_gpu_open, lib_gpu_close);
}
