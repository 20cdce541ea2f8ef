/*
 * What clouds see of sky and ground, and what they do to the light around them: by closed forms, by the rendered sky
 * summed up, and by adding layers (tests/lib_slab.h).
 */
#include "tests/lib_cloud_light.h"
#include "tests/lib_gpu.h"
#include "tests/lib_render.h"
#include "tests/lib_request.h"
#include "tests/lib_slab.h"

#include "api/api.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static const struct cloud_phase two_lobes = { 0.9, 0.9, -0.15 }, isotropic = { 1, 0, 0 };
static const double degree = M_PI / 180;

static void near_to(double got, double wanted, double relative, const char *what, double where)
{
	if (!(fabs(got - wanted) <= relative * fabs(wanted)))
		fail_msg("%s at %g: %.4f, should be %.4f", what, where, got, wanted);
}

static struct cloud_bench *bench_of(enum cloud_shape shape, double tau, const struct cloud_phase *phase,
	const struct welkin_request *request, bool around)
{
	const struct cloud_setting setting = { *request, *phase, 1, false };
	struct cloud_field field = cloud_field_create(shape, tau);
	assert_non_null(field.extinction);
	struct cloud_bench *bench = cloud_bench_open(&field, &setting, around);
	cloud_field_destroy(&field);
	return bench;
}

static void probe(const struct cloud_bench *bench, double x, double y, double z, int what, float found[4][4])
{
	float place[1][4] = { { (float)x, (float)y, (float)z, (float)what } };
	cloud_bench_probe(bench, place, 1, (float(*)[4][4])found);
}

/* ---- the sky's shape ---- */

static double sky_shape(double edge, double mu)
{
	return 1 + edge * (1 / (mu + 0.1) - 1.5204209);
}

/* Its flux is π, its mean as told; rays of the grid bring as much, and none of it from below. */
static void shape_is_normalised(void **state)
{
	(void)state;
	enum { N = 64, RAYS = 18 };
	static float places[N + RAYS][4], found[N + RAYS][4][4];
	const struct welkin_request request = request_of(WELKIN_EARTH, 0, 30);
	struct cloud_bench *bench = bench_of(CLOUD_DECK, 0, &isotropic, &request, false);
	for (int i = 0; i < N; i++) { /* denser at the horizon */
		const double u = (i + 0.5) / N;
		places[i][0] = (float)(u * u);
		places[i][3] = PROBE_SKY;
	}
	for (int i = 0; i < RAYS; i++) {
		places[N + i][0] = (float)i;
		places[N + i][3] = PROBE_RAYS;
	}
	cloud_bench_probe(bench, places, N + RAYS, found);
	double flux = 0, mean = 0, all = 0, sky = 0, ground = 0, up[2] = { 0 };
	for (int i = 0; i < N; i++) {
		const double u = (i + 0.5) / N, mu = u * u, L = (double)found[i][0][0];
		near_to(L, sky_shape((double)bench->scene.clouds.sky_edge, mu), 1e-5, "sky", mu);
		flux += L * mu * 2 * 2 * u / N;
		mean += L * 2 * u / N;
	}
	near_to(flux, 1, 1e-3, "flux over pi", 0);
	near_to((double)found[0][0][1], mean, 2e-3, "mean", 0);
	for (int i = N; i < N + RAYS; i++) {
		const double w = (double)found[i][0][0], mu = (double)found[i][1][1];
		all += w;
		sky += w * (double)found[i][0][1];
		ground += w * (double)found[i][0][2];
		up[0] += mu > 0 ? w : 0;
		up[1] += mu > 0 ? 4 * w * mu * (double)found[i][0][1] : 0;
		assert_true(mu > 0 ? found[i][0][2] == 0 : found[i][0][1] == 0);
	}
	near_to(all, 1, 1e-5, "weights", 0);
	near_to(up[0], 0.5, 1e-5, "weights above", 0);
	near_to(ground, 0.5, 1e-5, "ground", 0);
	near_to(2 * sky, mean, 0.01, "mean by rays", 0);
	near_to(up[1], 1, 0.01, "flux by rays", 0);
	cloud_bench_close(bench);
}

/* ---- halves of the sky ---- */

enum { NODES = 16, TURNS = 16, HALF = NODES * TURNS };

/* Flux and sum of the rendered sky from above and from below, per sun irradiance of 1, bands by bench. */
struct halves {
	double flux[2][4], sum[2][4];
};

static void render_halves(struct halves *h, const struct welkin_request *request, const struct cloud_bench *bench)
{
	static double directions[2 * HALF][3];
	double *reply, nm[4], weight[NODES];
	struct welkin_result result;
	for (int b = 0; b < 4; b++)
		nm[b] = (double)bench->scene.batches[0].wavelength[b];
	for (int i = 0; i < 2 * HALF; i++) { /* by mu = u², half a turn, of which the other is the mirror image */
		const double u = (i / TURNS % NODES + 0.5) / NODES;
		weight[i / TURNS % NODES] = 2 * u / NODES * 2 * M_PI / TURNS;
		direction_of(
			(i < HALF ? 1 : -1) * asin(u * u) / degree, 180 * (i % TURNS + 0.5) / TURNS, directions[i]);
	}
	assert_true(lib_radiance(
		&group_renderer, request, (const double(*)[3])directions, 2 * HALF, nm, 4, &reply, &result));
	const double *L = reply + welkin_radiance_layout(2 * HALF, 4).radiance;
	memset(h, 0, sizeof *h);
	for (int i = 0; i < 2 * HALF; i++)
		for (int b = 0; b < 4; b++) {
			const double u = (i / TURNS % NODES + 0.5) / NODES;
			const double x = L[4 * i + b] * weight[i / TURNS % NODES] /
					 (double)bench->scene.batches[0].sun_irradiance[b];
			h->sum[i / HALF][b] += x;
			h->flux[i / HALF][b] += x * u * u;
		}
	free(reply);
}

static void halves_are_the_sky(void **state)
{
	(void)state;
	static const double suns_deg[] = { 60, 30, 8, -2 }, altitudes[] = { 1000, 3000 };
	int method = 0;
	while (strcmp(welkin_method_names[method], "precomputed") != 0)
		method++;
	struct welkin_request request = request_of(WELKIN_EARTH, 0, 30);
	struct cloud_bench *bench = bench_of(CLOUD_DECK, 0, &isotropic, &request, true);
	float shape[4][4];
	probe(bench, 0, 0, 0, PROBE_SKY, shape);
	double Y[4];
	for (int b = 0; b < 4; b++) {
		const struct BandsBlock *bands = &bench->scene.batches[0];
		Y[b] = (double)bands->sun_irradiance[b] *
		       (0.2126 * (double)bands->to_rgb[0][b] + 0.7152 * (double)bands->to_rgb[1][b] +
			       0.0722 * (double)bands->to_rgb[2][b]);
	}
	for (int i = 0; i < 8; i++) {
		struct halves rendered;
		float found[4][4], sun[4][4];
		request = request_of(WELKIN_EARTH, altitudes[i % 2], suns_deg[i / 2]);
		request.atmosphere.method = method;
		render_halves(&rendered, &request, bench);
		const double mu_s = sin(suns_deg[i / 2] * degree);
		double luminance[2] = { 0, 0 };
		probe(bench, altitudes[i % 2], mu_s, 0, PROBE_HALVES, found);
		probe(bench, altitudes[i % 2], mu_s, 0, PROBE_SUN, sun);
		for (int b = 0; b < 4; b++) {
			/* the tables count the forward peak of aerosol's scattering as sunlight */
			const double peak = (double)sun[1][b] - (double)sun[0][b], where = suns_deg[i / 2];
			const double above = (double)found[2][b] + peak, below = (double)found[3][b];
			near_to((double)found[0][b] + peak * fmax(mu_s, 0), rendered.flux[0][b], 0.02,
				"flux from above", where);
			near_to((double)found[1][b], rendered.flux[1][b], where > 0 ? 0.04 : 0.09, "flux from below",
				where);
			near_to(above + below, rendered.sum[0][b] + rendered.sum[1][b], 0.02, "light", where);
			/* moments blur a bright horizon */
			near_to(above, rendered.sum[0][b], 0.18, "light from above", where);
			luminance[0] += Y[b] * rendered.sum[0][b];
			luminance[1] += Y[b] * rendered.flux[0][b];
		}
		/* of the shape that clouds see: its mean over that of an even sky of the same flux */
		near_to((double)shape[0][1], luminance[0] / luminance[1] / 2, 0.16, "shape", suns_deg[i / 2]);
	}
	cloud_bench_close(bench);
}

/* ---- decks ---- */

static void from_sky(const struct slab *slab, double edge, double L[SLAB_NODES])
{
	for (int i = 0; i < SLAB_NODES; i++)
		L[i] = sky_shape(edge, slab->mu[i]);
}

/* Shares of the flux that come through. */
static double through(struct slab *slab, const double L[SLAB_NODES])
{
	double out[SLAB_NODES];
	slab_apply(slab->T, L, out);
	return slab_flux(slab, out) / slab_flux(slab, L);
}

/* Share of the sky's flux that a deck sends back, by rays. */
static double sent_back(const struct cloud_bench *bench)
{
	static struct cloud_ray rays[2 * CLOUD_FLUX_RAYS];
	static float answers[2 * CLOUD_FLUX_RAYS][CLOUD_RESPONSES];
	double weights[CLOUD_FLUX_RAYS], sum = 0;
	cloud_flux_rays(rays, weights);
	cloud_bench_march(bench, LIGHT_MODEL, rays, CLOUD_FLUX_RAYS, answers);
	for (int i = 0; i < CLOUD_FLUX_RAYS; i++)
		sum += weights[i] * (double)answers[i][CLOUD_SKY] / M_PI;
	return sum;
}

/* Diffusion lets through too little of sunlight, a fifth of it where decks are thick (make cloud-light has more of
 * them). */
static void decks_let_through(void **state)
{
	(void)state;
	static const struct {
		const struct cloud_phase *phase;
		double tau;
	} decks[] = { { &two_lobes, 2 }, { &two_lobes, 8 }, { &two_lobes, 32 }, { &isotropic, 0.6 },
		{ &isotropic, 2.4 }, { &isotropic, 9.6 } };
	const double mu0 = 0.64;
	const struct welkin_request request = request_of(WELKIN_EARTH, 0, asin(mu0) / degree);
	for (size_t i = 0; i < sizeof decks / sizeof decks[0]; i++) {
		static struct slab slab;
		const struct slab_medium medium = slab_cloud(decks[i].tau, decks[i].phase);
		double sun[SLAB_NODES], sky[SLAB_NODES], even[SLAB_NODES];
		float found[4][4];
		struct cloud_bench *bench = bench_of(CLOUD_DECK, decks[i].tau, decks[i].phase, &request, false);
		probe(bench, 0, 0, 0, PROBE_FOOT, found);
		slab_layer(&slab, &medium, mu0);
		slab_sun(&slab, sun);
		from_sky(&slab, (double)bench->scene.clouds.sky_edge, sky);
		from_sky(&slab, 0, even);
		const double k = 1 - cloud_phase_g(decks[i].phase), tau = decks[i].tau;
		near_to((double)found[0][0] / (2 * mu0) + exp(-k * tau / mu0), through(&slab, sun), 0.23, "sun", tau);
		near_to((double)found[0][1] / (2 * M_PI), through(&slab, sky), 0.06, "sky", tau);
		near_to((double)found[0][1] / (2 * M_PI) + sent_back(bench), 1, 0.04, "sky's energy", tau);
		near_to(2 - (double)found[0][2] / (2 * M_PI), through(&slab, even), 0.1, "ground", tau);
		cloud_bench_close(bench);
	}
}

/* ---- the whole air over ground ---- */

enum { HEIGHTS = 14, FIRST_OF_DECK = 8, FIRST_BELOW = 11 };
static const double heights[HEIGHTS] = { 60e3, 30e3, 20e3, 14e3, 10e3, 7e3, 5e3, 3.5e3, 2600, 2300, 1300, 1000, 500,
	0 };

static double cornette_shanks(double g, double nu)
{
	return 3 / (8 * M_PI) * (1 - g * g) / (2 + g * g) * (1 + nu * nu) / pow(1 + g * g - 2 * g * nu, 1.5);
}

static void aerosol_moments(double g, double moments[SLAB_DEGREES + 1])
{
	enum { STEPS = 20000 };
	memset(moments, 0, (SLAB_DEGREES + 1) * sizeof *moments);
	for (int i = 0; i < STEPS; i++) {
		const double x = -1 + 2 * (i + 0.5) / STEPS, w = 4 * M_PI / STEPS * cornette_shanks(g, x);
		double P = 1, next = x;
		for (int l = 0; l <= SLAB_DEGREES; l++) {
			moments[l] += w * P;
			const double after = ((2 * l + 3) * x * next - (l + 1) * P) / (l + 2);
			P = next;
			next = after;
		}
	}
}

/* Column of a density that falls off exponentially, or of ozone's tent. */
static double column(double low, double high, double scale_height)
{
	return scale_height * (exp(-low / scale_height) - exp(-high / scale_height));
}

static double tent(const struct MediaBlock *media, double low, double high)
{
	double sum = 0;
	for (int i = 0; i < 100; i++) {
		const double h = low + (high - low) * (i + 0.5) / 100;
		sum += fmax(1 - fabs(h - (double)media->ozone_center) / (double)media->ozone_half_width, 0);
	}
	return sum * (high - low) / 100;
}

static void air_layer(struct slab *slab, const struct scene *scene, int band, int i, double cloud, double mu0)
{
	const struct BandsBlock *b = &scene->batches[0];
	const struct MediaBlock *m = &scene->media;
	const double high = heights[i], low = heights[i + 1];
	const double aerosol = column(low, high, (double)m->aerosol_scale_height);
	const double rayleigh = (double)b->rayleigh[band] * column(low, high, (double)m->rayleigh_scale_height);
	const double scattering = (double)b->aerosol_scattering[band] * aerosol;
	const double all = rayleigh + scattering + cloud;
	const struct slab_medium droplets = slab_cloud(cloud, &two_lobes);
	double moments[SLAB_DEGREES + 1];
	struct slab_medium medium = {
		.tau = all + ((double)b->aerosol_extinction[band] - (double)b->aerosol_scattering[band]) * aerosol +
		       (double)b->ozone[band] * tent(m, low, high)
	};
	medium.albedo = all / medium.tau;
	aerosol_moments((double)m->aerosol_g, moments);
	for (int l = 0; l <= SLAB_DEGREES; l++)
		medium.moments[l] = (rayleigh * (l == 0          ? 1
							: l == 2 ? 0.1
								 : 0) +
					    scattering * moments[l] + cloud * droplets.moments[l]) /
				    all;
	slab_layer(slab, &medium, mu0);
}

static void air_layers(
	struct slab *slab, const struct scene *scene, int band, int from, int to, double cloud, double mu0)
{
	static struct slab layer;
	for (int i = from; i < to; i++) {
		air_layer(i == from ? slab : &layer, scene, band, i, heights[i] == 2300 ? cloud : 0, mu0);
		if (i > from)
			slab_add(slab, slab, &layer);
	}
}

/* Per sun irradiance of 1: of the ground; light from all directions at the layer's bottom and top. */
struct lit {
	double ground, bottom, top, down;
};

static struct lit light_by_layers(const struct scene *scene, int band, double cloud, double mu0)
{
	static struct slab above, deck, below, ground, upper, lower;
	double sun[SLAB_NODES], down[SLAB_NODES], up[SLAB_NODES];
	struct lit lit;
	air_layers(&above, scene, band, 0, FIRST_OF_DECK, cloud, mu0);
	air_layers(&deck, scene, band, FIRST_OF_DECK, FIRST_BELOW, cloud, mu0);
	air_layers(&below, scene, band, FIRST_BELOW, HEIGHTS - 1, cloud, mu0);
	slab_ground(&ground, (double)scene->batches[0].ground_albedo[band], mu0);
	slab_sun(&above, sun);
	slab_add(&lower, &below, &ground);
	slab_add(&upper, &above, &deck);
	slab_between(&upper, &lower, sun, down, up);
	lit.bottom = slab_field(&above, down) + slab_field(&above, up);
	slab_add(&upper, &upper, &below);
	slab_between(&upper, &ground, sun, down, up);
	lit.ground = slab_flux(&above, down);
	slab_add(&lower, &deck, &lower);
	slab_between(&above, &lower, sun, down, up);
	lit.top = slab_field(&above, down) + slab_field(&above, up);
	lit.down = slab_flux(&above, down);
	return lit;
}

/* Within what is measured: fluxes on the ground and light in the air up to 9 % off, fluxes on top of clouds 1 %. */
static void light_around_a_deck(double tau, double sun_deg, double albedo)
{
	const double mu0 = sin(sun_deg * degree), k = 1 - cloud_phase_g(&two_lobes);
	float foot[4][4], ground[4][4], around[4][4], low[4][4], high[4][4], sun_low[4][4], sun_high[4][4];
	struct welkin_request request = request_of(WELKIN_EARTH, 0, sun_deg);
	for (int i = 0; i < 3; i++)
		request.ground_albedo[i] = albedo;
	struct cloud_bench *bench = bench_of(CLOUD_DECK, tau, &two_lobes, &request, true);
	probe(bench, 0, 0, 0, PROBE_FOOT, foot);
	probe(bench, 0, 0, 0, PROBE_GROUND, ground);
	probe(bench, 0, 0, 0, PROBE_AROUND, around);
	/* what a deck lets through of sunlight is another test's */
	static struct slab deck;
	double sun[SLAB_NODES];
	const struct slab_medium medium = slab_cloud(tau, &two_lobes);
	slab_layer(&deck, &medium, mu0);
	slab_sun(&deck, sun);
	const double share = ((double)foot[0][0] / (2 * mu0) + exp(-k * tau / mu0)) / through(&deck, sun);
	probe(bench, 1000, mu0, 0, PROBE_HALVES, low);
	probe(bench, 2600, mu0, 0, PROBE_HALVES, high);
	probe(bench, 1000, mu0, 0, PROBE_SUN, sun_low);
	probe(bench, 2600, mu0, 0, PROBE_SUN, sun_high);
	for (int b = 0; b < 4; b += 3) {
		const double nm = (double)bench->scene.batches[0].wavelength[b];
		const struct lit clear = light_by_layers(&bench->scene, b, 0, mu0),
				 lit = light_by_layers(&bench->scene, b, tau, mu0);
		const double by_sun = mu0 * (double)sun_high[1][b] / lit.down, less = 1 + by_sun * (share - 1);
		near_to((double)ground[2][b], clear.ground, 0.015, "clear ground", nm);
		near_to((double)ground[3][b], lit.ground * less, 0.1, "ground", nm);
		near_to((double)around[1][b] * (double)high[0][b] + mu0 * (double)sun_high[1][b], lit.down, 0.03,
			"light from above on clouds", nm);
		near_to((double)(around[3][b] * (high[2][b] + high[3][b])) + (double)sun_high[0][b], lit.top, 0.1,
			"air above", nm);
		near_to((double)(around[2][b] * (low[2][b] + low[3][b])) + (double)sun_low[0][b] * exp(-k * tau / mu0),
			lit.bottom * less, 0.12, "air below", nm);
	}
	cloud_bench_close(bench);
}

static void decks_light_the_air(void **state)
{
	(void)state;
	light_around_a_deck(2, 40, 0.3);
	light_around_a_deck(10, 40, 0.8);
	light_around_a_deck(10, 15, 0.1);
	light_around_a_deck(30, 40, 0.1);
}

/* Where the grid holds no cloud nothing changes. */
static void no_clouds_change_nothing(void **state)
{
	(void)state;
	const struct welkin_request request = request_of(WELKIN_EARTH, 0, 20);
	struct cloud_bench *bench = bench_of(CLOUD_DECK, 0, &two_lobes, &request, true);
	static const double places[][2] = { { 0, 0 }, { 1700, -900 }, { 5000, 3000 }, { 15000, 15000 } };
	for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
		float around[4][4], ground[4][4];
		probe(bench, places[i][0], 0, places[i][1], PROBE_AROUND, around);
		probe(bench, places[i][0], 0, places[i][1], PROBE_GROUND, ground);
		for (int b = 0; b < 4; b++) {
			near_to((double)around[0][b], 1, 2e-3, "lit", places[i][0]);
			near_to((double)around[1][b], 1, 2e-3, "gain", places[i][0]);
			near_to((double)around[2][b], 1, 2e-3, "air below", places[i][0]);
			near_to((double)around[3][b], 1, 2e-3, "air above", places[i][0]);
			near_to((double)ground[1][b], 1, 2e-3, "sky on ground", places[i][0]);
			near_to((double)ground[3][b], (double)ground[2][b], 2e-3, "ground", places[i][0]);
		}
	}
	cloud_bench_close(bench);
}

/* ---- light spreads on its way to the ground ---- */

static double edge_of_sky;

static double sky_seen(double mu)
{
	return sky_shape(edge_of_sky, mu);
}

/* By paths, per sun irradiance of 1 and sky irradiance of π: irradiance of level ground. */
static void ground_by_paths(
	const struct cloud_medium *medium, const double sun[3], double x, double E[2], double error[2])
{
	enum { N = 512 };
	static struct cloud_ray rays[N];
	static struct cloud_estimate seen[N];
	for (int i = 0; i < N; i++) { /* by the cosine */
		const double s = (i + 0.5) / N, turn = 2 * M_PI * i * 0.6180339887498949;
		rays[i] = (struct cloud_ray){ { x, 0, 0 }, { sqrt(s) * cos(turn), sqrt(1 - s), sqrt(s) * sin(turn) } };
	}
	cloud_mc_radiance(medium, sun, rays, N, 64, 1, seen);
	memset(E, 0, 2 * sizeof *E);
	memset(error, 0, 2 * sizeof *error);
	for (int i = 0; i < N; i++) {
		E[0] += M_PI / N * seen[i].mean[CLOUD_SUN];
		E[1] += (seen[i].mean[CLOUD_SKY] + seen[i].mean[CLOUD_TRANSMITTANCE] * sky_seen(rays[i].direction[1])) /
			N;
		error[0] += pow(M_PI / N * seen[i].std_error[CLOUD_SUN], 2);
		error[1] += pow(seen[i].std_error[CLOUD_SKY] / N, 2);
	}
	error[0] = sqrt(error[0]);
	error[1] = sqrt(error[1]);
}

/* What falls on the ground is what leaves the layer's bottom, taken for Lambert's, from the height H = 1000 m: of a
 * field that varies with x alone, by H² / 2 (H² + x²)^(3/2). */
static void light_spreads_by_its_height(void **state)
{
	(void)state;
	enum { N = 1601, STEP = 25 };
	static float places[N][4], found[N][4][4];
	const double H = 1000;
	const struct welkin_request request = request_of(WELKIN_EARTH, 0, 60);
	struct cloud_bench *bench = bench_of(CLOUD_HALF_DECK, 4, &isotropic, &request, true);
	for (int i = 0; i < N; i++) {
		places[i][0] = (float)((i - N / 2) * STEP);
		places[i][3] = PROBE_FOOT;
	}
	cloud_bench_probe(bench, places, N, found);
	for (int at = N / 2 - 120; at <= N / 2 + 120; at += 12) {
		double sun = 0, sky = 0, back = 0, all = 0;
		for (int i = 0; i < N; i++) {
			const double x = (i - at) * STEP, w = H * H / 2 * pow(H * H + x * x, -1.5) * STEP;
			all += w;
			sun += w * (double)found[i][0][0] / 2;
			sky += w * (double)found[i][0][1] / (2 * M_PI);
			back += w * ((double)found[i][0][2] / (2 * M_PI) - 1);
		}
		const double got[3] = { (double)found[at][1][0], (double)found[at][1][1], (double)found[at][1][2] },
			     wanted[3] = { sun / all, sky / all, back / all };
		for (int k = 0; k < 3; k++) {
			if (fabs(got[k] - wanted[k]) > 0.03)
				fail_msg("at %g m: %.4f, should be %.4f", (double)places[at][0], got[k], wanted[k]);
		}
	}
	cloud_bench_close(bench);
}

/* Ground beside and under the edge of half a deck. Of the sky what is low comes in below the deck, where it is brighter
 * than the mean that is spread: up to 0.11 off; without spreading 0.17. */
static void light_spreads_below_an_edge(void **state)
{
	(void)state;
	static const double places[] = { -5000, -1500, -500, 0, 500, 1500, 5000 };
	const double tau = 2.4, sun[3] = { 0.5, sqrt(0.75), 0 };
	const struct welkin_request request = request_of(WELKIN_EARTH, 0, 60);
	struct cloud_bench *bench = bench_of(CLOUD_HALF_DECK, tau, &isotropic, &request, true);
	struct cloud_field field = cloud_field_create(CLOUD_HALF_DECK, tau);
	assert_non_null(field.extinction);
	struct cloud_medium medium = cloud_field_medium(&field, &isotropic);
	medium.sky = sky_seen;
	edge_of_sky = (double)bench->scene.clouds.sky_edge;
	for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
		float found[4][4];
		double E[2], error[2];
		probe(bench, places[i], 0, 0, PROBE_FOOT, found);
		ground_by_paths(&medium, sun, places[i], E, error);
		if (fabs((double)found[1][0] - E[0]) > 0.04 + 3 * error[0] ||
			fabs((double)found[1][1] - E[1]) > 0.12 + 3 * error[1])
			fail_msg("ground at %g m: sun %.4f, paths %.4f; sky %.4f, paths %.4f", places[i],
				(double)found[1][0], E[0], (double)found[1][1], E[1]);
	}
	cloud_field_destroy(&field);
	cloud_bench_close(bench);
}

static int open_all(void **state)
{
	/* the renderer first: it must not inherit a context */
	return group_renderer_start(state) == 0 && lib_gpu_open(state) == 0 ? 0 : -1;
}

static int close_all(void **state)
{
	const int closed = lib_gpu_close(state);
	return group_renderer_stop(state) == 0 ? closed : -1;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(shape_is_normalised),
		cmocka_unit_test(halves_are_the_sky),
		cmocka_unit_test(decks_let_through),
		cmocka_unit_test(decks_light_the_air),
		cmocka_unit_test(no_clouds_change_nothing),
		cmocka_unit_test(light_spreads_by_its_height),
		cmocka_unit_test(light_spreads_below_an_edge),
	};
	return cmocka_run_group_tests_name("cloud_around", tests, open_all, close_all);
}
