#include "gpu/cloud_history.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { HISTORIES = 4, PIXEL_BYTES = 16, BLOCK_BYTES = 32 };

static const size_t most_bytes = (size_t)512 << 20;

/* More than that between two frames is a cut: what the frame before showed is then elsewhere, or lit otherwise. */
static const double most_turn_deg = 10, most_zoom = 1.1, most_sun_deg = 1, most_change = 0.02;
/* m: that, or as large a part of the way to the clouds; and how far shapes may rise in them */
static const double least_way = 2, most_way_part = 0.1, most_rise = 25;

/* What a frame was like, as far as its clouds go by it. */
struct look {
	struct FrameBlock frame;
	struct CloudsBlock clouds;
	double planet_radius_m;
	double position_m[3]; /* of the camera */
	double drift_m[2];    /* of the clouds, east and south */
	double rise_m;        /* of shapes in them */
};

struct cloud_history {
	uint64_t sequence; /* 0: free */
	int frame;         /* whose clouds are there; -1: none */
	bool busy;         /* a frame reads and writes it */
	unsigned used;
	struct buffer pixels[2];
	int latest; /* of the two: what is there; the other is being written */
	struct buffer blocks;
	int marched[2]; /* columns and rows of blocks: all in rows before the latter, and in others columns before the
			   former */
	struct look look;
};

struct cloud_histories {
	struct cloud_history of[HISTORIES];
	unsigned clock;
};

/* ---- cuts ---- */

static struct look look_of(const struct frame *f)
{
	const struct welkin_request *r = &f->job.request;
	const struct welkin_clouds *c = &r->clouds;
	const double heading = c->wind_heading_deg * (M_PI / 180), moved = c->wind_speed_m_s * c->time_s;
	struct look look = { .frame = f->scene.frame,
		.clouds = f->scene.clouds,
		.planet_radius_m = r->atmosphere.planet_radius_m,
		.drift_m = { moved * sin(heading), -moved * cos(heading) },
		.rise_m = c->evolution_m_s * c->time_s };
	memcpy(look.position_m, r->camera.position_m, sizeof look.position_m);
	look.frame.width = r->image.width; /* while metering the block has others */
	look.frame.height = r->image.height;
	return look;
}

static double angle_deg(const float a[4], const float b[4])
{
	double dot = 0, square = 0;
	for (int i = 0; i < 3; i++) {
		const double difference = (double)a[i] - (double)b[i];
		dot += (double)a[i] * (double)b[i];
		square += difference * difference;
	}
	/* exact for small angles, where an arc cosine is not */
	return (dot > 0 ? 2 * asin(fmin(sqrt(square) / 2, 1)) : acos(fmax(dot, -1))) * (180 / M_PI);
}

/* How the camera has moved through the air that carries the clouds, world axes. */
static void way(const struct look *from, const struct look *to, double out[3])
{
	const double east = to->drift_m[0] - from->drift_m[0], south = to->drift_m[1] - from->drift_m[1];
	for (int i = 0; i < 3; i++)
		out[i] = to->position_m[i] - from->position_m[i] - east * (double)to->clouds.east[i] -
			 south * (double)to->clouds.south[i];
}

/* Takes from one what may glide, if it has not gone far, and what goes by where the camera is. */
static void overlook(struct CloudsBlock *to, const struct CloudsBlock *from)
{
	const struct {
		float *to;
		float from;
	} gliding[] = { { &to->weather[2], from->weather[2] }, { &to->high[2], from->high[2] },
		{ &to->extinction, from->extinction }, { &to->type, from->type }, { &to->top, from->top },
		{ &to->precipitation, from->precipitation }, { &to->anvil, from->anvil },
		{ &to->detail_strength, from->detail_strength }, { &to->high_depth, from->high_depth },
		{ &to->shear_east, from->shear_east }, { &to->shear_south, from->shear_south } };
	for (size_t i = 0; i < sizeof gliding / sizeof gliding[0]; i++) {
		const double a = (double)*gliding[i].to, b = (double)gliding[i].from;
		if (fabs(a - b) <= most_change * fmin(fabs(a), fabs(b)))
			*gliding[i].to = gliding[i].from;
	}
	const size_t offset = 3 * sizeof(float), flat = 2 * sizeof(float);
	memcpy(to->east, from->east, sizeof to->east);
	memcpy(to->south, from->south, sizeof to->south);
	memcpy(to->origin, from->origin, sizeof to->origin);
	memcpy(to->base, from->base, offset);
	memcpy(to->detail, from->detail, offset);
	memcpy(to->regions, from->regions, offset);
	memcpy(to->weather, from->weather, flat);
	memcpy(to->curl, from->curl, flat);
	memcpy(to->high, from->high, flat);
	memcpy(to->grid, from->grid, sizeof to->grid);
}

static bool same_clouds(const struct look *a, const struct look *b)
{
	struct CloudsBlock clouds = a->clouds;
	overlook(&clouds, &b->clouds);
	return memcmp(&clouds, &b->clouds, sizeof clouds) == 0 && fabs(a->planet_radius_m - b->planet_radius_m) < 1;
}

static bool same_image(const struct FrameBlock *a, const struct FrameBlock *b)
{
	return a->width == b->width && a->height == b->height && a->projection == b->projection &&
	       a->cube_face == b->cube_face;
}

/* In a fisheye no factor on directions stands for another field of view. */
static bool zoom_fits(const struct FrameBlock *a, const struct FrameBlock *b)
{
	const double zoom = (double)b->tan_half_fov / (double)a->tan_half_fov;
	if (a->projection == PROJECTION_FISHEYE)
		return fabs((double)a->fov - (double)b->fov) < 1e-6;
	return a->projection != PROJECTION_PERSPECTIVE || (zoom < most_zoom && zoom > 1 / most_zoom);
}

static double way_to_clouds(const struct look *look)
{
	const double h = (double)look->frame.camera_altitude;
	return fmax(fmax((double)look->clouds.bottom - h, h - (double)look->clouds.top), 0);
}

static __attribute__((format(printf, 2, 3))) bool cut(char why[92], const char *format, ...)
{
	va_list args;
	va_start(args, format);
	vsnprintf(why, 92, format, args);
	va_end(args);
	return true;
}

/* Does the one not follow from the other? */
static bool is_cut(const struct look *from, const struct look *to, char why[92])
{
	const struct FrameBlock *a = &from->frame, *b = &to->frame;
	const double turn =
		fmax(angle_deg(a->camera_forward, b->camera_forward), angle_deg(a->camera_right, b->camera_right));
	const double sun = angle_deg(a->sun_direction, b->sun_direction);
	double moved[3];
	way(from, to, moved);
	const double distance = hypot(hypot(moved[0], moved[1]), moved[2]);
	if (!same_image(a, b))
		return cut(why, "a cut: another size or projection");
	if (!zoom_fits(a, b))
		return cut(why, "a cut: another field of view");
	if (turn > most_turn_deg)
		return cut(why, "a cut: the camera turned by %.0f degrees", turn);
	if (distance > fmax(least_way, most_way_part * way_to_clouds(to)))
		return cut(why, "a cut: camera and clouds moved by %.0f m", distance);
	if (fabs(to->rise_m - from->rise_m) > most_rise)
		return cut(why, "a cut: the clouds evolved by %.0f m", fabs(to->rise_m - from->rise_m));
	if (sun > most_sun_deg)
		return cut(why, "a cut: the sun moved by %.1f degrees", sun);
	if (!same_clouds(from, to))
		return cut(why, "a cut: other clouds");
	return false;
}

/* ---- memory ---- */

static size_t bytes(const struct cloud_history *h)
{
	return h->pixels[0].size + h->pixels[1].size + h->blocks.size;
}

static void forget(struct cloud_history *h)
{
	for (int i = 0; i < 2; i++)
		workspace_release(&h->pixels[i]);
	workspace_release(&h->blocks);
	*h = (struct cloud_history){ .frame = -1 };
}

/* The one that has waited longest and that no frame holds; NULL: none. */
static struct cloud_history *oldest(struct cloud_histories *all)
{
	struct cloud_history *found = NULL;
	for (int i = 0; i < HISTORIES; i++)
		if (!all->of[i].busy && (!found || all->of[i].used < found->used))
			found = &all->of[i];
	return found;
}

static struct cloud_history *find(struct cloud_histories *all, uint64_t sequence)
{
	for (int i = 0; i < HISTORIES; i++)
		if (all->of[i].sequence == sequence)
			return &all->of[i];
	struct cloud_history *h = oldest(all);
	if (h) {
		forget(h);
		h->sequence = sequence;
	}
	return h;
}

/* Within the bound, at the cost of those that have waited longest. */
static bool make_room(struct cloud_histories *all, struct cloud_history *h, size_t size, size_t blocks_size)
{
	struct error err;
	if (h->pixels[0].size < size)
		h->frame = -1;
	for (int i = 0; i < 2; i++)
		if (!workspace_reserve(&h->pixels[i], size, false, &err))
			return false;
	if (!workspace_reserve(&h->blocks, blocks_size, false, &err))
		return false;
	for (;;) {
		size_t sum = 0;
		for (int i = 0; i < HISTORIES; i++)
			sum += bytes(&all->of[i]);
		if (sum <= most_bytes)
			return true;
		struct cloud_history *other = NULL;
		for (int i = 0; i < HISTORIES; i++) {
			struct cloud_history *o = &all->of[i];
			if (o != h && !o->busy && bytes(o) && (!other || o->used < other->used))
				other = o;
		}
		if (!other)
			return false;
		forget(other);
	}
}

/* Blocks of an image along an axis; cloud_history.glsl. */
static int blocks_across(int pixels)
{
	return (pixels + CLOUD_BLOCK - 1) / CLOUD_BLOCK;
}

/* Where the frame's clouds are kept; NULL: nowhere. */
static struct cloud_history *take(struct workspace *ws, const struct frame *f)
{
	const int width = f->job.request.image.width, height = f->job.request.image.height;
	const size_t size = (size_t)width * (size_t)height * PIXEL_BYTES;
	const size_t blocks_size = (size_t)blocks_across(width) * (size_t)blocks_across(height) * BLOCK_BYTES;
	struct cloud_histories *all = ws->histories;
	if (2 * size + blocks_size > most_bytes || (!all && !(all = ws->histories = calloc(1, sizeof *all))))
		return NULL;
	struct cloud_history *h = find(all, f->job.sequence);
	if (!h || h->busy)
		return NULL;
	if (!make_room(all, h, size, blocks_size)) {
		forget(h);
		return NULL;
	}
	h->used = ++all->clock;
	h->busy = true;
	return h;
}

void cloud_histories_destroy(struct cloud_histories *histories)
{
	for (int i = 0; histories && i < HISTORIES; i++)
		forget(&histories->of[i]);
	free(histories);
}

/* ---- a frame ---- */

/* The pixel of a block that a frame marches: the order of Bayer's matrix, so that two that follow are far apart. */
static void marched_pixel(int frame, int pixel[2])
{
	const int n = frame & 15;
	pixel[0] = ((n & 1) ^ (n >> 1 & 1)) << 1 | ((n >> 2 & 1) ^ (n >> 3 & 1));
	pixel[1] = (n >> 1 & 1) << 1 | (n >> 3 & 1);
}

/* What takes points from today's camera to coordinates of the one before. */
static void set_rows(struct frame *f, const struct look *from, const struct look *to)
{
	const float *axes[3] = { from->frame.camera_right, from->frame.camera_up, from->frame.camera_forward };
	const bool zooms = to->frame.projection == PROJECTION_PERSPECTIVE;
	const double zoom = zooms ? (double)from->frame.tan_half_fov / (double)to->frame.tan_half_fov : 1;
	double moved[3];
	way(from, to, moved);
	for (int row = 0; row < 3; row++) {
		const double scale = row == 2 ? zoom : 1;
		double along = 0;
		for (int i = 0; i < 3; i++) {
			f->before.rows[row][i] = (float)(scale * (double)axes[row][i]);
			along += moved[i] * (double)axes[row][i];
		}
		f->before.rows[row][3] = (float)(scale * along);
	}
}

/* Is every ray of the one a ray of the other, to the same clouds in the same light? */
static bool is_still(const struct look *a, const struct look *b)
{
	const struct FrameBlock *x = &a->frame, *y = &b->frame;
	return memcmp(&a->clouds, &b->clouds, sizeof a->clouds) == 0 &&
	       memcmp(a->position_m, b->position_m, sizeof a->position_m) == 0 &&
	       memcmp(x->camera_right, y->camera_right, sizeof x->camera_right) == 0 &&
	       memcmp(x->camera_up, y->camera_up, sizeof x->camera_up) == 0 &&
	       memcmp(x->camera_forward, y->camera_forward, sizeof x->camera_forward) == 0 &&
	       memcmp(x->sun_direction, y->sun_direction, sizeof x->sun_direction) == 0 &&
	       fabs((double)x->tan_half_fov - (double)y->tan_half_fov) < 1e-9;
}

static bool follows(struct frame *f, const struct cloud_history *h, const struct look *look, char why[92])
{
	if (f->job.frame == 0)
		return !cut(why, "the first frame");
	if (!h)
		return !cut(why, "there is no room for the frame before");
	if (h->frame != f->job.frame - 1)
		return !cut(why, "the frame before is not kept any more");
	return !is_cut(&h->look, look, why);
}

void cloud_history_begin(struct workspace *ws, struct frame *f)
{
	static const char pass[] = "cloud-history";
	char why[92] = "";
	if (!f->cloud_reprojection.blocks)
		return;
	const struct look look = look_of(f);
	struct cloud_history *h = f->history = take(ws, f);
	f->reprojects = follows(f, h, &look, why);
	if (f->reprojects) {
		set_rows(f, &h->look, &look);
		marched_pixel(f->job.frame, f->before.pixel);
		f->before.pixel[2] = is_still(&h->look, &look);
	}
	if (h) {
		h->frame = -1; /* until all of it is there */
		h->look = look;
		h->marched[0] = h->marched[1] = 0;
	}
	if (f->reprojects)
		planner_note(&f->plan, pass, true, "15 of 16 pixels from frame %d", f->job.frame - 1);
	else
		planner_note(&f->plan, pass, false, "%s", why);
}

unsigned cloud_history_kept(const struct frame *f)
{
	return f->history->pixels[!f->history->latest].id;
}

void cloud_history_bind(const struct frame *f, struct pass *pass)
{
	const struct cloud_history *h = f->history;
	pass->storage[BIND_CLOUD_BEFORE] = h->pixels[h->latest].id;
	pass->storage[BIND_CLOUD_KEPT] = cloud_history_kept(f);
	pass->storage[BIND_CLOUD_LATTICE] = h->blocks.id;
	memcpy(pass->rows, f->before.rows, sizeof pass->rows);
	memcpy(pass->samples, f->before.pixel, sizeof f->before.pixel);
}

void cloud_history_next_blocks(const struct frame *f, const int tile[4], int blocks[4])
{
	int *marched = f->history->marched, end[2];
	const int size[2] = { f->job.request.image.width, f->job.request.image.height };
	for (int i = 0; i < 2; i++) {
		const int all = blocks_across(size[i]), needed = blocks_across(tile[i] + tile[i + 2]) + 1;
		end[i] = needed < all ? needed : all;
		blocks[i] = marched[i];
		blocks[i + 2] = end[i] > marched[i] ? end[i] - marched[i] : 0;
	}
	marched[0] = end[0];
	if (tile[0] + tile[2] == size[0]) {
		marched[0] = 0;
		marched[1] = end[1];
	}
}

void cloud_history_keep(struct frame *f)
{
	if (!f->history)
		return;
	f->history->latest = !f->history->latest;
	f->history->frame = f->job.frame;
}

void cloud_history_release(struct frame *f)
{
	if (f->history)
		f->history->busy = false;
	f->history = NULL;
}
