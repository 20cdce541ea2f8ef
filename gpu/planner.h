#ifndef WELKIN_GPU_PLANNER_H
#define WELKIN_GPU_PLANNER_H

#include "gpu/job.h"
#include "gpu/mesh.h"
#include "gpu/method.h"
#include "gpu/scene.h"

/*
 * Which passes a frame needs: one that can't change a pixel is left out, and the reply says why.
 * Pure CPU work on the prepared scene.
 */
struct plan {
	int features;  /* FEATURE_ bits for the frame block */
	bool epipolar; /* FEATURE_SHAFTS: by epipolar sampling */
	bool meter;    /* the exposure has to be measured on the view */
	int n;
	struct welkin_plan_entry entries[WELKIN_MAX_PASSES];
};

/* mesh: the job's scene; NULL: none. */
void planner_plan(struct plan *plan, const struct welkin_job *job, const struct scene *scene,
	const struct method *method, const struct mesh_header *mesh);

/* Adds an entry; more than fit are dropped. */
__attribute__((format(printf, 4, 5))) void planner_note(
	struct plan *plan, const char *pass, bool ran, const char *why, ...);

#endif
