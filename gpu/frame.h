#ifndef WELKIN_GPU_FRAME_H
#define WELKIN_GPU_FRAME_H

#include "gpu/exposure.h"
#include "gpu/job.h"
#include "gpu/method.h"
#include "gpu/planner.h"
#include "gpu/scenery.h"
#include "gpu/strips.h"
#include "gpu/workspace.h"

/*
 * A job on its way: prepared once, then worked on in slices of bounded time, each of which leaves
 * the device idle and the shared buffers free for another frame.
 *
 *     image:    METER (exposure.mode auto: a small image of the view) → STRIPS → DONE
 *     radiance: DIRECTIONS (batch by batch, a range of directions at a time) → DONE
 *     noise:    NOISE → DONE
 */
enum frame_stage { FRAME_METER, FRAME_STRIPS, FRAME_DIRECTIONS, FRAME_NOISE, FRAME_DONE };

/* Mean and squared deviations of samples (Welford). */
struct tally {
	double mean, m2;
};

struct frame {
	struct welkin_job job;
	const struct method *method;
	const struct program *rays, *sky, *plain, *disk, *output; /* plain: see choose_sky() */
	bool pinhole;                           /* kernels work the rays of plain pixels out themselves */
	const struct program *clouds, *compose; /* NULL without clouds */
	const struct program *kept_compose;     /* of a frame that follows another */
	struct scenery scenery;
	struct {
		const struct program *corners, *fill_lattice, *lattice, *fill_pixels, *pixels;
	} cloud_lattice; /* NULL where every pixel is marched */
	struct cloud_shade {
		const struct program *rays, *fill, *compose;
	} cloud_shade, kept_shade; /* NULL where it is worked out pixel by pixel; of a frame that follows another */
	struct {
		const struct program *blocks, *agreeing, *reproject, *pixels, *keep;
	} cloud_reprojection;          /* NULL where no frame comes before or after */
	bool begun;                    /* its first slice */
	struct cloud_history *history; /* cloud_history.h */
	bool reprojects;               /* its clouds come from the frame before; then: */
	struct {
		float rows[3][4]; /* as cloud_reproject.comp takes them */
		int pixel[4];     /* as cloud_history.glsl takes it */
	} before;
	enum frame_stage stage;
	struct strips strips;   /* METER, STRIPS */
	int batch, direction;   /* DIRECTIONS: what comes next */
	float (*samples)[4];    /* METER: as exposure_metered() takes them */
	int tile[4];            /* progressive: the strip in hand */
	int groups, check;      /* progressive: sample groups so far, and after how many to look at the error */
	double unit_started_ms; /* progressive: when the direction or the strip in hand was begun */
	struct tally *tally;    /* progressive: what the samples add up to */
	double error_sum;       /* progressive: relative variance of the pixels or values done so far, and how many */
	double error_count;
	int sun_box[4];     /* STRIPS: pixels that the disk may touch; empty without one */
	float white[4];     /* what a transmittance of 1 adds up to: linear Rec.709, luminance */
	unsigned char *map; /* the memfd */
	size_t map_size;
	double started_ms; /* clock_ms() */
	uint64_t order;    /* of arrival, from 1: whose tables may go for whose */
	double waits;      /* slices that others got since its last; the renderer's */
	int tables_noted;
	const struct mesh_header *mesh; /* of the request's scene, held while the frame lives; NULL: none */
	struct scene scene;
	struct plan plan;
	struct pass_log log;
	struct welkin_result result;
};

/* Checks the job, maps the memfd (which stays the caller's) and prepares. NULL with the reason. */
struct frame *frame_create(struct workspace *ws, const struct welkin_job *job, int memfd, struct error *err);
void frame_destroy(struct workspace *ws, struct frame *frame);

/* Works for about ws->slice_ms. A failure of this frame alone makes it DONE with result.status
 * failed; false means that the context is of no more use. */
bool frame_slice(struct workspace *ws, struct frame *frame, struct error *err);

/* Estimated device time until DONE. */
double frame_left_ms(struct workspace *ws, const struct frame *frame);

/* Makes it DONE with that status; message NULL: none. Fills in the times measured so far. */
void frame_finish(struct frame *frame, enum welkin_status status, const char *message);

/* ---- between frame.c, image.c and photometer.c ---- */

/* Pixels (or directions) that fit into what is left of a slice which began at start_ms. */
int frame_afford(struct workspace *ws, const struct frame *frame, int batches, double start_ms);
/* Waits for the passes run, adds their times to the frame's, and learns what the pixels cost. */
bool frame_settle(struct workspace *ws, struct frame *frame, int pixels, int batches, struct error *err);

/* Binds the method's tables, and the scene's, for a spectral batch. In a slice they are ready. */
enum table_state frame_tables(struct workspace *ws, const struct frame *frame, int batch, struct error *err);

/* One step each of the stages of their kind. */
bool image_start(struct workspace *ws, struct frame *frame, struct error *err);
bool image_step(struct workspace *ws, struct frame *frame, double start_ms, struct error *err);
bool photometer_step(struct workspace *ws, struct frame *frame, double start_ms, struct error *err);
/* Without clouds, or with a method that traces paths through them, these do nothing. */
bool clouds_choose_programs(struct workspace *ws, struct frame *frame, struct error *err);
bool clouds_reserve(struct workspace *ws, const struct frame *frame, int pixels, struct error *err);
/* The clouds of a tile, in front of what is there; on a bare range of directions for the batch in hand alone. */
void clouds_run(struct workspace *ws, const struct frame *frame, const int tile[4], unsigned radiance,
	unsigned transmittance, unsigned directions);
/* The passes of a tile up to its radiance; samples NULL but for progressive methods (LOCATION_SAMPLES). false: no
 * device memory for it. */
bool image_run_sky(struct workspace *ws, const struct frame *frame, const int tile[4], unsigned radiance,
	const int samples[4], struct error *err);
/* Goes on by that many directions of the batch in hand. */
void photometer_advance(struct frame *frame, int count);
/* Puts the job's directions on the device. */
bool photometer_bind(struct workspace *ws, const struct frame *frame, struct error *err);

#endif
