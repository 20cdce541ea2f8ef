#ifndef WELKIN_API_REQUEST_H
#define WELKIN_API_REQUEST_H

#include <stdbool.h>
#include <stdint.h>

/*
 * One render request with every value resolved: plain data of fixed size, no pointers, so it can
 * be hashed, sent to the renderer process and compared byte for byte. It is built by
 * welkin_resolve() (api.h) and always zeroed first, so padding is zero too.
 *
 * World frame: x east, y up, z south, origin at sea level at the place; metres. The planet's
 * centre is at (0, -planet_radius, 0). Angles in degrees where the name says so. Spectral
 * triples are given at 680, 550 and 440 nm, in that order (red, green, blue).
 */

enum welkin_projection {
	WELKIN_PERSPECTIVE,     /* rectilinear, fov_deg vertical */
	WELKIN_EQUIRECTANGULAR, /* 360° × 180°, image centre at the camera's heading and pitch */
	WELKIN_FISHEYE,   /* equidistant dome about the camera's forward axis, fov_deg across the image's height */
	WELKIN_CUBE_FACE, /* one 90° face */
	WELKIN_CUBEMAP,   /* horizontal cross of six faces, 4:3 */
};

enum welkin_cube_face { WELKIN_FRONT, WELKIN_RIGHT, WELKIN_BACK, WELKIN_LEFT, WELKIN_UP, WELKIN_DOWN };

enum welkin_layer {
	WELKIN_LAYER_DEPTH = 1,
	WELKIN_LAYER_TRANSMITTANCE = 2,
	WELKIN_LAYER_INSCATTER = 4,
	WELKIN_LAYER_CLOUDS = 8
};

enum welkin_format { WELKIN_PNG, WELKIN_EXR };
enum welkin_exr_type { WELKIN_HALF, WELKIN_FLOAT };
enum welkin_exr_compression { WELKIN_EXR_NONE, WELKIN_EXR_RLE, WELKIN_EXR_ZIPS, WELKIN_EXR_ZIP, WELKIN_EXR_PIZ };
enum welkin_preset { WELKIN_EARTH, WELKIN_MADRID2015, WELKIN_RAYLEIGH };
enum welkin_spectrum {
	WELKIN_SPECTRUM_RGB,
	WELKIN_SPECTRUM_4,
	WELKIN_SPECTRUM_8,
	WELKIN_SPECTRUM_16,
	WELKIN_SPECTRUM_40,
};
enum welkin_sun_spectrum { WELKIN_SUN_SOLAR, WELKIN_SUN_FLAT };
enum welkin_phase { WELKIN_CORNETTE_SHANKS, WELKIN_HENYEY_GREENSTEIN, WELKIN_SCHLICK };
enum welkin_exposure_mode { WELKIN_EXPOSURE_AUTO, WELKIN_EXPOSURE_EV, WELKIN_EXPOSURE_PUPIL };
enum welkin_tone_map {
	WELKIN_TONE_AGX,
	WELKIN_TONE_ACES,
	WELKIN_TONE_REINHARD,
	WELKIN_TONE_EXPONENTIAL,
	WELKIN_TONE_NONE
};

enum welkin_cloud_preset {
	WELKIN_CLOUDS_NONE,
	WELKIN_CLOUDS_CUMULUS,
	WELKIN_CLOUDS_TOWERING,
	WELKIN_CLOUDS_STRATOCUMULUS,
	WELKIN_CLOUDS_STRATUS,
	WELKIN_CLOUDS_CIRRUS,
};
enum welkin_cloud_lighting { WELKIN_CLOUDS_PHYSICAL, WELKIN_CLOUDS_ARTISTIC };
/* How Perlin's noise P and Worley's W make the base shape; remap(x, a, b, c, d) takes a…b to c…d. */
enum welkin_cloud_shape {
	WELKIN_SHAPE_DILATED_SQUARED, /* remap(P, 0, 1, W, 1)² */
	WELKIN_SHAPE_DILATED,         /* remap(P, 0, 1, W, 1) */
	WELKIN_SHAPE_CARVED,          /* remap(P, W, 1, 0, 1) */
	WELKIN_SHAPE_ERODED,          /* remap(P, W - 1, 1, 0, 1) */
	WELKIN_SHAPE_PRODUCT,         /* P W */
	WELKIN_SHAPE_PERLIN,
	WELKIN_SHAPE_WORLEY,
	WELKIN_SHAPE_UNIFORM, /* no shapes: a slab between the shells */
};
enum welkin_worley { WELKIN_WORLEY_EUCLIDEAN, WELKIN_WORLEY_MANHATTAN };
enum welkin_high_clouds { WELKIN_HIGH_CIRRUS, WELKIN_HIGH_CIRROCUMULUS, WELKIN_HIGH_ALTOCUMULUS };
/* What makes the march cheaper, one by one. */
enum welkin_cloud_saving {
	WELKIN_SAVE_STEPS_BY_ELEVATION = 1,
	WELKIN_SAVE_EARLY_EXIT = 2,
	WELKIN_SAVE_EMPTY_SPACE = 4,
	WELKIN_SAVE_ADAPTIVE_STEPS = 8,
	WELKIN_SAVE_LIGHT_VOLUME = 16,
	WELKIN_SAVE_HALF_RESOLUTION = 32,
	WELKIN_SAVE_BLUE_NOISE = 64,
	WELKIN_SAVE_SHARED_LIGHT = 128,
};

/* Who chose the method, and why this one. Not a field: set where auto is replaced. */
enum welkin_choice {
	WELKIN_CHOICE_CLIENT,
	WELKIN_CHOICE_CHEAPEST,    /* within accuracy.max_error */
	WELKIN_CHOICE_ACCURATE,    /* the most accurate within accuracy.budget_ms, or at all */
	WELKIN_CHOICE_BEST_EFFORT, /* none keeps accuracy.max_error */
	WELKIN_CHOICE_OVER_BUDGET, /* none keeps accuracy.budget_ms */
	WELKIN_CHOICE_UNMEASURED,  /* no scene like this was measured */
};

struct welkin_image {
	int32_t width, height;
	int32_t projection;      /* enum welkin_projection */
	int32_t cube_face;       /* enum welkin_cube_face */
	uint32_t layers;         /* enum welkin_layer bits; EXR only */
	int32_t format;          /* enum welkin_format; set by the path or Accept, not a field */
	int32_t png_bits;        /* 8 or 16 */
	int32_t exr_type;        /* enum welkin_exr_type */
	int32_t exr_compression; /* enum welkin_exr_compression */
	int32_t embed_timing;    /* 0 or 1 */
	int32_t dither;          /* 0 or 1 */
};

struct welkin_camera {
	double position_m[3];  /* world frame */
	double altitude_m;     /* above sea level; agrees with position_m */
	double above_ground_m; /* above the scene's surface, or sea level where it has none: negative inside a mountain
				*/
	double heading_deg;    /* clockwise from north */
	double pitch_deg;      /* up positive */
	double roll_deg;       /* clockwise positive: the horizon tilts counter-clockwise */
	double fov_deg;        /* vertical */
};

struct welkin_sun {
	double elevation_deg, azimuth_deg; /* geometric: no refraction */
	double intensity;                  /* factor on the irradiance */
	double angular_radius_deg;
	int32_t spectrum;       /* enum welkin_sun_spectrum: solar W/m²/nm, or flat 1 W/m²/nm */
	int32_t disk;           /* 0 or 1 */
	int32_t limb_darkening; /* 0 or 1 */
	int32_t reserved;
};

struct welkin_atmosphere {
	int32_t preset;   /* enum welkin_preset; only a label once resolved */
	int32_t method;   /* index into welkin_method_names; the last, auto, only until gpu/choose.h has chosen */
	int32_t spectrum; /* enum welkin_spectrum; images only */
	int32_t steps;
	int32_t light_steps;
	int32_t max_order; /* 0: all the orders the method has */
	double turbidity;
	double density_factor;         /* on the densities of rayleigh and aerosol */
	double planet_radius_m, top_m; /* top above the ground */
	double rayleigh_scattering_per_m[3], rayleigh_scale_height_m;
	double aerosol_scattering_per_m[3], aerosol_absorption_per_m[3], aerosol_scale_height_m, aerosol_g;
	int32_t aerosol_phase; /* enum welkin_phase */
	int32_t choice;        /* enum welkin_choice */
	double ozone_column_du, ozone_center_m, ozone_half_width_m;
};

enum welkin_noise_volumes { WELKIN_VOLUMES_PROCEDURAL, WELKIN_VOLUMES_SCENE };
enum welkin_weather_map { WELKIN_WEATHER_PROCEDURAL, WELKIN_WEATHER_SCENE };

struct welkin_clouds {
	int32_t preset; /* enum welkin_cloud_preset; only a label once resolved */
	int32_t lighting;
	double coverage, type, precipitation, anvil; /* 0…1 */
	double bottom_m, top_m;
	double liquid_water_g_m3, droplet_radius_um, albedo;
	double forward_g, backward_g, backward_share;
	double weather_scale_m, wind_speed_m_s, wind_heading_deg, shear_m, evolution_m_s, time_s;
	double base_scale_m, base_persistence, base_gamma;
	int32_t base_perlin_frequency, base_perlin_octaves, base_worley_frequency, base_shape, base_metric,
		base_inverted;
	double detail_scale_m, detail_gamma, detail_strength;
	int32_t detail_frequency;
	int32_t weather_map;   /* enum welkin_weather_map */
	int32_t reprojection;  /* 0 or 1; of sequences' frames only */
	int32_t noise_volumes; /* enum welkin_noise_volumes */
	double curl_scale_m, curl_strength_m;
	double high_coverage, high_optical_depth, high_altitude_m, high_scale_m;
	int32_t high_type, steps, light_steps;
	uint32_t savings;
};

enum welkin_shading { WELKIN_PHYSICAL, WELKIN_PHONG };
enum welkin_shadow {
	WELKIN_SHADOW_NONE, /* no filter */
	WELKIN_SHADOW_BILINEAR,
	WELKIN_SHADOW_GAUSSIAN,
	WELKIN_SHADOW_VARIANCE,
	WELKIN_SHADOW_SOFT, /* as wide as the sun makes it */
	WELKIN_SHADOW_OFF   /* no shadows */
};
enum welkin_shadow_region { WELKIN_REGION_STATIC, WELKIN_REGION_FITTED, WELKIN_REGION_CASCADED };
enum welkin_shafts { WELKIN_SHAFTS_AUTO, WELKIN_SHAFTS_NONE, WELKIN_SHAFTS_MARCH, WELKIN_SHAFTS_EPIPOLAR };
enum { WELKIN_NAME_SIZE = 64 }; /* of a name, its NUL included */

/* Where a mesh stands. Its own frame is x east, y up, z south in metres, turned by heading_deg (clockwise from north),
 * times scale; its origin is at that latitude and longitude, altitude_m above sea level (gpu/placing.h). */
struct welkin_scene {
	char name[WELKIN_NAME_SIZE]; /* "": none; then the rest is as by default */
	double latitude_deg, longitude_deg, altitude_m, heading_deg, scale;
	int32_t shading;       /* enum welkin_shading */
	int32_t shadow;        /* enum welkin_shadow: how the shadow map is filtered */
	int32_t shadow_region; /* enum welkin_shadow_region */
	int32_t shadow_size;   /* texels along a side of the map */
	int32_t shafts;        /* enum welkin_shafts */
	int32_t shaft_steps;   /* samples along a ray where the scene may throw shadows */
};

/* The tables of noise that clouds are made from, as /v1/noise shows them (api/noise.c). */
enum welkin_noise_table { WELKIN_NOISE_BASE, WELKIN_NOISE_DETAIL, WELKIN_NOISE_CURL, WELKIN_NOISE_WEATHER };
enum {
	WELKIN_NOISE_TABLES = WELKIN_NOISE_WEATHER + 1,
	WELKIN_NOISE_BASE_SIDE = 128, /* texels along each axis of the volumes and the maps */
	WELKIN_NOISE_DETAIL_SIDE = 32,
	WELKIN_NOISE_CURL_SIDE = 128,
	WELKIN_NOISE_WEATHER_SIDE = 512
};

struct welkin_noise_slice {
	int32_t table; /* enum welkin_noise_table */
	int32_t layer; /* from 0; always 0 of a map */
};

/* Numbers that the operator's methods take, of all of them together. */
enum { WELKIN_METHOD_VALUES = 64 };

struct welkin_request {
	struct welkin_image image;
	int32_t reserved;
	struct welkin_camera camera;
	struct welkin_sun sun;
	int64_t time_ms; /* UTC, milliseconds since 1970 */
	double latitude_deg, longitude_deg;
	struct welkin_atmosphere atmosphere;
	double ground_albedo[3];
	struct welkin_clouds clouds;
	double exposure_ev;           /* EV100 for mode ev */
	double exposure_compensation; /* stops, added in every mode */
	int32_t exposure_mode, tone_map;
	double max_error, budget_ms; /* 0 budget: none */
	uint32_t seed;
	int32_t reserved2;
	struct welkin_scene scene;
	double method_values[WELKIN_METHOD_VALUES]; /* defaults but for the method asked for; 0 where nobody's */
};

#endif
