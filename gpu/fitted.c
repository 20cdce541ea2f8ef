/*
 * Method `fitted`: see fitted.h. Coefficients are interpolated here, in double precision and once a frame, and reach
 * the kernel through a block per batch.
 */
#include "gpu/fitted.h"

#include "gpu/fitted_data.inc"
#include "gpu/spectrum.h"

#include <math.h>
#include <string.h>

/* Numbers of the preset earth. */
static const double planet_radius_m = 6360e3, rayleigh_scale_height_m = 8000, aerosol_scale_height_m = 1200;
static const double ozone_center_m = 25e3, rayleigh_at_1um_per_m = 1.24062e-6, dobson_per_m2 = 2.687e20;

const int fitted_ground_term[FITTED_GROUND_TERMS] = { 0, 4, 5, 10, 16 }; /* all that are free of gamma */

static double clamp(double x, double low, double high)
{
	return fmin(fmax(x, low), high);
}

double fitted_rayleigh_depth(double wavelength_nm)
{
	return rayleigh_at_1um_per_m * rayleigh_scale_height_m * pow(wavelength_nm * 1e-3, -4);
}

double fitted_aerosol_depth(double turbidity)
{
	return (turbidity - 1) * fitted_rayleigh_depth(550);
}

double fitted_ozone_depth(double ozone_column_du, double wavelength_nm)
{
	return ozone_column_du * dobson_per_m2 * spectrum_ozone(wavelength_nm);
}

/* Of the horizontal ray, sqrt(pi x / 2) with x = radius over scale height. */
static double horizontal_mass(double scale_height_m)
{
	return sqrt(M_PI * planet_radius_m / (2 * scale_height_m));
}

/* Chapman's function for large spheres, sqrt(pi x / 2) erfcx(mu sqrt(x / 2)), with the closed form of erfcx by Ren &
 * MacKenzie 2007 (a = 2.911). */
double fitted_air_mass(double scale_height_m, double mu)
{
	const double a = 2.911, p = horizontal_mass(scale_height_m), z = p * mu;
	return p * a / ((a - 1) * z + sqrt(z * z + a * a));
}

void fitted_terms(const double exponent[FITTED_EXPONENTS], double cos_theta, double nu, double term[FITTED_TERMS])
{
	const double h = exponent[3], d = (1 - h) * (1 - h) + 2 * h * (1 - nu);
	const double inverse = 1 / (cos_theta + 0.01);
	const double first = exp(-exponent[0] * inverse), second = exp(-exponent[1] * inverse);
	const double base[5] = { 1, exp(-exponent[2] * acos(clamp(nu, -1, 1))), nu * nu, (1 + nu * nu) / (d * sqrt(d)),
		sqrt(cos_theta) };
	for (int i = 0; i < 5; i++) {
		term[i] = base[i];
		term[5 + i] = base[i] * first;
		if (i < 4)
			term[10 + i] = base[i] * second;
	}
	term[14] = nu;
	term[15] = nu * first;
	term[16] = cos_theta;
}

/* ---- interpolation ---- */

/* Four neighbouring nodes of an axis and their weights. */
struct span {
	int first;
	double weight[4];
};

/* Cubic Hermite between nodes with the slopes of parabolas through three; at the ends the slope of the chord. */
static struct span span_at(const double *node, int n, double x)
{
	struct span span = { 0 };
	int i = 0;
	x = clamp(x, node[0], node[n - 1]);
	while (i < n - 2 && x > node[i + 1])
		i++;
	const double gap = node[i + 1] - node[i], u = (x - node[i]) / gap;
	const double slope_weight[2] = { u * (1 - u) * (1 - u), -u * u * (1 - u) };
	double weight[4] = { 0, (1 + 2 * u) * (1 - u) * (1 - u), u * u * (3 - 2 * u), 0 }; /* of nodes i - 1 … i + 2 */
	for (int end = 0; end < 2; end++) {
		const int at = i + end;
		const double w = slope_weight[end] * gap;
		if (at == 0 || at == n - 1) {
			weight[1] -= w / gap;
			weight[2] += w / gap;
			continue;
		}
		const double before = node[at] - node[at - 1], after = node[at + 1] - node[at], both = before + after;
		weight[end] -= w * after / (before * both);
		weight[end + 1] += w * (after / before - before / after) / both;
		weight[end + 2] += w * before / (after * both);
	}
	/* at the ends of the axis the outer node has no weight: move the window inside */
	const int shift = i == 0 ? 1 : i == n - 2 ? -1 : 0;
	span.first = i - 1 + shift;
	for (int k = 0; k < 4; k++)
		span.weight[k] = k + shift >= 0 && k + shift < 4 ? weight[k + shift] : 0;
	return span;
}

/* What is interpolated: logarithms of mean radiance, ozone taken out, then shapes over mean. */
enum {
	LOG_SKY,
	LOG_GROUND,
	SKY_ALBEDO,
	SHAPE,
	GROUND_SHAPE = SHAPE + FITTED_TERMS,
	VALUES = GROUND_SHAPE + FITTED_GROUND_TERMS
};

/* The two nodes about x alone, so that positive skies stay positive: cubics swing below 0 where the light around
 * a setting sun dies away with turbidity. */
static struct span linear_at(const double *node, int n, double x)
{
	struct span span = span_at(node, n, x);
	int i = 0;
	x = clamp(x, node[0], node[n - 1]);
	while (i < n - 2 && x > node[i + 1])
		i++;
	const double u = (x - node[i]) / (node[i + 1] - node[i]);
	for (int k = 0; k < 4; k++)
		span.weight[k] = span.first + k == i ? 1 - u : span.first + k == i + 1 ? u : 0;
	return span;
}

/* weight: of the logarithms; shape_weight: of the shapes. */
static void add_node(double value[VALUES], double weight, double shape_weight, int t, int sun, int w)
{
	const short *sky = fitted_sky[t][sun][w], *ground = fitted_ground[t][sun][w];
	const double ozone = fitted_ozone_mass[sun] * fitted_ozone_depth(300, fitted_nm[w]);
	value[LOG_SKY] += weight * (fitted_log_sky[t][sun][w] * FITTED_LOG_QUANTUM + ozone);
	value[LOG_GROUND] += weight * (fitted_log_ground[t][sun][w] * FITTED_LOG_QUANTUM + ozone);
	value[SKY_ALBEDO] += weight * fitted_sky_albedo[t][w];
	for (int k = 0; k < FITTED_TERMS; k++)
		value[SHAPE + k] += shape_weight * sky[k] * fitted_sky_quantum[k];
	for (int k = 0; k < FITTED_GROUND_TERMS; k++)
		value[GROUND_SHAPE + k] += shape_weight * ground[k] * fitted_ground_quantum[k];
}

void fitted_coefficients(double turbidity, double sun_elevation_deg, double albedo, double ozone_column_du,
	double wavelength_nm, double coefficient[FITTED_TERMS], double *mean)
{
	double log_nm[FITTED_WAVELENGTHS], value[VALUES] = { 0 }, mass = 0;
	for (int w = 0; w < FITTED_WAVELENGTHS; w++)
		log_nm[w] = log(fitted_nm[w]);
	const struct span of_t = span_at(fitted_turbidities, FITTED_TURBIDITIES, turbidity);
	const struct span shape_of_t = linear_at(fitted_turbidities, FITTED_TURBIDITIES, turbidity);
	const struct span of_sun = span_at(fitted_suns_deg, FITTED_SUNS, sun_elevation_deg);
	const struct span of_nm = span_at(log_nm, FITTED_WAVELENGTHS, log(wavelength_nm));
	for (int s = 0; s < 4; s++) {
		mass += of_sun.weight[s] * fitted_ozone_mass[of_sun.first + s];
		for (int t = 0; t < 4; t++)
			for (int w = 0; w < 4; w++) {
				const double both = of_sun.weight[s] * of_nm.weight[w];
				add_node(value, both * of_t.weight[t], both * shape_of_t.weight[t], of_t.first + t,
					of_sun.first + s, of_nm.first + w);
			}
	}
	const double through = exp(-mass * fitted_ozone_depth(ozone_column_du, wavelength_nm));
	const double sky = exp(value[LOG_SKY]) * through, s = value[SKY_ALBEDO];
	const double ground = exp(value[LOG_GROUND]) * through * albedo * (1 - s) / (1 - albedo * s);
	if (mean)
		*mean = sky + ground;
	for (int k = 0; k < FITTED_TERMS; k++)
		coefficient[k] = sky * value[SHAPE + k];
	for (int k = 0; k < FITTED_GROUND_TERMS; k++)
		coefficient[fitted_ground_term[k]] += ground * value[GROUND_SHAPE + k];
}

/* ---- the kernel's block ---- */

/* The sky's irradiance on level ground over pi: the mean over equal shares of the projected hemisphere. */
enum { RINGS = 8, SECTORS = 8 };

static void sky_mean_terms(double mu_s, double mean[FITTED_TERMS])
{
	memset(mean, 0, FITTED_TERMS * sizeof *mean);
	for (int i = 0; i < RINGS * SECTORS; i++) {
		const double c = sqrt((i / SECTORS + 0.5) / RINGS), turn = M_PI * (i % SECTORS + 0.5) / SECTORS;
		const double nu = c * mu_s + sqrt(1 - c * c) * sqrt(fmax(1 - mu_s * mu_s, 0)) * cos(turn);
		double term[FITTED_TERMS];
		fitted_terms(fitted_exponents, c, nu, term);
		for (int k = 0; k < FITTED_TERMS; k++)
			mean[k] += term[k] / (RINGS * SECTORS);
	}
}

/* The darkest place of a sky: fits and interpolation may miss it by more than it is. */
static const double least_of_mean = 0.003;

struct place {
	double turbidity, elevation_deg, mu_s, ozone_du, stretch;
	double rayleigh, aerosol,
		ozone; /* share of each above the camera; ozone: slant factor of the sun at the ground */
	double mean_terms[FITTED_TERMS];
};

static void set_band(struct FittedBlock *block, int i, const struct BandsBlock *bands, const struct place *at)
{
	const double nm = (double)bands->wavelength[i], albedo = (double)bands->ground_albedo[i];
	const double sun = (double)bands->sun_irradiance[i];
	const double rayleigh = fitted_rayleigh_depth(nm), aerosol = fitted_aerosol_depth(at->turbidity);
	const double ozone = fitted_ozone_depth(at->ozone_du, nm);
	double k[FITTED_TERMS], below[FITTED_TERMS], irradiance = 0, mean;
	/* Molecules in thinner air look like those at sea level at a longer wavelength. */
	fitted_coefficients(1 + (at->turbidity - 1) * at->aerosol, at->elevation_deg, albedo, at->ozone_du,
		nm * at->stretch, k, &mean);
	fitted_coefficients(at->turbidity, at->elevation_deg, albedo, at->ozone_du, nm, below, NULL);
	for (int n = 0; n < FITTED_TERMS; n++) {
		block->term[n][i] = (float)(k[n] * sun);
		irradiance += below[n] * at->mean_terms[n] * M_PI;
	}
	if (at->mu_s > 0)
		irradiance += at->mu_s *
			      exp(-rayleigh * fitted_air_mass(rayleigh_scale_height_m, at->mu_s) -
				      aerosol * fitted_air_mass(aerosol_scale_height_m, at->mu_s) - ozone * at->ozone);
	block->least[i] = (float)(least_of_mean * mean * sun);
	block->ground[i] = (float)(albedo / M_PI * fmax(irradiance, 0) * sun);
	block->depth[0][i] = (float)(rayleigh * at->rayleigh);
	block->depth[1][i] = (float)(aerosol * at->aerosol);
	block->depth[2][i] = (float)ozone;
}

void fitted_prepare(struct scene *scene, const struct welkin_request *request)
{
	const float *up = scene->frame.vertical, *sun = scene->frame.sun_direction;
	const double h = clamp(request->camera.altitude_m, 0, 10e3);
	struct place at = { .turbidity = clamp(request->atmosphere.turbidity, fitted_turbidities[0],
				    fitted_turbidities[FITTED_TURBIDITIES - 1]),
		.ozone_du = request->atmosphere.ozone_column_du,
		.rayleigh = exp(-h / rayleigh_scale_height_m),
		.aerosol = exp(-h / aerosol_scale_height_m),
		.stretch = exp(h / (4 * rayleigh_scale_height_m)) };
	for (int i = 0; i < 3; i++)
		at.mu_s += (double)up[i] * (double)sun[i];
	at.mu_s = clamp(at.mu_s, -1, 1);
	at.elevation_deg = asin(at.mu_s) * 180 / M_PI;
	const double ratio = (planet_radius_m + h) / (planet_radius_m + ozone_center_m);
	at.ozone = 1 / sqrt(1 - ratio * ratio * (1 - at.mu_s * at.mu_s));
	sky_mean_terms(at.mu_s, at.mean_terms);
	for (int batch = 0; batch < scene->n_batches; batch++) {
		struct FittedBlock *block = &scene->fitted[batch];
		for (int i = 0; i < 4; i++) {
			set_band(block, i, &scene->batches[batch], &at);
			block->exponent[i] = (float)fitted_exponents[i];
		}
		block->geometry[0] = (float)(-sqrt(h * (2 * planet_radius_m + h)) / (planet_radius_m + h));
		block->geometry[1] = (float)horizontal_mass(rayleigh_scale_height_m);
		block->geometry[2] = (float)horizontal_mass(aerosol_scale_height_m);
		block->geometry[3] = (float)(ratio * ratio);
	}
}
