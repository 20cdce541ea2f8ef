/*
 * Light in clouds, all orders of scattering. A ray carries two transmittances: T = exp(-tau) for what is seen sharp behind
 * the clouds, and S = exp(-k tau), k = cloud_light_scale(), for the light gathered along it. A step of
 * optical depth x adds
 *
 *     answer += S (1 - exp(-k x)) / k × cloud_light_source(…);   S *= exp(-k x);   T *= exp(-x);
 *
 * and at the end of the ray cloud_light_behind(). Answers are to (sun of irradiance 1, sky of radiance 1, ground of radiance 1).
 *
 * Two kinds of light are added. Light that has met nothing but the forward lobe of the phase function is a beam still: its n
 * scatterings are Poisson's in the optical depth to the sun and to the camera, HG(g) n times over is HG(g^n), and a path of n
 * scatterings is one path, whichever of them is taken for the sample's. All other light comes from a table of
 * diffuse light (shaders/tables/cloud_light.comp).
 */
#include "cloud_light_table.glsl"

struct CloudLight {
	vec3 field;      /* scattered light from all directions: for sun, sky, ground */
	float sun_depth; /* optical depth to the sun, of the grid */
};

CloudLight cloud_light_at(vec3 q)
{
	q = cloud_grid_home(q);
	int level = cloud_grid_level(q, 0), next = min(level + 1, CLOUD_GRID_LEVELS - 1);
	vec4 light = cloud_light_texel(cloud_grid_place(q, level), level);
	/* a loop, since a software rasteriser leaves those alone */
	for (float blend = smoothstep(0.8, 1.0, cloud_grid_reach(q, level)); blend > 0.0; blend = 0.0)
		light = mix(light, cloud_light_texel(cloud_grid_place(q, next), next), blend);
	/* transmittance, not depth, is what may be interpolated at a cloud's edge */
	return CloudLight(light.xyz, -log(max(light.w, 1e-9)) / cloud_light_scale());
}

/* Optical depth from q to the sun: `near` samples over the next cell and a half, where the grid doesn't see the cloud's shape, and the grid's
 * from there on. */
float cloud_light_sun_depth(vec3 q, vec3 to_sun, int near)
{
	float reach = 3 * cloud_grid_crossing(to_sun, cloud_grid_level(q, 0)), depth = 0.0;
	for (int i = 0; i < near; i++) {
		/* quadratic: the nearest are the densest */
		float a = float(i) / float(near), b = float(i + 1) / float(near);
		depth += cloud_extinction(q + to_sun * (0.5 * (a * a + b * b) * reach), 1) * (b * b - a * a) * reach;
	}
	return depth + cloud_light_at(q + to_sun * reach).sun_depth * cloud_grid_within(q + to_sun * reach);
}

/*
 * The beam's answer per unit of true optical depth, attenuation left out. With m the mean number of forward scatterings
 * along the way and lobes L_n = HG(g^n):
 *
 *     sum over n of P_n(m) [ (f / (n + 1) + s - f) L_(n+1) ] + (1 - s) HG(g_backward),
 *
 * s the forward lobe's share of scattering, f that which counts as straight on. Three orders are taken one by one, the rest by its mean.
 */
float cloud_beam(float depth, float nu)
{
	float f = cloud_straight_share(), s = 1.0 - clouds.backward_share, w = max(s - f, 0.0), g = clouds.forward_g;
	float m = clouds.albedo * f * depth, P0 = exp(-m), P1 = P0 * m, P2 = 0.5 * P1 * m;
	float once = m > 1e-2 ? (1.0 - P0) / m : 1.0 - 0.5 * m; /* sum of P_n / (n + 1) */
	float rest = max(f * (once - P0 - P1 / 2.0 - P2 / 3.0) + w * (1.0 - P0 - P1 - P2), 0.0);
	/* first moment of n + 1 over the same weights */
	float moment = f * (1.0 - P0 - P1 - P2) + w * (m + 1.0 - P0 - 2.0 * P1 - 3.0 * P2);
	float n = clamp(moment / max(rest, 1e-12), 4.0, 1e3);
	float sum = P0 * (f + w) * phase_henyey_greenstein(g, nu) + P1 * (f / 2.0 + w) * phase_henyey_greenstein(g * g, nu) +
		P2 * (f / 3.0 + w) * phase_henyey_greenstein(g * g * g, nu) +
		rest * phase_henyey_greenstein(pow(max(g, 1e-6), n), nu);
	return sum + clouds.backward_share * phase_henyey_greenstein(clouds.backward_g, nu);
}

/* Answers per unit of true optical depth, albedo and the sun's attenuation in. sun_depth: true optical depth to the sun, by the
 * caller's march or light.sun_depth; view_depth: from the camera. */
vec3 cloud_light_source(CloudLight light, float sun_depth, float view_depth, float nu)
{
	vec3 diffuse = light.field * (clouds.albedo * (1.0 - cloud_straight_share()) / (4.0 * PI));
	diffuse.x += clouds.albedo * exp(-cloud_light_scale() * sun_depth) * cloud_beam(sun_depth + view_depth, nu);
	return diffuse;
}

/* What the forward lobe brings from behind the clouds, blurred by it. d: the ray's direction in cloud space. A surface there is taken to be as
 * bright as the ground. */
vec3 cloud_light_behind(float T, float S, vec3 d, bool surface)
{
	float depth = -log(max(T, 1e-20)), f = cloud_straight_share();
	float blur = 1.0 - pow(max(clouds.forward_g, 1e-6), 1.0 + 0.5 * f * depth);
	float sky = surface ? 0.0 : 0.5 + 0.5 * d.y * inversesqrt(d.y * d.y + 0.3 * blur + 1e-9);
	float mu = 0.5 * (abs(d.y) + sqrt(d.y * d.y + 0.3 * blur));
	return max(S - T, 0.0) * vec3(0.0, sky * cloud_sky(mu), 1.0 - sky);
}
