#include "api/api.h"

#include <string.h>

/*
 * The one table of request fields. Queries, JSON, validation, canonical text, the OpenAPI document, the
 * command line's help and the page's form are all made from it; its order is theirs. Fields of
 * one group stand together. A field whose default_text is "" gets its value in resolve.c.
 */

static const char *const projections[] = { "perspective", "equirectangular", "fisheye", "cube_face", "cubemap", NULL };
static const char *const cube_faces[] = { "front", "right", "back", "left", "up", "down", NULL };
static const char *const layers[] = { "depth", "transmittance", "inscatter", "clouds", NULL };
static const char *const png_bits[] = { "8", "16", NULL };
static const char *const exr_types[] = { "half", "float", NULL };
static const char *const exr_compressions[] = { "none", "rle", "zips", "zip", "piz", NULL };
static const char *const presets[] = { "earth", "madrid2015", "rayleigh", NULL };
static const char *const spectra[] = { "rgb", "4", "8", "16", "40", NULL };
static const char *const sun_spectra[] = { "solar", "flat", NULL };
static const char *const phases[] = { "cornette_shanks", "henyey_greenstein", "schlick", NULL };
static const char *const exposure_modes[] = { "auto", "ev", "pupil", NULL };
static const char *const tone_maps[] = { "agx", "aces", "reinhard", "exponential", "none", NULL };
static const char *const shadings[] = { "physical", "phong", NULL };
static const char *const shadows[] = { "none", "bilinear", "gaussian", "variance", "soft", "off", NULL };
static const char *const shadow_regions[] = { "static", "fitted", "cascaded", NULL };
static const char *const shafts[] = { "auto", "none", "march", "epipolar", NULL };

static const char *const cloud_presets[] = { "none", "cumulus", "towering", "stratocumulus", "stratus", "cirrus",
	NULL };
static const char *const cloud_lightings[] = { "physical", "artistic", NULL };
static const char *const cloud_shapes[] = { "dilated_squared", "dilated", "carved", "eroded", "product", "perlin",
	"worley", "uniform", NULL };
static const char *const worley_metrics[] = { "euclidean", "manhattan", NULL };
static const char *const high_clouds[] = { "cirrus", "cirrocumulus", "altocumulus", NULL };
static const char *const noise_volumes[] = { "procedural", "scene", NULL };
static const char *const weather_maps[] = { "procedural", "scene", NULL };
static const char *const cloud_savings[] = { "steps_by_elevation", "early_exit", "empty_space", "adaptive_steps",
	"light_volume", "half_resolution", "blue_noise", "shared_light", NULL };

#define AT(member) offsetof(struct welkin_request, member)

static const struct welkin_field built_in[] = {
	{ "image.width", WELKIN_TYPE_INT, "px", 1, 16384, "",
		"Width. Default: 1280 for perspective and cubemap, 1024 for equirectangular and fisheye, 512 for "
		"cube_face; "
		"when only the height is given, the same shape at that height.",
		NULL, AT(image.width) },
	{ "image.height", WELKIN_TYPE_INT, "px", 1, 16384, "",
		"Height. Default: 720 for perspective, 512 for equirectangular and cube_face, 1024 for fisheye, 960 "
		"for cubemap; "
		"when only the width is given, the same shape at that width.",
		NULL, AT(image.height) },
	{ "image.projection", WELKIN_TYPE_ENUM, "", 0, 0, "perspective",
		"How directions fall on the image: perspective (rectilinear), equirectangular (360 by 180 degrees), "
		"fisheye "
		"(equidistant dome), cube_face (one square face of 90 degrees) or cubemap (horizontal cross of six "
		"faces, 4:3).",
		projections, AT(image.projection) },
	{ "image.cube_face", WELKIN_TYPE_ENUM, "", 0, 0, "front",
		"Which face, seen from the camera's heading and pitch; for the projection cube_face.", cube_faces,
		AT(image.cube_face) },
	{ "image.layers", WELKIN_TYPE_FLAGS, "", 0, 0, "",
		"Extra layers of an EXR image: distance to the ground in metres, transmittance along the ray, light "
		"scattered into the ray; of the clouds the light that they and the air before them add, their "
		"transmittance and "
		"their mean distance.",
		layers, AT(image.layers) },
	{ "image.png_bits", WELKIN_TYPE_INT, "bit", 8, 16, "8", "Bits per channel of a PNG image: 8 or 16.", png_bits,
		AT(image.png_bits) },
	{ "image.exr_type", WELKIN_TYPE_ENUM, "", 0, 0, "half", "Number format of the colours of an EXR image.",
		exr_types, AT(image.exr_type) },
	{ "image.exr_compression", WELKIN_TYPE_ENUM, "", 0, 0, "zip", "Compression of an EXR image; all are lossless.",
		exr_compressions, AT(image.exr_compression) },
	{ "image.embed_timing", WELKIN_TYPE_BOOL, "", 0, 1, "false",
		"Write the timings into the file as well. Two renders of the same request then differ in their bytes.",
		NULL, AT(image.embed_timing) },
	{ "image.dither", WELKIN_TYPE_BOOL, "", 0, 1, "true",
		"Add noise of one step to 8-bit images after tone mapping, so that twilight shows no bands.", NULL,
		AT(image.dither) },

	{ "camera.position_m", WELKIN_TYPE_VEC3, "m", -2e8, 2e8, "",
		"Position x (east), y (up), z (south) from sea level at the place. Default: at camera.altitude_m above "
		"the place.",
		NULL, AT(camera.position_m) },
	{ "camera.altitude_m", WELKIN_TYPE_DOUBLE, "m", 0, 1e8, "1.7",
		"Height above sea level. Follows from camera.position_m when that is given; both given must agree.",
		NULL, AT(camera.altitude_m) },
	{ "camera.above_ground_m", WELKIN_TYPE_DOUBLE, "m", -1e8, 1e8, "",
		"Height above the surface of the scene at the camera's x and z; without a scene there, above sea "
		"level. It "
		"replaces the height in camera.position_m. Default: what the altitude comes to, or 1.7 when a scene is "
		"given and no height.",
		NULL, AT(camera.above_ground_m) },
	{ "camera.heading_deg", WELKIN_TYPE_DOUBLE, "deg", -360, 360, "",
		"Direction of view, clockwise from north. Default: towards the sun.", NULL, AT(camera.heading_deg) },
	{ "camera.pitch_deg", WELKIN_TYPE_DOUBLE, "deg", -90, 90, "0",
		"Tilt of the view: up is positive, 0 looks at the horizon.", NULL, AT(camera.pitch_deg) },
	{ "camera.roll_deg", WELKIN_TYPE_DOUBLE, "deg", -180, 180, "0",
		"Turn about the line of sight: clockwise is positive.", NULL, AT(camera.roll_deg) },
	{ "camera.fov_deg", WELKIN_TYPE_DOUBLE, "deg", 0.01, 360, "",
		"Field of view across the image's height; up to 179 for perspective, where 60 is the default, and 360 "
		"for fisheye, "
		"where 180 is. Without effect for the other projections.",
		NULL, AT(camera.fov_deg) },

	{ "sun.elevation_deg", WELKIN_TYPE_DOUBLE, "deg", -90, 90, "",
		"Height of the sun's centre above the horizon at the place, without refraction. Default: from time and "
		"place.",
		NULL, AT(sun.elevation_deg) },
	{ "sun.azimuth_deg", WELKIN_TYPE_DOUBLE, "deg", -360, 360, "",
		"Direction of the sun, clockwise from north. Default: from time and place.", NULL,
		AT(sun.azimuth_deg) },
	{ "sun.disk", WELKIN_TYPE_BOOL, "", 0, 1, "true", "Draw the sun's disk.", NULL, AT(sun.disk) },
	{ "sun.limb_darkening", WELKIN_TYPE_BOOL, "", 0, 1, "true",
		"Darken the sun's disk towards its edge, bluer light more. Its irradiance stays what it is.", NULL,
		AT(sun.limb_darkening) },
	{ "sun.intensity", WELKIN_TYPE_DOUBLE, "", 0, 1e6, "1", "Factor on the sun's irradiance.", NULL,
		AT(sun.intensity) },
	{ "sun.angular_radius_deg", WELKIN_TYPE_DOUBLE, "deg", 0.01, 45, "0.2666", "Angular radius of the sun's disk.",
		NULL, AT(sun.angular_radius_deg) },
	{ "sun.spectrum", WELKIN_TYPE_ENUM, "", 0, 0, "",
		"Irradiance at the top of the atmosphere: solar (ASTM G-173) or flat (1 W/m2/nm). Default: the "
		"preset's.",
		sun_spectra, AT(sun.spectrum) },

	{ "time", WELKIN_TYPE_TIME, "", 0, 0, "2026-06-21T00:00:00Z",
		"Date and time by RFC 3339, with Z or an offset from UTC, years 0000 to 9999.", NULL, AT(time_ms) },
	{ "place.latitude_deg", WELKIN_TYPE_DOUBLE, "deg", -90, 90, "35.3606",
		"Latitude, north positive. Default: Mount Fuji.", NULL, AT(latitude_deg) },
	{ "place.longitude_deg", WELKIN_TYPE_DOUBLE, "deg", -180, 180, "138.7274", "Longitude, east positive.", NULL,
		AT(longitude_deg) },

	{ "atmosphere.preset", WELKIN_TYPE_ENUM, "", 0, 0, "earth",
		"Where coefficients that are not given come from; /v1/presets lists the numbers.", presets,
		AT(atmosphere.preset) },
	{ "atmosphere.method", WELKIN_TYPE_ENUM, "", 0, 0, "auto",
		"How the sky is computed; /v1/methods says what each does, costs and where it fails. auto takes the "
		"cheapest that keeps accuracy.max_error, or the most accurate within accuracy.budget_ms, by those "
		"numbers.",
		welkin_method_names, AT(atmosphere.method) },
	{ "atmosphere.steps", WELKIN_TYPE_INT, "", 1, 512, "30", "Samples along a ray.", NULL, AT(atmosphere.steps) },
	{ "atmosphere.light_steps", WELKIN_TYPE_INT, "", 1, 512, "30",
		"Samples from each of them towards the sun, for methods that march there.", NULL,
		AT(atmosphere.light_steps) },
	{ "atmosphere.spectrum", WELKIN_TYPE_ENUM, "", 0, 0, "4",
		"Wavelengths of an image: rgb takes the coefficients at 680, 550 and 440 nm as red, green and blue; 4 "
		"renders four "
		"wavelengths and converts them by a fitted matrix; 8, 16 and 40 take evenly spaced ones, for accuracy.",
		spectra, AT(atmosphere.spectrum) },
	{ "atmosphere.max_order", WELKIN_TYPE_INT, "", 0, 100, "0",
		"Highest order of scattering, for methods that have several; 0 for all they have.", NULL,
		AT(atmosphere.max_order) },
	{ "atmosphere.turbidity", WELKIN_TYPE_DOUBLE, "", 1, 30, "3", "Haziness, for the analytic methods.", NULL,
		AT(atmosphere.turbidity) },
	{ "atmosphere.density_factor", WELKIN_TYPE_DOUBLE, "", 0, 100, "1",
		"Factor on the density of molecules and aerosol.", NULL, AT(atmosphere.density_factor) },
	{ "atmosphere.planet_radius_m", WELKIN_TYPE_DOUBLE, "m", 1e4, 1e8, "", "Radius of the planet at sea level.",
		NULL, AT(atmosphere.planet_radius_m) },
	{ "atmosphere.top_m", WELKIN_TYPE_DOUBLE, "m", 1e3, 1e6, "", "Height of the atmosphere's top above sea level.",
		NULL, AT(atmosphere.top_m) },
	{ "atmosphere.rayleigh.scattering_per_m", WELKIN_TYPE_TRIPLE, "1/m", 0, 0.1, "",
		"Scattering coefficient of molecules at sea level, at 680, 550 and 440 nm.", NULL,
		AT(atmosphere.rayleigh_scattering_per_m) },
	{ "atmosphere.rayleigh.scale_height_m", WELKIN_TYPE_DOUBLE, "m", 10, 1e6, "",
		"Height over which the density of molecules falls by a factor of e.", NULL,
		AT(atmosphere.rayleigh_scale_height_m) },
	{ "atmosphere.aerosol.scattering_per_m", WELKIN_TYPE_TRIPLE, "1/m", 0, 0.1, "",
		"Scattering coefficient of aerosol at sea level, at 680, 550 and 440 nm; a power law (Angstrom's) in "
		"between and beyond.",
		NULL, AT(atmosphere.aerosol_scattering_per_m) },
	{ "atmosphere.aerosol.absorption_per_m", WELKIN_TYPE_TRIPLE, "1/m", 0, 0.1, "",
		"Absorption coefficient of aerosol at sea level, at 680, 550 and 440 nm.", NULL,
		AT(atmosphere.aerosol_absorption_per_m) },
	{ "atmosphere.aerosol.scale_height_m", WELKIN_TYPE_DOUBLE, "m", 10, 1e6, "",
		"Height over which the density of aerosol falls by a factor of e.", NULL,
		AT(atmosphere.aerosol_scale_height_m) },
	{ "atmosphere.aerosol.g", WELKIN_TYPE_DOUBLE, "", -0.999, 0.999, "",
		"Asymmetry of the aerosol's phase function: forward is positive.", NULL, AT(atmosphere.aerosol_g) },
	{ "atmosphere.aerosol.phase", WELKIN_TYPE_ENUM, "", 0, 0, "",
		"Phase function of the aerosol. Default: the preset's.", phases, AT(atmosphere.aerosol_phase) },
	{ "atmosphere.ozone.column_du", WELKIN_TYPE_DOUBLE, "DU", 0, 1e5, "",
		"Ozone in a vertical column, in Dobson units.", NULL, AT(atmosphere.ozone_column_du) },
	{ "atmosphere.ozone.center_m", WELKIN_TYPE_DOUBLE, "m", 0, 1e6, "",
		"Height where ozone is densest; above and below it falls linearly to nothing.", NULL,
		AT(atmosphere.ozone_center_m) },
	{ "atmosphere.ozone.half_width_m", WELKIN_TYPE_DOUBLE, "m", 1, 1e6, "",
		"Distance from there to where it is nothing.", NULL, AT(atmosphere.ozone_half_width_m) },

	{ "ground.albedo", WELKIN_TYPE_TRIPLE, "", 0, 1, "",
		"Share of light the ground reflects, at 680, 550 and 440 nm.", NULL, AT(ground_albedo) },

	{ "clouds.preset", WELKIN_TYPE_ENUM, "", 0, 0, "none",
		"Kind of clouds: where the numbers below that are not given come from; /v1/presets lists them.",
		cloud_presets, AT(clouds.preset) },
	{ "clouds.coverage", WELKIN_TYPE_DOUBLE, "", 0, 1, "",
		"Share of the sky that the layer covers, about: 0 is clear, 1 overcast.", NULL, AT(clouds.coverage) },
	{ "clouds.type", WELKIN_TYPE_DOUBLE, "", 0, 1, "",
		"Profile over height: 0 stratus, 0.5 stratocumulus, 1 cumulus, and in between.", NULL,
		AT(clouds.type) },
	{ "clouds.precipitation", WELKIN_TYPE_DOUBLE, "", 0, 1, "", "Makes clouds denser and darker, as before rain.",
		NULL, AT(clouds.precipitation) },
	{ "clouds.anvil", WELKIN_TYPE_DOUBLE, "", 0, 1, "", "Spreads the tops of clouds, as of a storm.", NULL,
		AT(clouds.anvil) },
	{ "clouds.bottom_m", WELKIN_TYPE_DOUBLE, "m", 50, 5e4, "", "Altitude of the layer's lower end.", NULL,
		AT(clouds.bottom_m) },
	{ "clouds.top_m", WELKIN_TYPE_DOUBLE, "m", 60, 6e4, "", "Altitude of the layer's upper end.", NULL,
		AT(clouds.top_m) },
	{ "clouds.liquid_water_g_m3", WELKIN_TYPE_DOUBLE, "g/m3", 0, 10, "",
		"Liquid water where clouds are densest. With the droplets' radius it gives the extinction.", NULL,
		AT(clouds.liquid_water_g_m3) },
	{ "clouds.droplet_radius_um", WELKIN_TYPE_DOUBLE, "um", 1, 100, "", "Effective radius of the droplets.", NULL,
		AT(clouds.droplet_radius_um) },
	{ "clouds.albedo", WELKIN_TYPE_DOUBLE, "", 0, 1, "1",
		"Share of the light that meets a droplet which it scatters: 1 for water in visible light.", NULL,
		AT(clouds.albedo) },
	{ "clouds.phase.forward_g", WELKIN_TYPE_DOUBLE, "", 0, 0.98, "0.88",
		"Asymmetry of the forward lobe of the droplets' phase function.", NULL, AT(clouds.forward_g) },
	{ "clouds.phase.backward_g", WELKIN_TYPE_DOUBLE, "", -0.98, 0, "-0.3", "Asymmetry of its backward lobe.", NULL,
		AT(clouds.backward_g) },
	{ "clouds.phase.backward_share", WELKIN_TYPE_DOUBLE, "", 0, 1, "0.05",
		"Share of the light in the backward lobe.", NULL, AT(clouds.backward_share) },
	{ "clouds.weather.map", WELKIN_TYPE_ENUM, "", 0, 0, "procedural",
		"Where the weather map comes from: procedural, from coverage, type, precipitation and seed; scene, the "
		"weather.png of scene.name: red coverage, green precipitation, blue type, alpha height of the bases, "
		"the upper edge north. A coverage of 0 leaves the layer out all the same.",
		weather_maps, AT(clouds.weather_map) },
	{ "clouds.weather.scale_m", WELKIN_TYPE_DOUBLE, "m", 1e3, 1e6, "",
		"Side of the weather map: where there are clouds, of what type, how dense. A painted one repeats, a "
		"procedural one is shifted from region to region.",
		NULL, AT(clouds.weather_scale_m) },
	{ "clouds.wind.speed_m_s", WELKIN_TYPE_DOUBLE, "m/s", 0, 200, "8", "Speed at which clouds move.", NULL,
		AT(clouds.wind_speed_m_s) },
	{ "clouds.wind.heading_deg", WELKIN_TYPE_DOUBLE, "deg", -360, 360, "60",
		"Direction that they move to, clockwise from north.", NULL, AT(clouds.wind_heading_deg) },
	{ "clouds.wind.shear_m", WELKIN_TYPE_DOUBLE, "m", 0, 1e4, "300",
		"How far tops are ahead of bases, in the direction of the wind.", NULL, AT(clouds.shear_m) },
	{ "clouds.wind.evolution_m_s", WELKIN_TYPE_DOUBLE, "m/s", 0, 20, "1",
		"Speed at which shapes rise through the clouds, so that they change as they move.", NULL,
		AT(clouds.evolution_m_s) },
	{ "clouds.time_s", WELKIN_TYPE_DOUBLE, "s", -1e9, 1e9, "0", "Time at which the moving clouds are seen.", NULL,
		AT(clouds.time_s) },
	{ "clouds.noise.volumes", WELKIN_TYPE_ENUM, "", 0, 0, "procedural",
		"Where the noise that shapes are made from comes from: procedural, from clouds.base, clouds.detail and "
		"seed; scene, noise_base and noise_detail of scene.name, or the one of them that it has.",
		noise_volumes, AT(clouds.noise_volumes) },
	{ "clouds.base.scale_m", WELKIN_TYPE_DOUBLE, "m", 100, 1e5, "", "Side of the volume of shapes, which repeats.",
		NULL, AT(clouds.base_scale_m) },
	{ "clouds.base.shape", WELKIN_TYPE_ENUM, "", 0, 0, "dilated_squared",
		"How Perlin's noise P and Worley's W make shapes: dilated remap(P,0,1,W,1), its square, carved "
		"remap(P,W,1,0,1), eroded remap(P,W-1,1,0,1), their product, or one of them alone; uniform: no shapes "
		"but a slab of one density between the shells, to check numbers with.",
		cloud_shapes, AT(clouds.base_shape) },
	{ "clouds.base.perlin_frequency", WELKIN_TYPE_INT, "", 1, 32, "4",
		"Lattice cells of Perlin's noise along a side.", NULL, AT(clouds.base_perlin_frequency) },
	{ "clouds.base.perlin_octaves", WELKIN_TYPE_INT, "", 1, 6, "4", "Octaves of it, each twice as fine.", NULL,
		AT(clouds.base_perlin_octaves) },
	{ "clouds.base.persistence", WELKIN_TYPE_DOUBLE, "", 0, 1, "0.5", "Weight of each octave to the one before.",
		NULL, AT(clouds.base_persistence) },
	{ "clouds.base.worley_frequency", WELKIN_TYPE_INT, "", 1, 16, "4",
		"Cells of Worley's noise along a side; finer channels have two and four times as many.", NULL,
		AT(clouds.base_worley_frequency) },
	{ "clouds.base.worley_metric", WELKIN_TYPE_ENUM, "", 0, 0, "euclidean", "Distance in Worley's noise.",
		worley_metrics, AT(clouds.base_metric) },
	{ "clouds.base.worley_inverted", WELKIN_TYPE_BOOL, "", 0, 1, "true",
		"Worley's noise is 1 at its points and falls, which gives billows; false: the other way round.", NULL,
		AT(clouds.base_inverted) },
	{ "clouds.base.gamma", WELKIN_TYPE_DOUBLE, "", 0.1, 10, "1", "Exponent of the finished shapes.", NULL,
		AT(clouds.base_gamma) },
	{ "clouds.detail.scale_m", WELKIN_TYPE_DOUBLE, "m", 10, 1e5, "", "Side of the volume of detail, which repeats.",
		NULL, AT(clouds.detail_scale_m) },
	{ "clouds.detail.frequency", WELKIN_TYPE_INT, "", 1, 8, "2", "Cells of its noise along a side.", NULL,
		AT(clouds.detail_frequency) },
	{ "clouds.detail.gamma", WELKIN_TYPE_DOUBLE, "", 0.1, 10, "1", "Exponent of the detail.", NULL,
		AT(clouds.detail_gamma) },
	{ "clouds.detail.strength", WELKIN_TYPE_DOUBLE, "", 0, 1, "", "How much the detail erodes edges.", NULL,
		AT(clouds.detail_strength) },
	{ "clouds.curl.scale_m", WELKIN_TYPE_DOUBLE, "m", 100, 1e5, "6000", "Side of the map of swirls, which repeats.",
		NULL, AT(clouds.curl_scale_m) },
	{ "clouds.curl.strength_m", WELKIN_TYPE_DOUBLE, "m", 0, 5e3, "", "How far swirls displace the detail.", NULL,
		AT(clouds.curl_strength_m) },
	{ "clouds.high.coverage", WELKIN_TYPE_DOUBLE, "", 0, 1, "", "Share of the sky that thin high clouds cover.",
		NULL, AT(clouds.high_coverage) },
	{ "clouds.high.type", WELKIN_TYPE_ENUM, "", 0, 0, "cirrus", "Kind of high clouds.", high_clouds,
		AT(clouds.high_type) },
	{ "clouds.high.optical_depth", WELKIN_TYPE_DOUBLE, "", 0, 5, "0.4",
		"Their vertical optical depth where densest.", NULL, AT(clouds.high_optical_depth) },
	{ "clouds.high.altitude_m", WELKIN_TYPE_DOUBLE, "m", 100, 6e4, "8500", "Their altitude.", NULL,
		AT(clouds.high_altitude_m) },
	{ "clouds.high.scale_m", WELKIN_TYPE_DOUBLE, "m", 1e3, 1e6, "45000", "Side of their map, which repeats.", NULL,
		AT(clouds.high_scale_m) },
	{ "clouds.lighting", WELKIN_TYPE_ENUM, "", 0, 0, "physical",
		"physical: all orders of scattering, light of sky and ground; artistic: Beer, powder and an ambient by "
		"height, as games do.",
		cloud_lightings, AT(clouds.lighting) },
	{ "clouds.steps", WELKIN_TYPE_INT, "", 1, 1024, "128", "Samples along a ray through the layer, at most.", NULL,
		AT(clouds.steps) },
	{ "clouds.light_steps", WELKIN_TYPE_INT, "", 1, 32, "6", "Samples from each of them towards the sun.", NULL,
		AT(clouds.light_steps) },
	{ "clouds.savings", WELKIN_TYPE_FLAGS, "", 0, 0,
		"steps_by_elevation,early_exit,empty_space,adaptive_steps,light_volume,half_resolution,blue_noise",
		"What makes the march cheaper; an empty value switches all of it off. steps_by_elevation: half as many "
		"of the uniform steps upwards as "
		"level; early_exit: not behind what is opaque; empty_space: not where there are no clouds; "
		"adaptive_steps: by distance and "
		"optical depth instead of uniform; light_volume: the sun's depth by three samples and a grid instead "
		"of "
		"light_steps; "
		"shared_light: one sun's depth for two samples; half_resolution: every fourth pixel both ways, the "
		"others between them where "
		"those agree or change evenly, and likewise their shade in the air below, in images of 36,864 pixels "
		"or more; "
		"blue_noise: a first step that differs from pixel to "
		"pixel, so that steps don't "
		"show as bands.",
		cloud_savings, AT(clouds.savings) },
	{ "clouds.reprojection", WELKIN_TYPE_BOOL, "", 0, 1, "false",
		"In sequences, march one of sixteen pixels and take the others from the frame before, moved with "
		"camera "
		"and wind, instead of half_resolution; all anew after a cut. Single renders have no frame before and "
		"do "
		"not change. Not in images of fewer than 36,864 pixels or in cubemap.",
		NULL, AT(clouds.reprojection) },
	{ "scene.name", WELKIN_TYPE_NAME, "", 0, 0, "",
		"A mesh to stand under the sky, one of /v1/scenes; empty for none.", NULL, AT(scene.name) },
	{ "scene.latitude_deg", WELKIN_TYPE_DOUBLE, "deg", -90, 90, "",
		"Latitude of the scene's origin. Default: where the scene says that it lies (which then is the default "
		"of "
		"place.latitude_deg too), else place.latitude_deg.",
		NULL, AT(scene.latitude_deg) },
	{ "scene.longitude_deg", WELKIN_TYPE_DOUBLE, "deg", -180, 180, "",
		"Longitude of the scene's origin, with a default like that of scene.latitude_deg.", NULL,
		AT(scene.longitude_deg) },
	{ "scene.altitude_m", WELKIN_TYPE_DOUBLE, "m", -1e6, 1e6, "0",
		"Height of the scene's origin above sea level. Default: the scene's own, or 0.", NULL,
		AT(scene.altitude_m) },
	{ "scene.heading_deg", WELKIN_TYPE_DOUBLE, "deg", -360, 360, "0",
		"Turn of the scene, clockwise. Default: the scene's own, or 0.", NULL, AT(scene.heading_deg) },
	{ "scene.scale", WELKIN_TYPE_DOUBLE, "", 1e-4, 1e4, "1",
		"Factor on the scene's size. Default: the scene's own, or 1.", NULL, AT(scene.scale) },

	{ "scene.shading", WELKIN_TYPE_ENUM, "", 0, 0, "physical",
		"How its surfaces are lit: physical (sun and sky through the air, Lambert and GGX) or phong (ambient, "
		"diffuse and specular, as in 2015).",
		shadings, AT(scene.shading) },
	{ "scene.shadow", WELKIN_TYPE_ENUM, "", 0, 0, "gaussian",
		"How the shadow map is read: none (one comparison), bilinear, gaussian, variance, or soft (edges as "
		"wide "
		"as the sun's disk makes them, by the distance of what throws the shadow); off for no shadows.",
		shadows, AT(scene.shadow) },
	{ "scene.shadow_region", WELKIN_TYPE_ENUM, "", 0, 0, "static",
		"What the shadow map covers: static (the whole scene, one map for every camera), fitted (what the view "
		"sees) "
		"or cascaded (four maps, finer near the camera).",
		shadow_regions, AT(scene.shadow_region) },
	{ "scene.shadow_size", WELKIN_TYPE_INT, "px", 64, 8192, "2048", "Side of the shadow map.", NULL,
		AT(scene.shadow_size) },
	{ "scene.shafts", WELKIN_TYPE_ENUM, "", 0, 0, "auto",
		"Shadows in the air: none, march (every pixel's ray is followed), epipolar (few rays are, in planes "
		"through "
		"the sun), or auto, the cheaper of both.",
		shafts, AT(scene.shafts) },
	{ "scene.shaft_steps", WELKIN_TYPE_INT, "", 4, 1024, "64",
		"Samples along a ray where the scene may throw shadows.", NULL, AT(scene.shaft_steps) },

	{ "exposure.mode", WELKIN_TYPE_ENUM, "", 0, 0, "auto",
		"auto meters the image; ev takes exposure.ev; pupil narrows with the angle between view and sun, as an "
		"eye does.",
		exposure_modes, AT(exposure_mode) },
	{ "exposure.ev", WELKIN_TYPE_DOUBLE, "EV", -24, 32, "15",
		"Exposure value at ISO 100, for the mode ev; 15 is a sunny day.", NULL, AT(exposure_ev) },
	{ "exposure.compensation_ev", WELKIN_TYPE_DOUBLE, "EV", -20, 20, "0",
		"Brightens the image by so many stops, in every mode.", NULL, AT(exposure_compensation) },
	{ "tone.map", WELKIN_TYPE_ENUM, "", 0, 0, "aces", "Curve from luminance to the display, for PNG images.",
		tone_maps, AT(tone_map) },

	{ "accuracy.max_error", WELKIN_TYPE_DOUBLE, "", 0, 10, "0.02",
		"Relative error of luminance that may be made (root of the mean square over the image): for choosing "
		"the "
		"method, and where methods with a standard error stop. 0: as small as can be.",
		NULL, AT(max_error) },
	{ "accuracy.budget_ms", WELKIN_TYPE_DOUBLE, "ms", 0, 3.6e6, "0",
		"Device time that may be spent; 0 sets no limit.", NULL, AT(budget_ms) },
	{ "seed", WELKIN_TYPE_SEED, "", 0, 4294967295.0, "0", "Of the random numbers in noise and dither.", NULL,
		AT(seed) },
};

enum { BUILT_IN = sizeof built_in / sizeof built_in[0] };

_Static_assert(BUILT_IN + WELKIN_METHOD_VALUES <= WELKIN_FIELDS_MAX, "raise WELKIN_FIELDS_MAX");

static struct welkin_field extended[WELKIN_FIELDS_MAX];

const struct welkin_field *welkin_fields = built_in;
int welkin_field_count = BUILT_IN;
atomic_uchar welkin_method_hidden[WELKIN_METHODS_MAX];

bool welkin_field_add(const struct welkin_field *field)
{
	if (welkin_field_count == WELKIN_FIELDS_MAX)
		return false;
	if (welkin_fields == built_in)
		memcpy(extended, built_in, sizeof built_in);
	extended[welkin_field_count++] = *field;
	welkin_fields = extended;
	return true;
}

void welkin_fields_reset(void)
{
	welkin_fields = built_in;
	welkin_field_count = BUILT_IN;
}

static bool of_scene(const struct welkin_field *field)
{
	return !strncmp(field->name, "scene.", 6) && field->type != WELKIN_TYPE_NAME;
}

bool welkin_field_idle(const struct welkin_field *field, const struct welkin_request *request)
{
	if (field->of_method)
		return field->of_method - 1 != request->atmosphere.method;
	return !request->scene.name[0] && of_scene(field);
}

bool welkin_name_valid(const char *name)
{
	static const char allowed[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
	const size_t length = strlen(name);
	return length < WELKIN_NAME_SIZE && strspn(name, allowed) == length && (!length || !strchr("._-", name[0]));
}

int welkin_field_find(const char *name)
{
	for (int i = 0; i < welkin_field_count; i++)
		if (!strcmp(welkin_fields[i].name, name))
			return i;
	return -1;
}
