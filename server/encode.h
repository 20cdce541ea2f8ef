#ifndef WELKIN_SERVER_ENCODE_H
#define WELKIN_SERVER_ENCODE_H

#include "api/error.h"
#include "gpu/job.h"

/* Encoders: pixels as the renderer left them (gpu/job.h, enum and layout there) → file bytes.
 * Thread-safe; no GL. */

struct welkin_bytes {
	unsigned char *data; /* malloc'd */
	size_t size;
};

/* What goes into the file beside the pixels. Everything here is the same for two renders of the
 * same request, except timing_json, which is NULL unless image.embed_timing. */
struct welkin_file_info {
	const struct welkin_request *request;
	const char *request_json;               /* welkin_request_json() */
	const char *method, *device, *build;    /* method NULL: the pixels are no sky */
	const struct welkin_noise_slice *noise; /* NULL: not noise; PNG only */
	const char *timing_json;
	double exposure_scale; /* pixel = cd/m² × this */
	int threads;           /* an EXR may take up to that many; a PNG takes one */
};

/* PNG, 8 or 16 bit RGB. The renderer's alpha is left out, since a PNG shows the sky over black; only
 * a cube cross is RGBA, opaque in its six cells (the second column and the middle row of 4 × 3) and transparent
 * outside them, and noise with an alpha that says something keeps it. Chunks sRGB (perceptual), gAMA, cHRM, none of
 * them with noise, which is no colour, and iTXt: Software, Description, welkin:request, welkin:method, welkin:device,
 * welkin:build (, welkin:timing). The bytes don't depend on threads. */
bool welkin_encode_png(
	const struct welkin_file_info *info, const void *pixels, struct welkin_bytes *out, struct error *err);

/* OpenEXRCore. R G B A, then layers: inscatter.{R,G,B}, transmittance.{R,G,B}, Z, clouds.{R,G,B,T,Z}. Attributes:
 * chromaticities (Rec.709), whiteLuminance (cd/m² of a pixel of value 1), latitude, longitude, altitude, envmap (a
 * level equirectangular image), software, comments, and welkin.* (request, method, device, build, camera.*, sun.*,
 * timing). Half files hold ±65504 in place of infinities and 0 in place of NaN. The bytes don't depend on threads. */
bool welkin_encode_exr(
	const struct welkin_file_info *info, const void *pixels, struct welkin_bytes *out, struct error *err);

#endif
