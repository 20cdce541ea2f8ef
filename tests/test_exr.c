/* EXR: what OpenEXRCore reads back is what went in: samples, layers, attributes. */
#include "tests/lib_pictures.h"
#include "tests/lib_random.h"

#include <math.h>
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static struct welkin_bytes encode_with(const struct welkin_file_info *info, const void *pixels)
{
	struct welkin_bytes bytes;
	struct error err;
	if (!welkin_encode_exr(info, pixels, &bytes, &err))
		fail_msg("%s", err.text);
	return bytes;
}

static struct welkin_bytes encode(const struct welkin_request *request, const void *pixels, int threads)
{
	struct welkin_file_info info = lib_picture_info(request);
	info.threads = threads;
	return encode_with(&info, pixels);
}

/* ---- reading ---- */

static int64_t on_read(exr_const_context_t exr, void *userdata, void *out, uint64_t size, uint64_t offset,
	exr_stream_error_func_ptr_t report)
{
	const struct welkin_bytes *bytes = userdata;
	(void)exr;
	(void)report;
	if (offset > bytes->size)
		return -1;
	const uint64_t take = size < bytes->size - offset ? size : bytes->size - offset;
	memcpy(out, bytes->data + offset, take);
	return (int64_t)take;
}

static int64_t on_size(exr_const_context_t exr, void *userdata)
{
	(void)exr;
	return (int64_t)((const struct welkin_bytes *)userdata)->size;
}

static void on_error(exr_const_context_t exr, exr_result_t code, const char *message)
{
	(void)exr;
	fail_msg("OpenEXR %d: %s", code, message);
}

static exr_context_t open_bytes(struct welkin_bytes *bytes)
{
	exr_context_t exr;
	exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
	setup.error_handler_fn = on_error;
	setup.read_fn = on_read;
	setup.size_fn = on_size;
	setup.user_data = bytes;
	assert_int_equal(exr_start_read(&exr, "memory", &setup), EXR_ERR_SUCCESS);
	return exr;
}

/* One channel's samples of the whole image as they are in the file, 2 or 4 bytes each, malloc'd. */
static unsigned char *read_channel(exr_context_t exr, const char *name, int width, int height, int *sample)
{
	int32_t rows;
	unsigned char *samples = NULL;
	assert_int_equal(exr_get_scanlines_per_chunk(exr, 0, &rows), EXR_ERR_SUCCESS);
	for (int y = 0; y < height; y += rows) {
		exr_chunk_info_t where;
		exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
		assert_int_equal(exr_read_scanline_chunk_info(exr, 0, y, &where), EXR_ERR_SUCCESS);
		assert_int_equal(exr_decoding_initialize(exr, 0, &where, &pipeline), EXR_ERR_SUCCESS);
		for (int i = 0; i < pipeline.channel_count; i++) {
			exr_coding_channel_info_t *c = &pipeline.channels[i];
			c->decode_to_ptr = NULL;
			if (strcmp(c->channel_name, name))
				continue;
			*sample = c->bytes_per_element;
			if (!samples)
				samples = calloc((size_t)width * (size_t)height, (size_t)*sample);
			c->decode_to_ptr = samples + (size_t)y * (size_t)width * (size_t)*sample;
			c->user_pixel_stride = *sample;
			c->user_line_stride = width * *sample;
			c->user_bytes_per_element = (int16_t)*sample;
			c->user_data_type = c->data_type;
		}
		assert_non_null(samples);
		assert_int_equal(exr_decoding_choose_default_routines(exr, 0, &pipeline), EXR_ERR_SUCCESS);
		assert_int_equal(exr_decoding_run(exr, 0, &pipeline), EXR_ERR_SUCCESS);
		exr_decoding_destroy(exr, &pipeline);
	}
	return samples;
}

static void assert_channel(exr_context_t exr, const struct welkin_image *image, const char *name,
	const unsigned char *data, int sample, int samples)
{
	int found;
	const size_t n = (size_t)image->width * (size_t)image->height, size = (size_t)sample;
	unsigned char *back = read_channel(exr, name, image->width, image->height, &found);
	assert_int_equal(found, sample);
	for (size_t i = 0; i < n; i++) {
		if (memcmp(back + i * size, data + i * size * (size_t)samples, size))
			fail_msg("%d x %d, type %d, compression %d, %s: sample %zu differs", image->width,
				image->height, image->exr_type, image->exr_compression, name, i);
	}
	free(back);
}

static void round_trip(int width, int height, int type, int compression, uint32_t layers, enum lib_picture kind)
{
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_EXR, width, height);
	request.image.exr_type = type;
	request.image.exr_compression = compression;
	request.image.layers = layers;
	unsigned char *pixels = lib_picture(&request, kind, (uint32_t)(width * 31 + height));
	struct welkin_bytes bytes = encode(&request, pixels, 2);
	exr_context_t exr = open_bytes(&bytes);
	const struct welkin_image_layout layout = welkin_image_layout(&request.image);
	const int sample = type == WELKIN_HALF ? 2 : 4;
	exr_compression_t used;
	assert_int_equal(exr_get_compression(exr, 0, &used), EXR_ERR_SUCCESS);
	assert_int_equal(used, compression);
	for (int i = 0; i < 4; i++)
		assert_channel(exr, &request.image, (const char *const[]){ "R", "G", "B", "A" }[i], pixels + i * sample,
			sample, 4);
	for (int i = 0; i < 3; i++) {
		static const char *const in[] = { "inscatter.R", "inscatter.G", "inscatter.B" };
		static const char *const through[] = { "transmittance.R", "transmittance.G", "transmittance.B" };
		if (layers & WELKIN_LAYER_INSCATTER)
			assert_channel(exr, &request.image, in[i], pixels + layout.inscatter + i * 4, 4, 3);
		if (layers & WELKIN_LAYER_TRANSMITTANCE)
			assert_channel(exr, &request.image, through[i], pixels + layout.transmittance + i * 4, 4, 3);
	}
	if (layers & WELKIN_LAYER_DEPTH)
		assert_channel(exr, &request.image, "Z", pixels + layout.depth, 4, 1);
	for (int i = 0; i < WELKIN_CLOUD_SAMPLES && layers & WELKIN_LAYER_CLOUDS; i++) {
		static const char *const clouds[] = { "clouds.R", "clouds.G", "clouds.B", "clouds.T", "clouds.Z" };
		assert_channel(exr, &request.image, clouds[i], pixels + layout.clouds + i * 4, 4, WELKIN_CLOUD_SAMPLES);
	}
	const exr_attr_chlist_t *channels;
	assert_int_equal(exr_get_channels(exr, 0, &channels), EXR_ERR_SUCCESS);
	assert_int_equal(channels->num_channels, 4 + (layers & WELKIN_LAYER_INSCATTER ? 3 : 0) +
							 (layers & WELKIN_LAYER_TRANSMITTANCE ? 3 : 0) +
							 (layers & WELKIN_LAYER_DEPTH ? 1 : 0) +
							 (layers & WELKIN_LAYER_CLOUDS ? WELKIN_CLOUD_SAMPLES : 0));
	exr_finish(&exr);
	free(bytes.data);
	free(pixels);
}

static void test_sizes(void **state)
{
	(void)state;
	uint64_t random = 5;
	for (int type = WELKIN_HALF; type <= WELKIN_FLOAT; type++) {
		for (int compression = WELKIN_EXR_NONE; compression <= WELKIN_EXR_PIZ; compression++) {
			for (int kind = LIB_SKY; kind <= LIB_PATCHES; kind++) {
				round_trip(1, 1, type, compression, 0, (enum lib_picture)kind);
				for (int i = 0; i < 5; i++)
					round_trip(1 + (int)((uint32_t)random_bits(&random) % 97),
						1 + (int)((uint32_t)random_bits(&random) % 97), type, compression,
						(uint32_t)random_bits(&random) % 8, (enum lib_picture)kind);
			}
			round_trip(1, 16384, type, compression, 7, LIB_SKY);
			round_trip(16384, 1, type, compression, 7, LIB_SKY);
		}
	}
}

static void test_layers(void **state)
{
	(void)state;
	for (uint32_t layers = 0; layers < 8; layers++)
		round_trip(67, 45, WELKIN_HALF, WELKIN_EXR_ZIP, layers, LIB_SKY);
}

static void test_same_bytes_on_any_threads(void **state)
{
	(void)state;
	for (int compression = WELKIN_EXR_NONE; compression <= WELKIN_EXR_PIZ; compression++) {
		struct welkin_request request;
		lib_picture_request(&request, WELKIN_EXR, 211, 307);
		request.image.exr_compression = compression;
		unsigned char *pixels = lib_picture(&request, LIB_SKY, 3);
		struct welkin_bytes one = encode(&request, pixels, 1);
		for (int threads = 0; threads <= 6; threads++) {
			struct welkin_bytes other = encode(&request, pixels, threads);
			assert_int_equal(one.size, other.size);
			assert_memory_equal(one.data, other.data, one.size);
			free(other.data);
		}
		free(one.data);
		free(pixels);
	}
}

/* The sun in binary16: infinity would poison every filter it meets. */
static void test_half_overflow(void **state)
{
	(void)state;
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_EXR, 8, 1);
	const uint16_t in[] = { 0x7c00, 0xfc00, 0x7e00, 0xffff, 0x7bff, 0x0001, 0x8000, 0x3c00 };
	const uint16_t want[] = { 0x7bff, 0xfbff, 0, 0, 0x7bff, 0x0001, 0x8000, 0x3c00 };
	uint16_t pixels[8 * 4];
	for (int i = 0; i < 32; i++)
		pixels[i] = in[i / 4];
	struct welkin_bytes bytes = encode(&request, pixels, 1);
	exr_context_t exr = open_bytes(&bytes);
	int sample;
	uint16_t *green = (uint16_t *)read_channel(exr, "G", 8, 1, &sample);
	assert_memory_equal(green, want, sizeof want);
	free(green);
	exr_finish(&exr);
	free(bytes.data);
}

/* ---- attributes ---- */

static const exr_attribute_t *attribute(exr_context_t exr, const char *name, exr_attribute_type_t type)
{
	const exr_attribute_t *a = NULL;
	if (exr_get_attribute_by_name(exr, 0, name, &a) != EXR_ERR_SUCCESS || a->type != type)
		fail_msg("attribute %s is missing or of another type", name);
	return a;
}

static void assert_string(exr_context_t exr, const char *name, const char *want)
{
	const exr_attr_string_t *s = attribute(exr, name, EXR_ATTR_STRING)->string;
	assert_int_equal(s->length, strlen(want));
	assert_memory_equal(s->str, want, strlen(want));
}

static bool has_attribute(exr_context_t exr, const char *name)
{
	int32_t n = 0;
	assert_int_equal(exr_get_attribute_count(exr, 0, &n), EXR_ERR_SUCCESS);
	for (int i = 0; i < n; i++) {
		const exr_attribute_t *a;
		assert_int_equal(exr_get_attribute_by_index(exr, 0, EXR_ATTR_LIST_FILE_ORDER, i, &a), EXR_ERR_SUCCESS);
		if (!strcmp(a->name, name))
			return true;
	}
	return false;
}

static void assert_double(exr_context_t exr, const char *name, double want)
{
	const double found = attribute(exr, name, EXR_ATTR_DOUBLE)->d;
	if (found != want)
		fail_msg("%s is %.17g, not %.17g", name, found, want);
}

static void test_attributes(void **state)
{
	(void)state;
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_EXR, 10, 6);
	struct welkin_file_info info = lib_picture_info(&request);
	void *pixels = lib_picture(&request, LIB_SKY, 1);
	struct welkin_bytes bytes = encode_with(&info, pixels);
	exr_context_t exr = open_bytes(&bytes);
	assert_true(attribute(exr, "whiteLuminance", EXR_ATTR_FLOAT)->f == 8192);
	const exr_attr_chromaticities_t *c = attribute(exr, "chromaticities", EXR_ATTR_CHROMATICITIES)->chromaticities;
	assert_true(c->red_x == 0.64f && c->green_y == 0.60f && c->blue_x == 0.15f && c->white_x == 0.3127f);
	assert_non_null(strstr(attribute(exr, "software", EXR_ATTR_STRING)->string->str, "Welkin"));
	attribute(exr, "comments", EXR_ATTR_STRING);
	assert_string(exr, "welkin.request", info.request_json);
	assert_string(exr, "welkin.method", info.method);
	assert_string(exr, "welkin.device", info.device);
	assert_string(exr, "welkin.build", info.build);
	const exr_attr_v3d_t *position = attribute(exr, "welkin.camera.position_m", EXR_ATTR_V3D)->v3d;
	assert_true(position->x == 1 && position->y == 1.7 && position->z == -2);
	assert_double(exr, "welkin.camera.heading_deg", 72.5);
	assert_double(exr, "welkin.camera.pitch_deg", 5);
	assert_double(exr, "welkin.camera.roll_deg", -1);
	assert_double(exr, "welkin.camera.fov_deg", 60);
	assert_double(exr, "welkin.camera.altitude_m", 1.7);
	assert_double(exr, "welkin.sun.elevation_deg", 42.25);
	assert_double(exr, "welkin.sun.azimuth_deg", 95.5);
	assert_true(attribute(exr, "latitude", EXR_ATTR_FLOAT)->f == 35.3606f);
	assert_false(has_attribute(exr, "welkin.timing"));
	assert_false(has_attribute(exr, "envmap"));
	exr_finish(&exr);
	free(bytes.data);

	info.timing_json = "{\"total_ms\":1.5}";
	request.image.projection = WELKIN_EQUIRECTANGULAR;
	request.camera.pitch_deg = request.camera.roll_deg = 0;
	bytes = encode_with(&info, pixels);
	exr = open_bytes(&bytes);
	assert_string(exr, "welkin.timing", info.timing_json);
	assert_int_equal(attribute(exr, "envmap", EXR_ATTR_ENVMAP)->uc, EXR_ENVMAP_LATLONG);
	exr_finish(&exr);
	free(bytes.data);
	free(pixels);
}

/* The C++ library, an implementation of its own, reads and rewrites the file. */
static void test_exrmaketiled(void **state)
{
	(void)state;
	if (system("command -v exrmaketiled >/dev/null 2>&1"))
		skip();
	for (int compression = WELKIN_EXR_NONE; compression <= WELKIN_EXR_PIZ; compression++) {
		struct welkin_request request;
		lib_picture_request(&request, WELKIN_EXR, 131, 77);
		request.image.exr_compression = compression;
		request.image.layers = WELKIN_LAYER_DEPTH | WELKIN_LAYER_INSCATTER | WELKIN_LAYER_TRANSMITTANCE;
		void *pixels = lib_picture(&request, LIB_SKY, 1);
		struct welkin_bytes bytes = encode(&request, pixels, 2);
		char path[] = "/tmp/welkin-test-XXXXXX", command[256];
		const int fd = mkstemp(path);
		assert_true(fd >= 0);
		assert_int_equal(write(fd, bytes.data, bytes.size), bytes.size);
		close(fd);
		/* It has to make the same of our file as of any other: a tiled copy, then the tiles' channels. */
		snprintf(command, sizeof command,
			"exrmaketiled -o %s %s.tiled && exrheader %s.tiled | grep -q 'transmittance.B, 32-bit'", path,
			path, path);
		const int status = system(command);
		snprintf(command, sizeof command, "%s.tiled", path);
		unlink(command);
		unlink(path);
		assert_int_equal(status, 0);
		free(bytes.data);
		free(pixels);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_sizes),
		cmocka_unit_test(test_layers),
		cmocka_unit_test(test_same_bytes_on_any_threads),
		cmocka_unit_test(test_half_overflow),
		cmocka_unit_test(test_attributes),
		cmocka_unit_test(test_exrmaketiled),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
