/*
 * What all sky methods share. A method's kernel includes this first and defines method_sky(); it gets
 * pixels and bare directions, spectral batches, layers and accumulation from here. Directions come
 * from rays.comp or from a radiance job; the sun's disk is added by sun_disk.comp.
 */
#include "sky_output.glsl"
#include "shaft_table.glsl"

/* A ray from the camera; the camera is at the same place for all of them. */
struct Ray {
	vec3 d;    /* unit direction, away from the camera */
	float h;   /* camera altitude above the ground sphere, m */
	float mu;  /* dot(up, d) */
	vec3 up;   /* away from the planet's centre */
	float pixel_solid_angle; /* sr; 0 for a bare direction */
};

/* Per band: radiance L (W/m²/sr/nm) that arrives along the ray without the sun's disk, and the
 * transmittance T from the camera to space; 0 where the ray meets the ground. */
void method_sky(Ray ray, out vec4 L, out vec4 T);

float ray_ground_distance(float h, float mu);
float mu_horizon(float h);

/* The part of the L last returned by method_sky that the ground reflected, already attenuated: it
 * is left out of the in-scatter layer. A method that draws ground sets it. */
vec4 ground_reflected = vec4(0.0);

/* Distance to a surface that method_sky() itself met, for the depth layer; negative: none. */
float surface_reached = -1.0;

/* A method that takes several dispatches for a ray sets it in all but the one that finds L and T. */
#ifdef SEVERAL_DISPATCHES
bool sky_pending = false;
#endif

/* A method that can give colours at less cost defines METHOD_COLOR: linear Rec.709 of L, and a = the luminance of sun ×
 * transmittance. Plain images then ask for that instead. */
#ifdef METHOD_COLOR
vec4 method_color(Ray ray);
#endif

/* How many invocations share a ray, each with a result of its own; a method of random samples says more. */
#ifndef RAY_SHARE
#define RAY_SHARE 1
#endif

/* SHAFTS, chosen when the program is built: the scene's shadow takes light from the air before sky and ground, as the table says. */
#ifdef SHAFTS
vec4 lost_to_shadow(Ray ray)
{
	float ground = ray_ground_distance(ray.h, ray.mu);
	return shaft_lost(ray.d, shaft_slice(ground >= 0.0 ? ground : 1e9));
}
#endif

/* Replies the bands as they are, the disk included where the direction is within it: by the
 * chord, since cosines of angles this small have lost their digits. */
void write_spectral(int i, Ray ray, vec4 L, vec4 T)
{
	float rho = distance(ray.d, frame.sun_direction.xyz) / (2.0 * sin(0.5 * frame.sun_angular_radius));
	vec4 wave = 1e3 / bands.wavelength, alpha = frame.limb_law.x + wave * (frame.limb_law.y + wave * frame.limb_law.z);
	vec4 limb = pow(vec4(max(1.0 - rho * rho, 1e-12)), 0.5 * alpha) * (1.0 + 0.5 * alpha);
	bool on_disk = WANTED(FEATURE_SUN_DISK) != 0 && rho <= 1.0;
	radiance[i] = on_disk ? L + T * bands.sun_irradiance * limb / frame.sun_solid_angle : L;
	transmittance[i] = T;
}

/* Adds a batch's share to what the strip holds; the first batch finds anything there. */
void add_color(int i, vec4 color)
{
	radiance[i] = batch == 0 ? color : radiance_before(i) + color;
}

void add_layers(int i, Ray ray, vec4 L, vec4 T)
{
	bool first = batch == 0;
	vec3 through = to_rgb(T * bands.sun_irradiance);
	transmittance[i] = vec4(first ? through : transmittance[i].rgb + through, 1.0);
	if (WANTED(FEATURE_LAYERS) != 0) {
		float ground = ray.pixel_solid_angle < 0.0 ? -1.0 : ray_ground_distance(ray.h, ray.mu);
		ground = surface_reached >= 0.0 ? surface_reached : ground;
		vec3 layer = to_rgb(L - ground_reflected);
		inscatter[i] = vec4(first ? layer : inscatter[i].rgb + layer,
			ground >= 0.0 ? ground : uintBitsToFloat(0x7f800000u)); /* +inf: none */
	}
}

/* What surfaces of a scene leave of a pixel's sky; surfaces.comp adds theirs. */
float open_share(int i)
{
	return feature(FEATURE_SURFACES) ? 1.0 - surface_coverage(surface_of(i)) : 1.0;
}

/* A pixel that the ground's horizon crosses looks twice: into the middle of its sky and of its ground. */
struct Looks {
	int count;
	float share; /* of the first */
	float first, second; /* cosines with the vertical */
};

Looks looks_of(Ray ray)
{
	float horizon = mu_horizon(ray.h), slope = sqrt(max(1.0 - horizon * horizon, 1e-6));
	float reach = 0.5 * slope * sqrt(max(ray.pixel_solid_angle, 0.0)), above = ray.mu - horizon;
#ifdef SCENE /* such paths start all over the pixel */
	reach = 0.0;
#endif
	return Looks(abs(above) < reach && slope > 0.02 ? 2 : 1, 0.5 + 0.5 * above / max(reach, 1e-12),
		horizon + 0.5 * (above + reach), horizon + 0.5 * (above - reach));
}

Ray look(Ray ray, Looks looks, int k)
{
	if (looks.count > 1) {
		vec3 level = ray.d - ray.up * dot(ray.up, ray.d);
		level *= inversesqrt(max(dot(level, level), 1e-12));
		ray.mu = clamp(k == 0 ? looks.first : looks.second, -1.0, 1.0);
		ray.d = level * sqrt(max(1.0 - ray.mu * ray.mu, 0.0)) + ray.up * ray.mu;
	}
	return ray;
}

float look_share(Looks looks, int k)
{
	return looks.count == 1 ? 1.0 : k == 0 ? looks.share : 1.0 - looks.share;
}

#if defined(PLAIN) && defined(METHOD_COLOR)
vec4 pixel_color(Ray ray)
{
	vec4 color = vec4(0.0);
	Looks looks = looks_of(ray);
	int k = 0;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		color += method_color(look(ray, looks, k)) * look_share(looks, k);
	} while (++k < looks.count);
#ifdef SHAFTS
	color.rgb -= to_rgb(lost_to_shadow(ray));
#endif
	return color;
}
#elif !defined(SEVERAL_DISPATCHES)
void pixel_sky(Ray ray, out vec4 L, out vec4 T)
{
	vec4 reflected = L = T = vec4(0.0);
	Looks looks = looks_of(ray);
	int k = 0;
	do {
		vec4 l, t;
		float share = look_share(looks, k);
		ground_reflected = vec4(0.0);
		method_sky(look(ray, looks, k), l, t);
		L += share * l;
		T += share * t;
		reflected += share * ground_reflected;
	} while (++k < looks.count);
	ground_reflected = reflected;
#ifdef SHAFTS
	L = max(L - lost_to_shadow(ray), 0.0);
#endif
}
#endif

void write_pixel(int i, Ray ray, bool shown)
{
#if defined(PLAIN) && defined(METHOD_COLOR)
	vec4 color = pixel_color(ray) * open_share(i);
	add_color(i, shown ? color : vec4(vec3(0.0), dot(bands.sun_luminance, vec4(1.0))));
#else
	vec4 L = vec4(0.0), T = vec4(0.0);
	float open = open_share(i);
#ifdef SEVERAL_DISPATCHES
	if (open > 0.0)
		method_sky(ray, L, T);
	if (sky_pending)
		return;
#else
	if (open > 0.0)
		pixel_sky(ray, L, T);
#endif
	if (open < 1.0) {
		L *= open;
		T *= open;
		ground_reflected *= open;
	}
	if (!shown) {
		L = ground_reflected = vec4(0.0);
		T = vec4(1.0);
	}
	if (WANTED(FEATURE_SPECTRAL) != 0) {
		write_spectral(i, ray, L, T);
		return;
	}
	add_color(i, vec4(to_rgb(L), dot(T, bands.sun_luminance)));
	if (WANTED(FEATURE_LAYERS | FEATURE_SUN_DISK) != 0)
		add_layers(i, ray, L, T);
#endif
}

void main()
{
	int i = own_pixel();
	if (i >= tile.z * tile.w * RAY_SHARE)
		return;
	int ray_index = i / RAY_SHARE;
	vec4 at = direction_of(WANTED(FEATURE_SPECTRAL) != 0 ? tile.x + ray_index : ray_index);
	Ray ray;
	ray.d = at.xyz;
	ray.h = frame.camera_altitude;
	ray.up = frame.vertical.xyz;
	ray.mu = clamp(dot(ray.up, ray.d), -1.0, 1.0);
	ray.pixel_solid_angle = at.w;
	write_pixel(i, ray, at.w >= 0.0);
}
