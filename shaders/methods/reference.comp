/*
 * The reference: path tracing (path.glsl). Each invocation follows a group of paths along one ray, the first
 * collisions stratified along it, and gives their mean: an unbiased sample, independent of all other groups', so
 * that their spread is the standard error.
 */
#include "shared.h"

layout(location = LOCATION_SAMPLES) uniform ivec4 samples;
#define RAY_SHARE samples.y

#ifdef CLOUDS
#define SEVERAL_DISPATCHES
#endif

#include "sky.glsl"
#include "path.glsl"
#ifdef CLOUDS
#include "cloud_path.glsl"

layout(location = LOCATION_ITERATION) uniform int iteration;
layout(std430, binding = BIND_PATHS) buffer Stored { uvec4 stored[]; };

vec4 stored_at(int at)
{
	return uintBitsToFloat(stored[at]);
}

Paths load_paths(int at)
{
	vec4 up = stored_at(at), d = stored_at(at + 1), way = stored_at(at + 5);
	uvec4 counts = stored[at + 6];
	rng_state = counts.x;
	turns = int(counts.w >> 1);
	Vertex v;
	v.h = up.w;
	v.up = up.xyz;
	v.d = d.xyz;
	v.beta = stored_at(at + 2);
#ifdef SCENE
	v.at = stored_at(at + 7).xyz;
#endif
	return Paths(v, Sheet(way.x, way.y), int(counts.y & 255u), int(counts.y >> 8), int(counts.z),
		stored_at(at + 3), d.w, (counts.w & 1u) != 0u, way.z, way.w, stored_at(at + 4));
}

void store_paths(int at, Paths p)
{
	stored[at] = floatBitsToUint(vec4(p.v.up, p.v.h));
	stored[at + 1] = floatBitsToUint(vec4(p.v.d, p.clear));
	stored[at + 2] = floatBitsToUint(p.v.beta);
	stored[at + 3] = floatBitsToUint(p.L);
	stored[at + 4] = floatBitsToUint(p.answer);
	stored[at + 5] = floatBitsToUint(vec4(p.sheet.depth, p.sheet.above, p.t, p.weight));
	stored[at + 6] = uvec4(rng_state, uint(p.path) | uint(p.order) << 8, uint(p.since), uint(turns) << 1 | uint(p.sunward));
#ifdef SCENE
	stored[at + 7] = floatBitsToUint(vec4(p.v.at, 0.0));
#endif
}

int first_stored()
{
	return int(gl_GlobalInvocationID.x) * PATH_UVEC4S;
}

/* Are paths of this invocation left to follow? */
bool paths_left()
{
	return iteration == 0 || int(stored[first_stored() + 6].y & 255u) < samples.z;
}

/* Goes on with the paths of an invocation; true in the dispatch that ends them, with their means. */
bool follow_stored(Vertex start, out vec4 L, out float clear)
{
	int at = first_stored();
	Paths p = Paths(first_vertex(start), Sheet(0.0, 0.0), 0, 1, 0, vec4(0.0), 0.0, false, 0.0, 1.0, vec4(0.0));
	if (iteration > 0)
		p = load_paths(at);
	follow(p, start, samples.z, samples.w);
	store_paths(at, p);
	bool done = p.path >= samples.z;
	L = done ? p.L / float(samples.z) : vec4(uintBitsToFloat(0x7fc00000u));
	clear = p.clear / float(samples.z);
	return done || iteration == PATH_DISPATCHES - 1;
}
#endif

void sample_sky(Ray ray, out vec4 L, out vec4 T)
{
	L = vec4(0.0);
	T = vec4(1.0);
	float h = ray.h, mu = ray.mu;
	float entered = ray_enter(h, mu, length(cross(ray.d, ray.up)));
#ifdef CLOUDS
	sky_pending = iteration > 0; /* a ray that meets no air is done at once */
#endif
	if (entered < 0.0)
		return;
	Vertex start;
	start.h = h;
	start.up = entered > 0.0 ? normalize(ray.up * (media.planet_radius + ray.h) + ray.d * entered) : ray.up;
	start.d = ray.d;
	start.beta = vec4(1.0);
#ifdef SCENE /* paths meet a mesh */
	start.at = ray.d * entered;
	float ground = ray_ground_distance(h, mu), far = ground >= 0.0 ? ground : ray_top_distance(h, mu);
	bool met = scene_meet_solid(start.at, ray.d, ground >= 0.0, far) >= 0;
	if (met)
		surface_reached = entered + far;
	T = met ? vec4(0.0) : vec4(1.0);
	if (!met)
#endif
	T = ray_ground_distance(h, mu) >= 0.0 ? vec4(0.0) : exp(-optical_depth(table_column(h, mu)));
#if defined(SCENE) && defined(SEE_THROUGH)
	T *= see_through_share(scene_origin(start.at), to_mesh(ray.d));
#endif
	int index = int(gl_GlobalInvocationID.x), group = samples.x + index % samples.y;
	uvec2 pixel = uvec2(tile.x + (index / samples.y) % tile.z, tile.y + (index / samples.y) / tile.z);
	rng_seed(pixel.x + 65536u * pixel.y, uint(group) + 16777216u * uint(batch), frame.seed);
#ifdef SCENE
	vec3 x = normalize(cross(ray.d, frame.camera_up.xyz)), y = cross(x, ray.d);
	float angle = sqrt(max(ray.pixel_solid_angle, 0.0));
#endif
#ifdef CLOUDS
	start.d = from_world(ray.d);
	start.up = vec3(0.0, 1.0, 0.0);
	if (entered > 0.0)
		start.up = normalize(start.up * (media.planet_radius + ray.h) + start.d * entered);
#ifdef SCENE
	pixel_right = from_world(angle * x);
	pixel_down = from_world(angle * y);
	pixel_entered = entered;
#endif
	float clear;
	sky_pending = !follow_stored(start, L, clear);
	T *= clear;
#else
	/* one loop through the vertices of all paths: lanes that run together do not wait for the longest of each */
	Vertex v;
	float s0;
	for (int path = 0, order = 0; path < samples.z;) {
		if (order++ == 0) {
			v = start;
#ifdef SCENE /* edges and textures are finer than a pixel, and every path looks elsewhere in it */
			v.d = normalize(ray.d + angle * ((rng_next() - 0.5) * x + (rng_next() - 0.5) * y));
			v.at = v.d * entered;
			v.up = entered > 0.0 ? normalize(ray.up * (media.planet_radius + ray.h) + v.at) : ray.up;
#endif
			s0 = (float(path) + rng_next()) / float(samples.z);
		}
		if (!follow_vertex(v, s0, order, L) || order >= samples.w) {
			path++;
			order = 0;
		}
	}
	L = L / float(samples.z);
#endif
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
#ifdef CLOUDS
	L = T = vec4(0.0);
	sky_pending = true;
	/* a loop of one turn, since llvmpipe leaves loops but not branches */
	for (bool left = paths_left(); left; left = false)
		sample_sky(ray, L, T);
#else
	sample_sky(ray, L, T);
#endif
}
