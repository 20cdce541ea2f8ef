/*
 * From a resolved request to the numbers that kernels read. All of it is done in double precision
 * and rounded to float once, at the end.
 */
#include "gpu/scene.h"

#include "gpu/clouds.h"
#include "gpu/method.h"
#include "gpu/spectrum.h"

#include <math.h>
#include <string.h>

/* Molecules per m² in one Dobson unit. */
static const double dobson_per_m2 = 2.687e20;

/* Nodes of the rule that builds tables: columns converge below 1e-6 (tests/test_quadrature.c). */
enum { TABLE_STEPS = 96 };

/* Zenith angles above and below the horizon from which the multiple-scattering table gathers. */
enum { AROUND_STEPS = 12, AROUND_COARSE_STEPS = 6 };

/* Nodes between two distances of the aerial-perspective table. */
enum { SLICE_STEPS = 3 };

/* Angles from 0 to 180 degrees at which lobes of the aerosol's phase function are kept, the degree of their series, and
 * of the one that the multiple-scattering table takes in: what its azimuths resolve. */
enum { LOBE_SAMPLES = 256, LOBE_DEGREES = 48, LOBE_TABLE_DEGREE = 8 };

/* Steps that a piece of a ray gets at least, if that many were asked for. */
enum { PIECE_STEPS = 4 };

static const double PEAK_DEG = 6;

static double radians(double degrees)
{
	return degrees * (M_PI / 180.0);
}

static void to_vec4(vec4 out, const double v[3], double w)
{
	for (int i = 0; i < 3; i++)
		out[i] = (float)v[i];
	out[3] = (float)w;
}

static void cross(const double a[3], const double b[3], double out[3])
{
	out[0] = a[1] * b[2] - a[2] * b[1];
	out[1] = a[2] * b[0] - a[0] * b[2];
	out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Unit vector of a heading clockwise from north and an elevation: x east, y up, z south. */
static void direction(double heading_deg, double elevation_deg, double out[3])
{
	const double heading = radians(heading_deg), elevation = radians(elevation_deg);
	out[0] = sin(heading) * cos(elevation);
	out[1] = sin(elevation);
	out[2] = -cos(heading) * cos(elevation);
}

static void set_camera(struct FrameBlock *frame, const struct welkin_request *request)
{
	const struct welkin_camera *camera = &request->camera;
	const double heading = radians(camera->heading_deg), roll = radians(camera->roll_deg);
	double forward[3], right[3] = { cos(heading), 0, sin(heading) }, up[3], rolled_right[3], rolled_up[3];
	direction(camera->heading_deg, camera->pitch_deg, forward);
	cross(right, forward, up);
	for (int i = 0; i < 3; i++) {
		rolled_right[i] = right[i] * cos(roll) - up[i] * sin(roll);
		rolled_up[i] = up[i] * cos(roll) + right[i] * sin(roll);
	}
	to_vec4(frame->camera_forward, forward, 0);
	to_vec4(frame->camera_right, rolled_right, 0);
	to_vec4(frame->camera_up, rolled_up, 0);

	double from_center[3] = { camera->position_m[0], camera->position_m[1] + request->atmosphere.planet_radius_m,
		camera->position_m[2] };
	const double r = hypot(hypot(from_center[0], from_center[1]), from_center[2]);
	for (int i = 0; i < 3; i++)
		from_center[i] /= r;
	to_vec4(frame->vertical, from_center, 0);
	frame->camera_altitude = (float)camera->altitude_m;
	frame->tan_half_fov = (float)tan(radians(camera->fov_deg) / 2);
	frame->fov = (float)radians(camera->fov_deg);
}

static void set_sun(struct FrameBlock *frame, const struct welkin_sun *sun)
{
	const double radius = radians(sun->angular_radius_deg);
	double to_sun[3];
	direction(sun->azimuth_deg, sun->elevation_deg, to_sun);
	to_vec4(frame->sun_direction, to_sun, cos(radius));
	frame->sun_angular_radius = (float)radius;
	frame->sun_solid_angle = (float)(4 * M_PI * pow(sin(radius / 2), 2));
}

/* Appends the n-point Gauss-Legendre rule on [0,1]: zeros of P_n by Newton's method from the usual
 * cosine guess, weights 2/((1-x²)P'²) (Abramowitz & Stegun 25.4.29), halved for the interval. */
static void add_rule(struct scene *scene, int rule, int n)
{
	float(*node)[2] = scene->nodes + scene->n_nodes;
	for (int i = 0; i < (n + 1) / 2; i++) {
		double x = cos(M_PI * (i + 0.75) / (n + 0.5)), slope = 1;
		for (int iteration = 0; iteration < 8; iteration++) {
			double p0 = 1, p1 = x;
			for (int k = 2; k <= n; k++) {
				const double p2 = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
				p0 = p1;
				p1 = p2;
			}
			slope = n * (p0 - x * p1) / (1 - x * x);
			const double step = p1 / slope;
			x -= step;
			if (fabs(step) < 1e-15)
				break;
		}
		const double weight = 1 / ((1 - x * x) * slope * slope);
		node[i][0] = (float)((1 - x) / 2);
		node[n - 1 - i][0] = (float)((1 + x) / 2);
		node[i][1] = node[n - 1 - i][1] = (float)weight;
	}
	scene->media.rule[rule][0] = scene->n_nodes;
	scene->media.rule[rule][1] = n;
	scene->n_nodes += n;
}

/* Steps for each of the pieces. Fewer than PIECE_STEPS on a piece would show where a ray gets one piece more. */
static int share_of_steps(int steps, int pieces)
{
	const int share = steps / pieces, least = steps < PIECE_STEPS ? steps : PIECE_STEPS;
	return share > least ? share : least;
}

/* The aerosol's phase function, per steradian; the same formulas as in shaders/atmosphere.glsl. */
static double phase_aerosol(const struct welkin_atmosphere *air, double nu)
{
	const double g = air->aerosol_g, k = 1.55 * g - 0.55 * g * g * g;
	if (air->aerosol_phase == WELKIN_SCHLICK)
		return (1 - k * k) / (4 * M_PI * pow(1 - k * nu, 2));
	const double hg = (1 - g * g) / (4 * M_PI * pow(pow(1 - g, 2) + 2 * g * (1 - nu), 1.5));
	return air->aerosol_phase == WELKIN_HENYEY_GREENSTEIN ? hg : hg * 1.5 * (1 + nu * nu) / (2 + g * g);
}

/* Legendre polynomials up to LOBE_DEGREES at x; share[l] is 1 / l: divisions would be most of the work, at every frame.
 */
static void legendre(double x, const double share[LOBE_DEGREES + 1], double P[LOBE_DEGREES + 1])
{
	P[0] = 1;
	P[1] = x;
	for (int l = 2; l <= LOBE_DEGREES; l++)
		P[l] = (2 - share[l]) * x * P[l - 1] - (1 - share[l]) * P[l - 2];
}

static void legendre_shares(double share[LOBE_DEGREES + 1])
{
	share[0] = 0;
	for (int l = 1; l <= LOBE_DEGREES; l++)
		share[l] = 1.0 / l;
}

/* Delta-M (after Wiscombe 1977) of that phase function for LOBE_DEGREES moments and a peak. What it scatters by less
 * than PEAK_DEG counts as not scattered at all; that share f leaves (chi - f) / (1 - f) of each Legendre moment.
 * Wiscombe's own f, the third moment, is 0.51 at g = 0.8 and takes for unscattered what long paths at low suns
 * lose: the sky of preset earth is then up to 15 % too bright at the horizon at sunset, and 5 % with this. Midpoint
 * rule in u with 1 - nu = 2 u^4, which resolves peaks of g = 0.999. */
static void delta_scale(const struct welkin_atmosphere *air, double moments[LOBE_DEGREES + 1], double *f)
{
	enum { N = 512 };
	const double sign = air->aerosol_g < 0 ? -1 : 1; /* samples are dense where the peak is */
	const double edge = cos(radians(PEAK_DEG));
	double all = 0, peak = 0, P[LOBE_DEGREES + 1], share[LOBE_DEGREES + 1];
	legendre_shares(share);
	memset(moments, 0, (LOBE_DEGREES + 1) * sizeof *moments);
	for (int i = 0; i < N; i++) {
		const double u = (i + 0.5) / N, nu = sign * (1 - 2 * pow(u, 4));
		const double weight = phase_aerosol(air, nu) * pow(u, 3);
		all += weight;
		peak += nu > edge ? weight : 0;
		if (nu > edge)
			continue;
		legendre(nu, share, P);
		for (int l = 0; l <= LOBE_DEGREES; l++)
			moments[l] += weight * P[l];
	}
	*f = fmin(peak / all, 0.9999);
	for (int l = 0; l <= LOBE_DEGREES; l++)
		moments[l] /= all * (1 - *f);
}

/* RULE_LOBES: the scaled phase function as the multiple-scattering table takes it in, and what it becomes by scattering
 * on, two to four times in all, beyond the degrees that the table keeps: a series of Legendre polynomials whose
 * moments are powers of its own. */
static void add_lobes(struct scene *scene, const double moments[LOBE_DEGREES + 1])
{
	float(*node)[2] = scene->nodes + scene->n_nodes;
	double share[LOBE_DEGREES + 1];
	legendre_shares(share);
	for (int i = 0; i < LOBE_SAMPLES; i++) {
		double P[LOBE_DEGREES + 1], once = 0, again[3] = { 0 };
		legendre(cos(M_PI * i / (LOBE_SAMPLES - 1)), share, P);
		for (int l = 0; l <= LOBE_DEGREES; l++) {
			double term = (2 * l + 1) / (4 * M_PI) * P[l] * moments[l];
			once += l <= LOBE_TABLE_DEGREE ? term : 0;
			for (int n = 0; n < 3 && l > 2; n++)
				again[n] += term *= moments[l];
		}
		node[i][0] = (float)once;
		node[i][1] = (float)again[0];
		node[LOBE_SAMPLES + i][0] = (float)again[1];
		node[LOBE_SAMPLES + i][1] = (float)again[2];
	}
	scene->media.rule[RULE_LOBES][0] = scene->n_nodes;
	scene->media.rule[RULE_LOBES][1] = LOBE_SAMPLES;
	scene->n_nodes += 2 * LOBE_SAMPLES;
}

static void set_media(struct scene *scene, const struct welkin_atmosphere *air)
{
	struct MediaBlock *media = &scene->media;
	media->planet_radius = (float)air->planet_radius_m;
	media->top = (float)air->top_m;
	media->rayleigh_scale_height = (float)air->rayleigh_scale_height_m;
	media->aerosol_scale_height = (float)air->aerosol_scale_height_m;
	media->ozone_center = (float)air->ozone_center_m;
	media->ozone_half_width = (float)air->ozone_half_width_m;
	media->aerosol_g = (float)air->aerosol_g;
	media->aerosol_phase = air->aerosol_phase;
	media->steps = air->steps;
	media->light_steps = air->light_steps;
	media->turbidity = (float)air->turbidity;
	for (int pieces = 1; pieces <= 4; pieces++)
		add_rule(scene, RULE_VIEW + pieces - 1, share_of_steps(air->steps, pieces));
	for (int pieces = 1; pieces <= 2; pieces++) {
		add_rule(scene, RULE_LIGHT + pieces - 1, share_of_steps(air->light_steps, pieces));
		add_rule(scene, RULE_TABLE + pieces - 1, TABLE_STEPS / pieces);
	}
	add_rule(scene, RULE_AROUND, AROUND_STEPS);
	add_rule(scene, RULE_AROUND_COARSE, AROUND_COARSE_STEPS);
	add_rule(scene, RULE_SLICE, SLICE_STEPS);
	double moments[LOBE_DEGREES + 1], peak;
	delta_scale(air, moments, &peak);
	add_lobes(scene, moments);
	media->aerosol_moments[0] = (float)moments[1];
	media->aerosol_moments[1] = (float)moments[2];
	media->aerosol_higher[0] = (float)moments[3];
	media->aerosol_higher[1] = (float)moments[4];
	media->aerosol_moments[2] = (float)(1 - peak);
}

/* Fills lane i of a batch. */
static void set_band(struct BandsBlock *bands, int i, const struct MediaBlock *media,
	const struct welkin_request *request, double wavelength_nm, const double to_rgb[3])
{
	const struct welkin_atmosphere *air = &request->atmosphere;
	const bool flat = request->sun.spectrum == WELKIN_SUN_FLAT;
	const double density = air->density_factor;
	const double aerosol = density * spectrum_power_law(air->aerosol_scattering_per_m, wavelength_nm);
	const double absorbed = density * spectrum_power_law(air->aerosol_absorption_per_m, wavelength_nm);
	static const double rec709_luminance[3] = { 0.2126390, 0.7151687, 0.0721923 }; /* Y, with white D65 */
	double daylight[3], luminance = 0;
	spectrum_daylight(wavelength_nm, daylight);
	bands->wavelength[i] = (float)wavelength_nm;
	bands->sun_irradiance[i] = (float)(request->sun.intensity * (flat ? 1.0 : spectrum_solar(wavelength_nm)));
	bands->rayleigh[i] = (float)(density * spectrum_power_law(air->rayleigh_scattering_per_m, wavelength_nm));
	bands->aerosol_scattering[i] = (float)aerosol;
	bands->aerosol_extinction[i] = (float)(aerosol + absorbed);
	bands->aerosol_scaled_extinction[i] = (float)(absorbed + aerosol * media->aerosol_moments[2]);
	bands->ozone[i] =
		(float)(air->ozone_column_du * dobson_per_m2 * spectrum_ozone(wavelength_nm) / air->ozone_half_width_m);
	bands->ground_albedo[i] = (float)spectrum_linear(request->ground_albedo, wavelength_nm);
	/* edges chosen so that the primaries come back under daylight (tests/test_surfaces.c says how well) */
	const double blue = 1 / (1 + exp((wavelength_nm - 493) / 9)), red = 1 / (1 + exp((587 - wavelength_nm) / 8));
	bands->blue[i] = (float)blue;
	bands->red[i] = (float)fmin(red, 1 - blue);
	for (int k = 0; k < 3; k++) {
		bands->daylight[k][i] = (float)daylight[k];
		bands->to_rgb[k][i] = (float)to_rgb[k];
		luminance += rec709_luminance[k] * to_rgb[k];
	}
	bands->sun_luminance[i] = (float)(luminance * bands->sun_irradiance[i]);
}

/* The luminance of each CIE daylight component, by the 5 nm sum of its product with ybar. */
static void daylight_luminance(double out[3])
{
	out[0] = out[1] = out[2] = 0;
	for (int nm = 360; nm <= 830; nm += 5) {
		double xyz[3], s[3];
		spectrum_cie(nm, xyz);
		spectrum_daylight(nm, s);
		for (int k = 0; k < 3; k++)
			out[k] += 683 * 5 * xyz[1] * s[k];
	}
}

static void set_bands(struct scene *scene, const struct welkin_request *request, const double *wavelengths_nm, int n)
{
	static const double none[3] = { 0, 0, 0 };
	double bands_nm[WELKIN_MAX_WAVELENGTHS], to_rgb[WELKIN_MAX_WAVELENGTHS][3];
	double luminance[3];
	memset(to_rgb, 0, sizeof to_rgb);
	daylight_luminance(luminance);
	if (!wavelengths_nm) {
		n = spectrum_bands(request->atmosphere.spectrum, request->sun.spectrum, bands_nm, to_rgb);
		wavelengths_nm = bands_nm;
	}
	scene->n_bands = n;
	scene->n_batches = (n + 3) / 4;
	for (int lane = 0; lane < scene->n_batches * 4; lane++) {
		const int band = lane < n ? lane : n - 1; /* padding costs nothing and changes nothing: weight 0 */
		set_band(&scene->batches[lane / 4], lane % 4, &scene->media, request, wavelengths_nm[band],
			lane < n ? to_rgb[lane] : none);
		to_vec4(scene->batches[lane / 4].daylight_luminance, luminance, 0);
	}
}

/* What the disk's pass, which sees colours only, darkens them by: the mean over the bands by their share of each
 * colour, right to first order in how the exponents differ. */
static void set_limb(struct scene *scene)
{
	const double *law = spectrum_limb_law;
	to_vec4(scene->frame.limb_law, law, 0);
	for (int c = 0; c < 3; c++) {
		double sum = 0, weighted = 0;
		for (int band = 0; band < 4 * scene->n_batches; band++) {
			const struct BandsBlock *bands = &scene->batches[band / 4];
			const double share =
				(double)bands->to_rgb[c][band % 4] * (double)bands->sun_irradiance[band % 4];
			const double x = 1e3 / (double)bands->wavelength[band % 4];
			sum += share;
			weighted += share * (law[0] + x * (law[1] + x * law[2]));
		}
		scene->frame.limb[c] = sum > 0 ? (float)fmin(fmax(weighted / sum, 0), 1) : 0;
	}
}

static void set_method_values(struct scene *scene, const struct welkin_request *request)
{
	const int index = request->atmosphere.method;
	const struct method *method = index >= 0 && index < welkin_method_count ? welkin_methods[index] : NULL;
	for (int i = 0; method && i < method->n_values; i++)
		scene->method_values[i] = (float)request->method_values[method->first_value + i];
}

void scene_prepare(struct scene *scene, const struct welkin_request *request, const double *wavelengths_nm, int n)
{
	memset(scene, 0, offsetof(struct scene, nodes));
	struct FrameBlock *frame = &scene->frame;
	frame->width = request->image.width;
	frame->height = request->image.height;
	frame->projection = request->image.projection;
	frame->cube_face = request->image.cube_face;
	frame->tone_map = request->tone_map;
	frame->dither = request->image.dither;
	frame->seed = request->seed;
	frame->exposure_scale = 1;
	set_camera(frame, request);
	set_sun(frame, &request->sun);
	set_media(scene, &request->atmosphere);
	scene->media.sun_intensity = (float)request->sun.intensity;
	set_bands(scene, request, wavelengths_nm, n);
	if (request->sun.limb_darkening)
		set_limb(scene);
	set_method_values(scene, request);
	clouds_prepare(scene, request);
}
