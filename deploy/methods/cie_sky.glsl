/*
 * The 15 skies of the CIE standard, from overcast to clear, with a colour temperature: what lighting design
 * calculates with. The standard fixes how luminance is spread over the sky; its level and its colour are
 * parameters. An example of a method of one's own: copy it, change it, put it into --method-dir.
 *
 * summary: CIE standard general sky, types 1 to 15, coloured by the CIE daylight locus
 * source: CIE S 011/E:2003 (ISO 15469:2004); daylight locus of CIE 15:2004
 * tables: optical_depth
 * parameter: type | - | 1 to 15 | 12 | Type of the standard, a whole number: 1 to 6 overcast to hazy, 7 to 10 partly cloudy, 11 to 15 clear.
 * parameter: zenith_luminance | cd/m2 | 0 to 100000 | 5000 | Luminance of the zenith.
 * parameter: zenith_temperature | K | 4000 to 25000 | 24000 | Colour temperature of the zenith.
 * parameter: horizon_temperature | K | 4000 to 25000 | 7500 | Colour temperature of the horizon.
 * parameter: sun | - | 0 to 1 | 1 | Share of the sun's own light that comes through the clouds.
 * domain: sun.elevation_deg | 0 to 90 | the standard is of the day
 * domain: camera.altitude_m | 0 to 3000 | the standard is of a sky seen from the ground
 */

/* a, b (gradation from zenith to horizon) and c, d, e (scattering indicatrix) of each type; the standard's table 1. */
struct CieSky {
	float a, b, c, d, e;
};

const CieSky CIE_SKIES[15] = CieSky[15](
	CieSky(4.0, -0.70, 0.0, -1.0, 0.00), CieSky(4.0, -0.70, 2.0, -1.5, 0.15), CieSky(1.1, -0.80, 0.0, -1.0, 0.00),
	CieSky(1.1, -0.80, 2.0, -1.5, 0.15), CieSky(0.0, -1.00, 0.0, -1.0, 0.00), CieSky(0.0, -1.00, 2.0, -1.5, 0.15),
	CieSky(0.0, -1.00, 5.0, -2.5, 0.30), CieSky(0.0, -1.00, 10.0, -3.0, 0.45), CieSky(-1.0, -0.55, 2.0, -1.5, 0.15),
	CieSky(-1.0, -0.55, 5.0, -2.5, 0.30), CieSky(-1.0, -0.55, 10.0, -3.0, 0.45), CieSky(-1.0, -0.32, 10.0, -3.0, 0.45),
	CieSky(-1.0, -0.32, 16.0, -3.0, 0.30), CieSky(-1.0, -0.15, 16.0, -3.0, 0.30), CieSky(-1.0, -0.15, 24.0, -2.8, 0.15));

/* The standard's gradation function, by the cosine to the zenith. */
float cie_gradation(CieSky sky, float mu)
{
	return 1.0 + sky.a * exp(sky.b / max(mu, 1e-3));
}

/* Its indicatrix, by the cosine to the sun. */
float cie_indicatrix(CieSky sky, float nu)
{
	return 1.0 + sky.c * (exp(sky.d * acos(nu)) - exp(sky.d * 0.5 * PI)) + sky.e * nu * nu;
}

/* Spectral radiance of daylight of this colour temperature and luminance, from the CIE daylight components. */
vec4 cie_daylight(float kelvin, float luminance)
{
	float t = 1e3 / kelvin;
	vec4 k = kelvin <= 7000.0 ? vec4(-4.6070, 2.9678, 0.09911, 0.244063) : vec4(-2.0064, 1.9018, 0.24748, 0.237040);
	float x = ((k.x * t + k.y) * t + k.z) * t + k.w, y = (-3.0 * x + 2.870) * x - 0.275;
	float m = 0.0241 + 0.2562 * x - 0.7341 * y;
	float m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / m, m2 = (0.0300 - 31.4424 * x + 30.0717 * y) / m;
	vec4 shape = max(bands.daylight[0] + m1 * bands.daylight[1] + m2 * bands.daylight[2], 0.0);
	return shape * luminance / dot(bands.daylight_luminance.xyz, vec3(1.0, m1, m2));
}

vec4 cie_radiance(CieSky sky, float mu, float nu, float mu_s)
{
	float zenith = cie_gradation(sky, 1.0) * cie_indicatrix(sky, mu_s);
	float relative = cie_gradation(sky, mu) * cie_indicatrix(sky, nu) / zenith;
	/* mixed in 1/K, where steps look even */
	float low = pow(1.0 - clamp(mu, 0.0, 1.0), 3.0);
	float kelvin = 1.0 / mix(1.0 / parameters.zenith_temperature, 1.0 / parameters.horizon_temperature, low);
	return cie_daylight(kelvin, media.sun_intensity * parameters.zenith_luminance * relative);
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	CieSky sky = CIE_SKIES[clamp(int(parameters.type + 0.5), 1, 15) - 1];
	float mu_s = clamp(dot(ray.up, frame.sun_direction.xyz), -1.0, 1.0);
	float nu = clamp(dot(ray.d, frame.sun_direction.xyz), -1.0, 1.0);
	if (ray_ground_distance(ray.h, ray.mu) < 0.0) {
		L = cie_radiance(sky, ray.mu, nu, mu_s);
		T = parameters.sun * exp(-optical_depth(sun_column(ray.h, ray.mu)));
		return;
	}
	T = vec4(0.0);
	L = vec4(0.0);
	if ((frame.features & FEATURE_GROUND) == 0)
		return; /* no pixel shows it */
	/* lit by the sun and by a sky taken to be as bright as its zenith all over */
	vec4 direct = bands.sun_irradiance * max(mu_s, 0.0) * exp(-optical_depth(sun_column(0.0, mu_s)));
	L = bands.ground_albedo * (parameters.sun * direct / PI + cie_radiance(sky, 1.0, mu_s, mu_s));
	ground_reflected = L;
}
