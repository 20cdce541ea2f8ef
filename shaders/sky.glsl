/*
 * What all sky methods share. A method's kernel includes this first and defines method_sky(); it gets
 * pixels and bare directions, spectral batches, layers and accumulation from here. Directions come
 * from rays.comp or from a radiance job; the sun's disk is added by sun_disk.comp.
 */
#include "shared.h"

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

/* The part of the L last returned by method_sky that the ground reflected, already attenuated: it
 * is left out of the in-scatter layer. A method that draws ground sets it. */
vec4 ground_reflected = vec4(0.0);

/* A method that takes several dispatches for a ray sets it in all but the one that finds L and T. Few rays are worth a
 * dispatch then, so its groups are small, or a software device would leave threads without one. */
#ifdef SEVERAL_DISPATCHES
bool sky_pending = false;
layout(local_size_x = WORKGROUP_LINE / 2) in;
#else
layout(local_size_x = WORKGROUP_LINE) in;
#endif
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_BATCH) uniform int batch;
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(std430, binding = BIND_INSCATTER) buffer Inscatter { vec4 inscatter[]; };
layout(std430, binding = BIND_TRANSMITTANCE) buffer Transmittance { vec4 transmittance[]; };
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };

/* Chosen when the program is built, where the renderer does so. */
#ifndef SPECTRAL
#define SPECTRAL (frame.features & FEATURE_SPECTRAL)
#endif
#ifndef LAYERS
#define LAYERS (frame.features & FEATURE_LAYERS)
#endif

/* How many invocations share a ray, each with a result of its own; a method of random samples says more. */
#ifndef RAY_SHARE
#define RAY_SHARE 1
#endif

bool feature(int bit)
{
	return (frame.features & bit) != 0;
}

vec3 to_rgb(vec4 L)
{
	return vec3(dot(bands.to_rgb[0], L), dot(bands.to_rgb[1], L), dot(bands.to_rgb[2], L));
}

/* Replies the bands as they are, the uniform disk included where the direction is within it: by the
 * chord, since cosines of angles this small have lost their digits. */
void write_spectral(int i, Ray ray, vec4 L, vec4 T)
{
	bool on_disk = feature(FEATURE_SUN_DISK) &&
		distance(ray.d, frame.sun_direction.xyz) <= 2.0 * sin(0.5 * frame.sun_angular_radius);
	radiance[i] = on_disk ? L + T * bands.sun_irradiance / frame.sun_solid_angle : L;
	transmittance[i] = T;
}

/* Adds a batch's share to what the strip holds; the first batch finds anything there. */
void add_pixel(int i, Ray ray, vec4 L, vec4 T)
{
	bool first = batch == 0;
	vec4 color = vec4(to_rgb(L), dot(T, bands.sun_luminance));
	radiance[i] = first ? color : radiance[i] + color;
	if (LAYERS != 0 || feature(FEATURE_SUN_DISK)) {
		vec3 through = to_rgb(T * bands.sun_irradiance);
		transmittance[i] = vec4(first ? through : transmittance[i].rgb + through, 1.0);
	}
	if (LAYERS != 0) {
		float ground = ray.pixel_solid_angle < 0.0 ? -1.0 : ray_ground_distance(ray.h, ray.mu);
		vec3 layer = to_rgb(L - ground_reflected);
		inscatter[i] = vec4(first ? layer : inscatter[i].rgb + layer,
			ground >= 0.0 ? ground : uintBitsToFloat(0x7f800000u)); /* +inf: none */
	}
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w * RAY_SHARE)
		return;
	int ray_index = i / RAY_SHARE;
	vec4 at = direction[SPECTRAL != 0 ? tile.x + ray_index : ray_index];
	Ray ray;
	ray.d = at.xyz;
	ray.h = frame.camera_altitude;
	ray.up = frame.vertical.xyz;
	ray.mu = clamp(dot(ray.up, ray.d), -1.0, 1.0);
	ray.pixel_solid_angle = at.w;
	vec4 L, T;
	method_sky(ray, L, T);
#ifdef SEVERAL_DISPATCHES
	if (sky_pending)
		return;
#endif
	if (at.w < 0.0) {
		L = ground_reflected = vec4(0.0);
		T = vec4(1.0);
	}
	if (SPECTRAL != 0)
		write_spectral(i, ray, L, T);
	else
		add_pixel(i, ray, L, T);
}
