#include "server/encode.h"

#include "server/parallel.h"

#include <libdeflate.h>
#include <openexr.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/*
 * OpenEXRCore does the packing, compression and layout; it is given one chunk (1 to 32 rows) at a
 * time by several threads, which write them in order, so that the same pixels give the same bytes.
 * The file grows in memory.
 */

enum { MAX_CHANNELS = 11 + WELKIN_CLOUD_SAMPLES, ZIP_LEVEL = 3 };

/* Where a channel's samples lie. */
struct channel {
	const char *name;
	const unsigned char *data; /* of the first row */
	size_t pixel_stride, row_stride;
	exr_pixel_type_t type;
};

struct writer {
	const struct welkin_file_info *info;
	const unsigned char *pixels;
	exr_context_t exr;
	int part;
	struct channel channels[MAX_CHANNELS];
	int n_channels;
	int32_t rows_per_chunk;

	/* What the library writes to. */
	struct welkin_bytes bytes;
	size_t room;

	pthread_mutex_t lock;
	pthread_cond_t turn;
	int next_chunk; /* the one whose turn it is to be written */
	bool failed;
	struct error *err;
};

/* The pipeline of one chunk; encoding_user_data points here. */
struct chunk {
	struct writer *writer;
	int index;
	uint16_t *half_rows; /* main plane's rows, clamped; NULL where the file is binary32 */
	exr_result_t (*compress)(exr_encode_pipeline_t *pipeline); /* the library's */
	struct libdeflate_compressor *compressor;
	unsigned char *zip_rows;
};

/* ---- the library's callbacks ---- */

static int64_t on_write(exr_const_context_t exr, void *userdata, const void *data, uint64_t size, uint64_t offset,
	exr_stream_error_func_ptr_t report)
{
	struct writer *writer = userdata;
	const uint64_t end = offset + size;
	if (end > writer->room) {
		const size_t room = end + end / 2;
		unsigned char *bigger = realloc(writer->bytes.data, room);
		if (!bigger) {
			report(exr, EXR_ERR_OUT_OF_MEMORY, "no memory for %llu bytes", (unsigned long long)end);
			return -1;
		}
		writer->bytes.data = bigger;
		writer->room = room;
	}
	if (offset > writer->bytes.size) /* the chunk table is skipped and filled in last */
		memset(writer->bytes.data + writer->bytes.size, 0, offset - writer->bytes.size);
	memcpy(writer->bytes.data + offset, data, size);
	if (end > writer->bytes.size)
		writer->bytes.size = end;
	return (int64_t)size;
}

/* Keeps the first reason; the others follow from it. */
static void fail(struct writer *writer, const char *reason)
{
	pthread_mutex_lock(&writer->lock);
	if (!writer->failed)
		error_set(writer->err, "OpenEXR: %s", reason);
	writer->failed = true;
	pthread_cond_broadcast(&writer->turn);
	pthread_mutex_unlock(&writer->lock);
}

static void on_error(exr_const_context_t exr, exr_result_t code, const char *message)
{
	void *userdata = NULL;
	(void)code;
	if (exr_get_user_data(exr, &userdata) == EXR_ERR_SUCCESS && userdata)
		fail(userdata, message);
}

/* Waits for the chunk's turn. Chunks are taken in order, so the one before is always on its way. */
static exr_result_t wait_turn(exr_encode_pipeline_t *pipeline)
{
	const struct chunk *chunk = pipeline->encoding_user_data;
	struct writer *writer = chunk->writer;
	pthread_mutex_lock(&writer->lock);
	while (writer->next_chunk != chunk->index && !writer->failed)
		pthread_cond_wait(&writer->turn, &writer->lock);
	const bool failed = writer->failed;
	pthread_mutex_unlock(&writer->lock);
	return failed ? EXR_ERR_WRITE_IO : EXR_ERR_SUCCESS;
}

/* OpenEXR's ZIP: even bytes before odd ones, differences, zlib. With libdeflate it takes two thirds of the time
 * of the library's own at zlib's fastest level, for smaller files (tests/bench_encode.c). Returns 0 when the
 * result is longer than room. */
static size_t zip(struct chunk *chunk, const unsigned char *plain, size_t n, unsigned char *out, size_t room)
{
	unsigned char *even = chunk->zip_rows, *odd = even + (n + 1) / 2;
	for (size_t i = 0; i < n / 2; i++) {
		even[i] = plain[2 * i];
		odd[i] = plain[2 * i + 1];
	}
	if (n & 1)
		even[n / 2] = plain[n - 1];
	for (size_t i = n - 1; i > 0; i--)
		even[i] = (unsigned char)(even[i] - even[i - 1] + 128);
	return libdeflate_zlib_compress(chunk->compressor, even, n, out, room);
}

/* A chunk as long as its plain samples is taken for plain by every reader, but OpenEXRCore 3.1.5
 * stores plain samples only where compression made them longer: a compressed chunk of the very same
 * length would come back as noise. */
static exr_result_t keep_shorter(exr_encode_pipeline_t *pipeline)
{
	if (pipeline->compressed_bytes == 0 || pipeline->compressed_bytes >= pipeline->packed_bytes) {
		memcpy(pipeline->compressed_buffer, pipeline->packed_buffer, pipeline->packed_bytes);
		pipeline->compressed_bytes = pipeline->packed_bytes;
	}
	return EXR_ERR_SUCCESS;
}

static exr_result_t compress(exr_encode_pipeline_t *pipeline)
{
	const struct chunk *chunk = pipeline->encoding_user_data;
	const exr_result_t r = chunk->compress(pipeline);
	return r ? r : keep_shorter(pipeline);
}

static exr_result_t compress_zip(exr_encode_pipeline_t *pipeline)
{
	struct chunk *chunk = pipeline->encoding_user_data;
	const size_t n = pipeline->packed_bytes;
	chunk->compressor = libdeflate_alloc_compressor(ZIP_LEVEL);
	chunk->zip_rows = malloc(n);
	pipeline->compressed_buffer = malloc(n);
	pipeline->compressed_alloc_size = n;
	exr_result_t r = EXR_ERR_OUT_OF_MEMORY;
	if (chunk->compressor && chunk->zip_rows && pipeline->compressed_buffer) {
		/* 0 when it is not shorter */
		pipeline->compressed_bytes = zip(chunk, pipeline->packed_buffer, n, pipeline->compressed_buffer, n);
		r = keep_shorter(pipeline);
	}
	libdeflate_free_compressor(chunk->compressor);
	free(chunk->zip_rows);
	return r;
}

static void pass_turn(struct writer *writer)
{
	pthread_mutex_lock(&writer->lock);
	writer->next_chunk++;
	pthread_cond_broadcast(&writer->turn);
	pthread_mutex_unlock(&writer->lock);
}

/* ---- header ---- */

static void add_channel(
	struct writer *writer, const char *name, const unsigned char *data, size_t sample, size_t samples)
{
	const size_t stride = sample * samples;
	writer->channels[writer->n_channels++] = (struct channel){ name, data, stride,
		stride * (size_t)writer->info->request->image.width, sample == 2 ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT };
}

static void list_channels(struct writer *writer)
{
	static const char *const main_names[] = { "R", "G", "B", "A" };
	static const char *const inscatter_names[] = { "inscatter.R", "inscatter.G", "inscatter.B" };
	static const char *const transmittance_names[] = { "transmittance.R", "transmittance.G", "transmittance.B" };
	static const char *const cloud_names[WELKIN_CLOUD_SAMPLES] = { "clouds.R", "clouds.G", "clouds.B", "clouds.T",
		"clouds.Z" };
	const struct welkin_image *image = &writer->info->request->image;
	const struct welkin_image_layout layout = welkin_image_layout(image);
	const size_t none = (size_t)-1, sample = image->exr_type == WELKIN_HALF ? 2 : 4;
	for (size_t i = 0; i < 4; i++)
		add_channel(writer, main_names[i], writer->pixels + layout.main + i * sample, sample, 4);
	for (size_t i = 0; i < 3 && layout.inscatter != none; i++)
		add_channel(writer, inscatter_names[i], writer->pixels + layout.inscatter + i * 4, 4, 3);
	for (size_t i = 0; i < 3 && layout.transmittance != none; i++)
		add_channel(writer, transmittance_names[i], writer->pixels + layout.transmittance + i * 4, 4, 3);
	if (layout.depth != none)
		add_channel(writer, "Z", writer->pixels + layout.depth, 4, 1);
	for (size_t i = 0; i < WELKIN_CLOUD_SAMPLES && layout.clouds != none; i++)
		add_channel(writer, cloud_names[i], writer->pixels + layout.clouds + i * 4, 4, WELKIN_CLOUD_SAMPLES);
}

static exr_result_t set_string(struct writer *writer, const char *name, const char *text)
{
	return text ? exr_attr_set_string(writer->exr, writer->part, name, text) : EXR_ERR_SUCCESS;
}

static exr_result_t set_doubles(struct writer *writer, const struct welkin_request *request)
{
	const struct {
		const char *name;
		double value;
	} doubles[] = {
		{ "welkin.camera.altitude_m", request->camera.altitude_m },
		{ "welkin.camera.heading_deg", request->camera.heading_deg },
		{ "welkin.camera.pitch_deg", request->camera.pitch_deg },
		{ "welkin.camera.roll_deg", request->camera.roll_deg },
		{ "welkin.camera.fov_deg", request->camera.fov_deg },
		{ "welkin.sun.elevation_deg", request->sun.elevation_deg },
		{ "welkin.sun.azimuth_deg", request->sun.azimuth_deg },
		{ "welkin.sun.intensity", request->sun.intensity },
	};
	const double *p = request->camera.position_m;
	const exr_attr_v3d_t position = { .x = p[0], .y = p[1], .z = p[2] };
	exr_result_t r = exr_attr_set_v3d(writer->exr, writer->part, "welkin.camera.position_m", &position);
	for (size_t i = 0; !r && i < sizeof doubles / sizeof *doubles; i++)
		r = exr_attr_set_double(writer->exr, writer->part, doubles[i].name, doubles[i].value);
	return r;
}

/* OpenEXR's own latitude-longitude map is level; ours is one only while the camera is. */
static exr_result_t set_environment(struct writer *writer, const struct welkin_request *request)
{
	if (request->image.projection != WELKIN_EQUIRECTANGULAR || request->camera.pitch_deg != 0 ||
		request->camera.roll_deg != 0)
		return EXR_ERR_SUCCESS;
	return exr_attr_set_envmap(writer->exr, writer->part, "envmap", EXR_ENVMAP_LATLONG);
}

static exr_result_t set_attributes(struct writer *writer)
{
	static const exr_attr_chromaticities_t rec709 = { .red_x = 0.64f,
		.red_y = 0.33f,
		.green_x = 0.30f,
		.green_y = 0.60f,
		.blue_x = 0.15f,
		.blue_y = 0.06f,
		.white_x = 0.3127f,
		.white_y = 0.3290f };
	const struct welkin_file_info *info = writer->info;
	const struct welkin_request *request = info->request;
	exr_context_t exr = writer->exr;
	const int part = writer->part;
	exr_result_t r = exr_attr_set_chromaticities(exr, part, "chromaticities", &rec709);
	r = r ? r : exr_attr_set_float(exr, part, "whiteLuminance", (float)(1 / info->exposure_scale));
	r = r ? r : exr_attr_set_float(exr, part, "latitude", (float)request->latitude_deg);
	r = r ? r : exr_attr_set_float(exr, part, "longitude", (float)request->longitude_deg);
	r = r ? r : exr_attr_set_float(exr, part, "altitude", (float)request->camera.altitude_m);
	r = r ? r : set_environment(writer, request);
	r = r ? r : set_string(writer, "software", "Welkin " WELKIN_VERSION);
	r = r ? r : set_string(writer, "comments", "Sky rendered by Welkin; welkin.request holds its parameters");
	r = r ? r : set_string(writer, "welkin.request", info->request_json);
	r = r ? r : set_string(writer, "welkin.method", info->method);
	r = r ? r : set_string(writer, "welkin.device", info->device);
	r = r ? r : set_string(writer, "welkin.build", info->build);
	r = r ? r : set_string(writer, "welkin.timing", info->timing_json);
	return r ? r : set_doubles(writer, request);
}

static exr_result_t write_header(struct writer *writer)
{
	static const exr_compression_t compressions[] = { [WELKIN_EXR_NONE] = EXR_COMPRESSION_NONE,
		[WELKIN_EXR_RLE] = EXR_COMPRESSION_RLE,
		[WELKIN_EXR_ZIPS] = EXR_COMPRESSION_ZIPS,
		[WELKIN_EXR_ZIP] = EXR_COMPRESSION_ZIP,
		[WELKIN_EXR_PIZ] = EXR_COMPRESSION_PIZ };
	const struct welkin_image *image = &writer->info->request->image;
	exr_context_t exr = writer->exr;
	exr_result_t r = exr_set_longname_support(exr, 1);
	r = r ? r : exr_add_part(exr, NULL, EXR_STORAGE_SCANLINE, &writer->part);
	r = r ? r
	      : exr_initialize_required_attr_simple(
			exr, writer->part, image->width, image->height, compressions[image->exr_compression]);
	for (int i = 0; !r && i < writer->n_channels; i++)
		r = exr_add_channel(exr, writer->part, writer->channels[i].name, writer->channels[i].type,
			EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
	r = r ? r : set_attributes(writer);
	r = r ? r : exr_write_header(exr);
	return r ? r : exr_get_scanlines_per_chunk(exr, writer->part, &writer->rows_per_chunk);
}

/* ---- chunks ---- */

/* The sun's disk is brighter than binary16 reaches: infinities become its largest number, so that
 * filters and viewers are not poisoned; what is not a number becomes 0. */
static void clamp_halves(const uint16_t *restrict in, size_t n, uint16_t *restrict out)
{
	for (size_t i = 0; i < n; i++) {
		const uint16_t magnitude = in[i] & 0x7fff;
		out[i] = magnitude < 0x7c00 ? in[i] : magnitude == 0x7c00 ? (uint16_t)((in[i] & 0x8000) | 0x7bff) : 0;
	}
}

/* The four channels of the main plane come first; as halves they are read from the clamped copy. */
static const unsigned char *channel_rows(const struct writer *writer, const struct chunk *chunk, int channel, int y)
{
	if (channel < 4 && chunk->half_rows)
		return (const unsigned char *)(chunk->half_rows + channel);
	return writer->channels[channel].data + (size_t)y * writer->channels[channel].row_stride;
}

static bool point_channels(
	const struct writer *writer, const struct chunk *chunk, exr_encode_pipeline_t *pipeline, int y)
{
	for (int i = 0; i < pipeline->channel_count; i++) {
		exr_coding_channel_info_t *to = &pipeline->channels[i];
		int from = 0;
		while (from < writer->n_channels && strcmp(writer->channels[from].name, to->channel_name))
			from++;
		if (from == writer->n_channels)
			return false;
		to->encode_from_ptr = channel_rows(writer, chunk, from, y);
		to->user_pixel_stride = (int32_t)writer->channels[from].pixel_stride;
		to->user_line_stride = (int32_t)writer->channels[from].row_stride;
		to->user_bytes_per_element = to->bytes_per_element;
		to->user_data_type = to->data_type;
	}
	return true;
}

static bool copy_halves(const struct writer *writer, struct chunk *chunk, int y, int rows)
{
	const struct welkin_image *image = &writer->info->request->image;
	if (image->exr_type != WELKIN_HALF)
		return true;
	const size_t per_row = (size_t)image->width * 4;
	chunk->half_rows = malloc(per_row * (size_t)rows * sizeof *chunk->half_rows);
	if (!chunk->half_rows)
		return false;
	clamp_halves((const uint16_t *)writer->pixels + per_row * (size_t)y, per_row * (size_t)rows, chunk->half_rows);
	return true;
}

static void *allocate(exr_transcoding_pipeline_buffer_id_t id, size_t size)
{
	(void)id;
	return malloc(size);
}

static void release(exr_transcoding_pipeline_buffer_id_t id, void *buffer)
{
	(void)id;
	free(buffer);
}

static void encode_chunk(void *context, int index)
{
	struct writer *writer = context;
	struct chunk chunk = { .writer = writer, .index = index };
	const int y = index * writer->rows_per_chunk;
	exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
	exr_chunk_info_t where;
	exr_result_t r = exr_write_scanline_chunk_info(writer->exr, writer->part, y, &where);
	r = r ? r : exr_encoding_initialize(writer->exr, writer->part, &where, &pipeline);
	if (!r && (!copy_halves(writer, &chunk, y, where.height) || !point_channels(writer, &chunk, &pipeline, y)))
		r = EXR_ERR_OUT_OF_MEMORY;
	r = r ? r : exr_encoding_choose_default_routines(writer->exr, writer->part, &pipeline);
	if (!r) {
		if (pipeline.compress_fn) {
			const int32_t kind = writer->info->request->image.exr_compression;
			chunk.compress = pipeline.compress_fn;
			pipeline.compress_fn =
				kind == WELKIN_EXR_ZIP || kind == WELKIN_EXR_ZIPS ? compress_zip : compress;
		}
		/* The buffer that compress_zip() makes is freed by the library. */
		pipeline.alloc_fn = allocate;
		pipeline.free_fn = release;
		pipeline.yield_until_ready_fn = wait_turn;
		pipeline.encoding_user_data = &chunk;
		r = exr_encoding_run(writer->exr, writer->part, &pipeline);
	}
	if (r)
		fail(writer, exr_get_default_error_message(r));
	else
		pass_turn(writer);
	exr_encoding_destroy(writer->exr, &pipeline);
	free(chunk.half_rows);
}

bool welkin_encode_exr(
	const struct welkin_file_info *info, const void *pixels, struct welkin_bytes *out, struct error *err)
{
	const struct welkin_image *image = &info->request->image;
	struct writer writer = { .info = info, .pixels = pixels, .err = err };
	exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
	setup.error_handler_fn = on_error;
	setup.write_fn = on_write;
	setup.user_data = &writer;
	*out = (struct welkin_bytes){ 0 };
	pthread_mutex_init(&writer.lock, NULL);
	pthread_cond_init(&writer.turn, NULL);
	list_channels(&writer);

	exr_result_t r = exr_start_write(&writer.exr, "memory", EXR_WRITE_FILE_DIRECTLY, &setup);
	if (!r) {
		r = write_header(&writer);
		if (!r)
			welkin_parallel(info->threads,
				(image->height + writer.rows_per_chunk - 1) / writer.rows_per_chunk, encode_chunk,
				&writer);
		const exr_result_t finished = exr_finish(&writer.exr); /* writes the chunk table */
		r = r ? r : finished;
	}
	if (r)
		fail(&writer, exr_get_default_error_message(r));
	pthread_cond_destroy(&writer.turn);
	pthread_mutex_destroy(&writer.lock);
	if (writer.failed) {
		free(writer.bytes.data);
		return false;
	}
	*out = writer.bytes;
	return true;
}
