#include "server/frames.h"
#include "server/domain.h"

#include <stdio.h>
#include <string.h>

bool frames_request(const struct welkin_sequence *sequence, int frame, enum welkin_format format,
	const struct frames_limits *limits, const struct scene_mesh *mesh, struct welkin_request *request,
	struct welkin_faults *faults)
{
	struct welkin_draft draft, first;
	struct welkin_faults own = { 0 };
	welkin_sequence_draft(sequence, frame, &draft);
	welkin_sequence_draft(sequence, 0, &first);
	/* a scene is read while the call waits, which frames further on do not do */
	if (strcmp(draft.request.scene.name, first.request.scene.name) != 0)
		welkin_fault_add(&own, 422, "scene.name", "that of the first frame", "a sequence has one scene");
	domain_resolve(&draft, format, &limits->image, 0, mesh, request, &own);
	welkin_sequence_faults("frames", frame, &own, faults);
	return !own.n;
}

bool frames_check(const struct welkin_sequence *sequence, enum welkin_format format, const struct frames_limits *limits,
	const struct scene_mesh *mesh, struct welkin_faults *faults)
{
	struct welkin_request request;
	const int n = welkin_sequence_frames(sequence);
	for (int i = 0; i < n && faults->n < WELKIN_FAULTS_MAX; i++) {
		if (!frames_request(sequence, i, format, limits, mesh, &request, faults) || i)
			continue;
		/* All are of the same size. */
		const double pixels = (double)request.image.width * request.image.height * n;
		char allowed[64];
		snprintf(allowed, sizeof allowed, "at most %.0f pixels", limits->pixels);
		if (pixels > limits->pixels)
			welkin_fault_add(faults, 422, "", allowed, "%d frames of %d x %d are %.0f pixels", n,
				request.image.width, request.image.height, pixels);
	}
	return !faults->n;
}
