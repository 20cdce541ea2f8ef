/*
 * What all sky methods share. A method's kernel includes this first and defines method_sky(); it gets
 * pixels and bare directions, spectral batches, the sun's disk, layers and accumulation from here.
 */
#include "sun_disk.glsl"

/* Per band: radiance L (W/m²/sr/nm) that arrives along the ray without the sun's disk, and the
 * transmittance T from the camera to space; 0 where the ray meets the ground. */
void method_sky(Ray ray, out vec4 L, out vec4 T);

float ray_ground_distance(float h, float mu);

/* The part of the L last returned by method_sky that the ground reflected, already attenuated: it
 * is left out of the in-scatter layer. A method that draws ground sets it. */
vec4 ground_reflected = vec4(0.0);

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_BATCH) uniform int batch;
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(std430, binding = BIND_INSCATTER) buffer Inscatter { vec4 inscatter[]; };
layout(std430, binding = BIND_TRANSMITTANCE) buffer Transmittance { vec4 transmittance[]; };
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };

bool feature(int bit)
{
	return (frame.features & bit) != 0;
}

vec3 to_rgb(vec4 L)
{
	return vec3(dot(bands.to_rgb[0], L), dot(bands.to_rgb[1], L), dot(bands.to_rgb[2], L));
}

float luminance(vec3 rgb)
{
	return dot(rgb, vec3(0.2126390, 0.7151687, 0.0721923)); /* Y of Rec.709 with white D65 */
}

/* Radiance of the sun's disk outside the air, uniform over the disk. */
vec4 sun_radiance()
{
	return bands.sun_irradiance / frame.sun_solid_angle;
}

void render_direction()
{
	int i = tile.x + int(gl_WorkGroupID.x) * WORKGROUP_X * WORKGROUP_Y + int(gl_LocalInvocationIndex);
	if (i >= tile.x + tile.z)
		return;
	Ray ray = camera_ray(direction[i].xyz, 0.0);
	vec4 L, T;
	method_sky(ray, L, T);
	/* by the chord, since cosines of angles this small have lost their digits */
	if (feature(FEATURE_SUN_DISK) &&
		distance(ray.d, frame.sun_direction.xyz) <= 2.0 * sin(0.5 * frame.sun_angular_radius))
		L += T * sun_radiance();
	radiance[i - tile.x] = L;
	transmittance[i - tile.x] = T;
}

/* Adds a batch's share to what the strip holds; the first batch finds anything there. */
void accumulate(int i, vec4 color, vec4 layer, vec4 through)
{
	bool first = batch == 0;
	radiance[i] = first ? color : radiance[i] + color;
	if (!feature(FEATURE_LAYERS))
		return;
	inscatter[i] = first ? layer : vec4(inscatter[i].rgb + layer.rgb, layer.a);
	transmittance[i] = first ? through : transmittance[i] + through;
}

void render_pixel()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(at, tile.zw)))
		return;
	const float no_ground = uintBitsToFloat(0x7f800000u);
	vec2 center = vec2(tile.xy + at) + 0.5;
	vec4 L = vec4(0.0), T = vec4(1.0), disk = vec4(0.0);
	float ground = -1.0;
	if (camera_sees(center)) {
		vec3 v = camera_local(center, cross_cell(center));
		Ray ray = camera_ray(camera_to_world(v), camera_pixel_solid_angle(center, v));
		method_sky(ray, L, T);
		if (feature(FEATURE_SUN_DISK))
			disk = T * sun_radiance() * sun_coverage(ray, center);
		if (feature(FEATURE_LAYERS))
			ground = ray_ground_distance(ray.h, ray.mu);
	}
	vec3 through = to_rgb(T * bands.sun_irradiance);
	accumulate(at.y * tile.z + at.x, vec4(to_rgb(L + disk), luminance(through)),
		vec4(to_rgb(L - ground_reflected), ground >= 0.0 ? ground : no_ground), vec4(through, 1.0));
}

void main()
{
	if (feature(FEATURE_DIRECTIONS))
		render_direction();
	else
		render_pixel();
}
