#include "tests/lib_pictures.h"
#include "tests/lib_random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void lib_picture_request(struct welkin_request *request, int format, int width, int height)
{
	memset(request, 0, sizeof *request);
	request->image = (struct welkin_image){ .width = width,
		.height = height,
		.format = format,
		.png_bits = 8,
		.exr_type = WELKIN_HALF,
		.exr_compression = WELKIN_EXR_ZIP };
	request->camera = (struct welkin_camera){ .position_m = { 1, 1.7, -2 },
		.altitude_m = 1.7,
		.heading_deg = 72.5,
		.pitch_deg = 5,
		.roll_deg = -1,
		.fov_deg = 60 };
	request->sun = (struct welkin_sun){
		.elevation_deg = 42.25, .azimuth_deg = 95.5, .intensity = 1, .angular_radius_deg = 0.2666, .disk = 1
	};
	request->latitude_deg = 35.3606;
	request->longitude_deg = 138.7274;
}

struct welkin_file_info lib_picture_info(const struct welkin_request *request)
{
	return (struct welkin_file_info){ .request = request,
		.request_json = "{\"image\":{\"width\":1}}",
		.method = "march",
		.device = "llvmpipe (τ)",
		.build = "0.1.0 test",
		.exposure_scale = 1.0 / 8192,
		.threads = 1 };
}

uint16_t lib_half(float value)
{
	uint32_t bits;
	memcpy(&bits, &value, sizeof bits);
	const uint32_t sign = bits >> 16 & 0x8000;
	bits &= 0x7fffffff;
	if (bits < 0x38800000)
		return (uint16_t)sign;
	bits += 0xfff + (bits >> 13 & 1);
	return (uint16_t)(sign | ((bits - 0x38000000) >> 13));
}

/* Blue overhead, pale at the horizon, a glow round the sun; ground below. Linear-ish, 0…1. */
static float sky(int width, int height, int x, int y, int channel)
{
	static const float zenith[3] = { 0.18f, 0.34f, 0.62f }, horizon[3] = { 0.78f, 0.84f, 0.88f };
	const float u = ((float)x + 0.5f) / (float)width, v = ((float)y + 0.5f) / (float)height;
	const float glow = 0.25f * expf(-40 * ((u - 0.6f) * (u - 0.6f) + (v - 0.4f) * (v - 0.4f)));
	const float t = v < 0.55f ? powf(v / 0.55f, 2) : 0;
	if (v >= 0.55f)
		return 0.25f + 0.1f * (1 - v) + 0.05f * (float)channel;
	return fminf(1, zenith[channel] + t * (horizon[channel] - zenith[channel]) + glow);
}

static float value_at(
	const struct welkin_image *image, enum lib_picture kind, int x, int y, int channel, uint64_t *state)
{
	if (kind == LIB_SKY)
		return sky(image->width, image->height, x, y, channel);
	if (kind == LIB_NOISE)
		return (float)((uint32_t)random_bits(state) >> 8) / 16777216.0f;
	if (kind == LIB_PATCHES)
		return (float)((x / 37 * 7 + y / 11 * 5 + channel) % 4) / 3;
	return 0;
}

static void store(const struct welkin_image *image, void *pixels, size_t i, float value, uint64_t *state, bool dither)
{
	if (image->format == WELKIN_EXR && image->exr_type == WELKIN_HALF) {
		((uint16_t *)pixels)[i] = lib_half(value);
	} else if (image->format == WELKIN_EXR) {
		((float *)pixels)[i] = value;
	} else {
		const float most = image->png_bits == 16 ? 65535 : 255;
		const float noise = dither ? (float)((int)((uint32_t)random_bits(state) & 0xffff) -
						     (int)((uint32_t)random_bits(state) & 0xffff)) /
						     65536
					   : 0;
		const float level = fminf(most, fmaxf(0, floorf(value * most + noise + 0.5f)));
		if (image->png_bits == 16)
			((uint16_t *)pixels)[i] = (uint16_t)level;
		else
			((uint8_t *)pixels)[i] = (uint8_t)level;
	}
}

void *lib_picture(const struct welkin_request *request, enum lib_picture kind, uint32_t seed)
{
	const struct welkin_image *image = &request->image;
	const struct welkin_image_layout layout = welkin_image_layout(image);
	unsigned char *data = calloc(1, layout.total ? layout.total : 1);
	uint64_t state = seed;
	if (!data)
		abort();
	for (int y = 0; y < image->height; y++) {
		for (int x = 0; x < image->width; x++) {
			const size_t i = (size_t)y * (size_t)image->width + (size_t)x;
			for (int c = 0; c < 3; c++)
				store(image, data + layout.main, i * 4 + (size_t)c,
					value_at(image, kind, x, y, c, &state), &state, kind == LIB_SKY);
			store(image, data + layout.main, i * 4 + 3, kind == LIB_BLACK ? 0 : 1, &state, false);
		}
	}
	/* The layers: floats of no meaning, up to the end. */
	struct welkin_image plain = *image;
	plain.layers = 0;
	for (size_t byte = welkin_image_layout(&plain).total; byte < layout.total; byte += sizeof(float)) {
		const float value = (float)((uint32_t)random_bits(&state) & 0xffff) / 64;
		memcpy(data + byte, &value, sizeof value);
	}
	return data;
}
