/*
 * Clouds of the pixels that a frame of a sequence does not march (cloud_history.glsl): from the frame before, where it showed the same
 * place, within what the marched pixels around allow; else between those, where they agree; clouds.comp marches the rest.
 */
#include "cloud_density.glsl"
#include "cloud_history.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
/* The camera of the frame before: dot(rows[i].xyz, v) + rows[i].w is a coordinate there of a point v from today's camera, in world axes.
 * The last row is as much longer than 1 as the field of view was wider. */
layout(location = LOCATION_ROWS) uniform vec4 rows[3];
layout(std430, binding = BIND_CLOUD_LATTICE) readonly buffer Lattice { vec4 lattice[]; };
layout(std430, binding = BIND_CLOUD_LIST) buffer List { uint list[]; };
layout(std430, binding = BIND_CLOUD_BEFORE) readonly buffer Before { uvec4 before[]; };
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) writeonly buffer Place { vec4 place[]; };

const float CLIP = 1.75;   /* standard deviations that what was there may lie off the mean of what is marched around: 1 blurs, 4 lets ghosts through */
const float ASTRAY = 1.5;  /* pixels that it may have come from beside where this frame takes it from */
const float NOTHING = 0.02; /* opacity below which a distance says nothing */

Sight marched(ivec2 block)
{
	ivec2 own = clamp(block, ivec2(0), block_last()) - block_first(tile);
	int at = 2 * (own.y * block_count(tile).x + own.x);
	return Sight(lattice[at], lattice[at + 1]);
}

/* Mean and standard deviation of what the blocks around were found to show. */
void around(ivec2 block, out vec4 mean, out vec4 deviation)
{
	vec4 sum = vec4(0.0), square = vec4(0.0);
	for (int k = 0; k < 9; k++) {
		vec4 x = marched(block + ivec2(k % 3, k / 3) - 1).light;
		sum += x;
		square += x * x;
	}
	mean = sum / 9.0;
	deviation = sqrt(max(square / 9.0 - mean * mean, 0.0));
}

/* Where clouds would be seen first, if there were any. */
float clear_distance(vec3 d)
{
	bool low = clouds.weather.z > 0.0;
	float bottom = low ? clouds.bottom : clouds.high_altitude, top = low ? clouds.top : clouds.high_altitude, h = frame.camera_altitude;
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, h);
	vec2 inside = ray.start < 0.0 ? vec2(1.0, 0.0) : cloud_below(ray, h < bottom ? bottom : top);
	float t = h < bottom ? inside.y : h > top ? inside.x : 0.5 * inside.y;
	return inside.y > inside.x ? t : 1e6;
}

/* Weights of two taps along each axis, times how much there is to see in them. */
vec4 tap_weights(vec2 x)
{
	return vec4((1.0 - x.x) * (1.0 - x.y), x.x * (1.0 - x.y), (1.0 - x.x) * x.y, x.x * x.y);
}

/* A mean of four distances by opacity; without any, the plain one. */
vec4 mean_place(Sight s[4], vec4 weight)
{
	vec4 w = weight * max(1.0 - vec4(s[0].light.x, s[1].light.x, s[2].light.x, s[3].light.x), 1e-4);
	return (w.x * s[0].place + w.y * s[1].place + w.z * s[2].place + w.w * s[3].place) / dot(w, vec4(1.0));
}

Sight recall(ivec2 at)
{
	ivec2 size = ivec2(frame.width, frame.height);
	if (PROJECTION == PROJECTION_EQUIRECTANGULAR)
		at.x = (at.x + size.x) % size.x;
	at = clamp(at, ivec2(0), size - 1);
	return sight_unpack(before[at.y * size.x + at.x]);
}

/* Weights of four taps by which curves through them are interpolated (Catmull & Rom 1974). */
vec4 cubic_weights(float x)
{
	return 0.5 * vec4(x * (x * (2.0 - x) - 1.0), x * x * (3.0 * x - 5.0) + 2.0, x * (x * (4.0 - 3.0 * x) + 1.0), x * x * (x - 1.0));
}

/* What the frame before showed at an image coordinate: cubic, since fifteen linear interpolations in a row would blur. */
Sight recall_between(vec2 image)
{
	vec2 from = floor(image - 0.5), x = image - 0.5 - from;
	vec4 across = cubic_weights(x.x), down = cubic_weights(x.y), sum = vec4(0.0);
	Sight near_[4];
	for (int k = 0; k < 16; k++) {
		ivec2 tap = ivec2(k & 3, k >> 2);
		Sight s = recall(ivec2(from) + tap - 1);
		sum += across[tap.x] * down[tap.y] * s.light;
		if (all(equal(tap & 1 ^ tap >> 1, ivec2(1))))
			near_[(tap.x - 1) + 2 * (tap.y - 1)] = s;
	}
	sum = max(sum, vec4(0.0));
	sum.x = min(sum.x, 1.0);
	return Sight(sum, mean_place(near_, tap_weights(x)));
}

/* What the frame before showed of the place at distance t in direction d; false: it did not. */
bool remember(vec4 d, float t, out Sight then)
{
	vec4 v = vec4(d.xyz * t, 1.0);
	vec3 local = vec3(dot(rows[0], v), dot(rows[1], v), dot(rows[2], v));
	vec2 image = camera_image(local);
	then = Sight(vec4(0.0), vec4(0.0));
	if (any(lessThan(image, vec2(0.0))) || any(greaterThanEqual(image, vec2(frame.width, frame.height))))
		return false;
	then = recall_between(image);
	float away = length(vec3(local.xy, local.z / length(rows[2].xyz))), moved = length(vec3(rows[0].w, rows[1].w, rows[2].w / length(rows[2].xyz)));
	/* at its own distance it was elsewhere, by that many pixels at most */
	float astray = moved * abs(1.0 / max(then.place.x, 1.0) - 1.0 / max(away, 1.0)) / sqrt(max(d.w, 1e-12));
	bool same_place = then.light.x > 1.0 - NOTHING || astray < ASTRAY;
	then.place.x = max(then.place.x + t - away, 0.0);
	then.place.z = max(then.place.z + t - away, 0.0);
	return same_place;
}

void add_to_list(int at)
{
	uint i = atomicAdd(list[CLOUD_LIST_HEAD + 3], 1u);
	list[CLOUD_LIST_FIRST + i] = uint(at);
	atomicMax(list[CLOUD_LIST_HEAD], i / WORKGROUP_LINE + 1u);
}

void show(int i, Sight s)
{
	light[i] = s.light;
	place[i] = s.place;
}

/* A pixel that was not marched. */
void fill(ivec2 pixel, int i, vec4 mean, vec4 deviation)
{
	ivec2 low = (pixel - samples.xy + BLOCK) / BLOCK - 1; /* rounded down */
	vec2 x = vec2(pixel - samples.xy - BLOCK * low) / float(BLOCK);
	Sight s[4] = Sight[4](marched(low), marched(low + ivec2(1, 0)), marched(low + ivec2(0, 1)), marched(low + 1));
	vec4 weight = tap_weights(x), d = pixel_direction(pixel), where = mean_place(s, weight);
	vec4 opacity = 1.0 - vec4(s[0].light.x, s[1].light.x, s[2].light.x, s[3].light.x);
	Sight then;
	if (remember(d, dot(weight, opacity) > NOTHING ? where.x : clear_distance(d.xyz), then)) {
		vec4 now = clamp(then.light, mean - CLIP * deviation, mean + CLIP * deviation);
		/* what came to be seen here is where its neighbours are */
		if (1.0 - then.light.x < 0.5 * (1.0 - now.x))
			then.place = where;
		show(i, Sight(now, then.place));
	} else if (alike(s[0], s[1], s[2], s[3])) {
		show(i, between(s[0], s[1], s[2], s[3], x));
	} else {
		add_to_list(i);
	}
}

/* A thread does a block: what is around is the same for its pixels. */
void main()
{
	ivec2 first = tile.xy / BLOCK, count = (tile.xy + tile.zw - 1) / BLOCK - first + 1;
	int n = int(gl_GlobalInvocationID.x);
	if (n >= count.x * count.y)
		return;
	ivec2 block = first + ivec2(n % count.x, n / count.x), own = block_pixel(block);
	vec4 mean, deviation;
	around(block, mean, deviation);
	for (int k = 0; k < BLOCK * BLOCK; k++) {
		ivec2 pixel = BLOCK * block + ivec2(k % BLOCK, k / BLOCK), at = pixel - tile.xy;
		int i = at.y * tile.z + at.x;
		if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, tile.zw)))
			continue;
		if (pixel == own)
			show(i, marched(block));
		else if (samples.z == 1)
			show(i, recall(pixel));
		else
			fill(pixel, i, mean, deviation);
	}
}
