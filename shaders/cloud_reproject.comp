/*
 * Clouds of the pixels that a frame of a sequence does not march (cloud_history.glsl): between those that it does, where all of them
 * around agree; else from the frame before, where it showed the same place, within what they allow; else between those next
 * to the pixel, where these agree; clouds.comp marches the rest.
 */
#include "cloud_density.glsl"
#include "cloud_history.glsl"
#include "pixel_list.glsl"

/* CLOUD_RAYS_BLOCKS: all blocks; it lists those around which what is marched does not agree. CLOUD_RAYS_PIXELS: these. */
#ifndef RAYS
#define RAYS CLOUD_RAYS_PIXELS
#endif

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
/* The camera of the frame before: dot(rows[i].xyz, v) + rows[i].w is a coordinate there of a point v from today's camera, in world axes.
 * The last row is as much longer than 1 as the field of view was wider. */
layout(location = LOCATION_ROWS) uniform vec4 rows[3];
/* The same twice: of two texels the first is a pixel's light, and what is read of the other storage its place. */
layout(binding = UNIT_CLOUD_BEFORE) uniform samplerBuffer cloud_before_texels;
layout(std430, binding = BIND_CLOUD_BEFORE) readonly buffer Before { uvec4 before[]; };
layout(std430, binding = BIND_CLOUD_KEPT) writeonly buffer Kept { uvec4 kept[]; };

const float CLIP = 1.75;   /* standard deviations that what was there may lie off the mean of what is marched around: 1 blurs, 4 lets ghosts through */
const float ASTRAY = 1.5;  /* pixels that it may have come from beside where this frame takes it from */
const float NOTHING = 0.02; /* opacity below which a distance says nothing */

Sight marched(ivec2 block)
{
	return sight_of_lattice(block_number(clamp(block, ivec2(0), block_last())));
}

/* What the blocks around were found to show: mean, standard deviation, least and most; all but the mean of place in x alone. */
struct Around {
	vec4 mean, deviation;
	vec2 shown, through, away; /* least and most */
};

vec2 extend(vec2 range_, float x)
{
	return vec2(min(range_.x, x), max(range_.y, x));
}

Around around(ivec2 block)
{
	Around a = Around(vec4(0.0), vec4(0.0), vec2(1e30, -1e30), vec2(1e30, -1e30), vec2(1e30, -1e30));
	vec4 square = vec4(0.0);
	for (int k = 0; k < 9; k++) {
		Sight s = marched(block + ivec2(k % 3, k / 3) - 1);
		a.mean += s.light / 9.0;
		square += s.light * s.light / 9.0;
		a.shown = extend(a.shown, shown(s.light));
		a.through = extend(a.through, s.light.x);
		a.away = extend(a.away, s.place.x);
	}
	a.deviation = sqrt(max(square - a.mean * a.mean, 0.0));
	return a;
}

bool agree(Around a)
{
	vec3 range_ = vec3(a.shown.y - a.shown.x, a.through.y - a.through.x, a.away.y - a.away.x);
	return all(lessThanEqual(range_, vec3(ALIKE * shown(a.mean), ALIKE_THROUGH, ALIKE_DISTANCE * a.away.y)));
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

/* The pixel of the frame before that shows what lies there, or comes next to it. */
int before_pixel(ivec2 at)
{
	ivec2 size = ivec2(frame.width, frame.height);
	if (PROJECTION == PROJECTION_EQUIRECTANGULAR)
		at.x = (at.x + size.x) % size.x;
	at = clamp(at, ivec2(0), size - 1);
	return at.y * size.x + at.x;
}

vec4 recall_light(int i)
{
	return texelFetch(cloud_before_texels, 2 * i);
}

Sight recall(int i)
{
	return Sight(recall_light(i), place_unpack(before[i].zw));
}

/* Weights of four taps by which curves through them are interpolated (Catmull & Rom 1974). */
vec4 cubic_weights(float x)
{
	return 0.5 * vec4(x * (x * (2.0 - x) - 1.0), x * x * (3.0 * x - 5.0) + 2.0, x * (x * (4.0 - 3.0 * x) + 1.0), x * x * (x - 1.0));
}

/* Of one row of four. */
vec4 recall_row(ivec2 first, vec4 across)
{
	return across.x * recall_light(before_pixel(first)) + across.y * recall_light(before_pixel(first + ivec2(1, 0))) +
		across.z * recall_light(before_pixel(first + ivec2(2, 0))) + across.w * recall_light(before_pixel(first + ivec2(3, 0)));
}

/* What the frame before showed at an image coordinate: cubic, since fifteen linear interpolations in a row would blur. */
Sight recall_between(vec2 image)
{
	vec2 from = floor(image - 0.5), x = image - 0.5 - from;
	ivec2 at = ivec2(from);
	vec4 across = cubic_weights(x.x), down = cubic_weights(x.y);
	vec4 sum = down.x * recall_row(at + ivec2(-1, -1), across) + down.y * recall_row(at + ivec2(-1, 0), across) +
		down.z * recall_row(at + ivec2(-1, 1), across) + down.w * recall_row(at + ivec2(-1, 2), across);
	sum = max(sum, vec4(0.0));
	sum.x = min(sum.x, 1.0);
	Sight near_[4] = Sight[4](recall(before_pixel(at)), recall(before_pixel(at + ivec2(1, 0))), recall(before_pixel(at + ivec2(0, 1))), recall(before_pixel(at + 1)));
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

void show(ivec2 pixel, Sight s)
{
	kept[pixel.y * frame.width + pixel.x] = sight_pack(s);
}

#if RAYS == CLOUD_RAYS_PIXELS
/* false: neither the frame before nor what is around shows it. */
bool fill(ivec2 pixel, Sight s[4], vec2 x, Around a)
{
	vec4 weight = tap_weights(x), d = pixel_direction(pixel), where = mean_place(s, weight);
	vec4 opacity = 1.0 - vec4(s[0].light.x, s[1].light.x, s[2].light.x, s[3].light.x);
	Sight then;
	if (remember(d, dot(weight, opacity) > NOTHING ? where.x : clear_distance(d.xyz), then)) {
		vec4 now = clamp(then.light, a.mean - CLIP * a.deviation, a.mean + CLIP * a.deviation);
		/* what came to be seen here is where its neighbours are */
		if (1.0 - then.light.x < 0.5 * (1.0 - now.x))
			then.place = where;
		show(pixel, Sight(now, then.place));
	} else if (alike(s[0], s[1], s[2], s[3])) {
		show(pixel, between(s[0], s[1], s[2], s[3], x));
	} else {
		return false;
	}
	return true;
}
#endif

/* A thread does a block: what is around is the same for its pixels. They lie in four cells between marched pixels. */
void main()
{
	int n = int(gl_GlobalInvocationID.x);
	ivec2 first = tile.xy / CLOUD_BLOCK, count = (tile.xy + tile.zw - 1) / CLOUD_BLOCK - first + 1;
#if RAYS == CLOUD_RAYS_PIXELS
	if (n >= list_length(CLOUD_LIST_POINTS))
		return;
	n = list_point(CLOUD_LIST_POINTS, n);
#else
	if (n >= count.x * count.y)
		return;
#endif
	ivec2 block = first + ivec2(n % count.x, n / count.x), own = block_pixel(block);
	Around a = around(block);
#if RAYS == CLOUD_RAYS_BLOCKS
	bool still = samples.z == 1, agreed = agree(a);
	if (!still && !agreed)
		list_add(CLOUD_LIST_POINTS, n, 1);
#endif
	int cell = 0, unknown = 0; /* of the block's pixels */
	do { /* loops tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		ivec2 side = ivec2(cell & 1, cell >> 1), low = block + side - 1, begin = side * samples.xy, end = samples.xy + side * (CLOUD_BLOCK - samples.xy);
		if (any(equal(begin, end)))
			continue;
		Sight s[4] = Sight[4](marched(low), marched(low + ivec2(1, 0)), marched(low + ivec2(0, 1)), marched(low + 1));
		ivec2 next = begin;
		do {
			ivec2 within = next, pixel = CLOUD_BLOCK * block + within, at = pixel - tile.xy;
			next = next.x + 1 < end.x ? ivec2(next.x + 1, next.y) : ivec2(begin.x, next.y + 1);
			if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, tile.zw)))
				continue;
			vec2 off = vec2(within - samples.xy + CLOUD_BLOCK * (1 - side)) / float(CLOUD_BLOCK);
#if RAYS == CLOUD_RAYS_BLOCKS
			if (pixel == own)
				show(pixel, marched(block));
			else if (still)
				show(pixel, recall(before_pixel(pixel)));
			else if (agreed)
				show(pixel, between(s[0], s[1], s[2], s[3], off));
#else
			if (pixel != own && !fill(pixel, s, off, a))
				unknown |= 1 << (CLOUD_BLOCK * within.y + within.x);
#endif
		} while (next.y < end.y);
	} while (++cell < 4);
#if RAYS == CLOUD_RAYS_PIXELS
	list_add_block(CLOUD_LIST_PIXELS, CLOUD_BLOCK * block - tile.xy, tile.z, unknown);
#endif
}
