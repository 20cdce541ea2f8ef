/* The passes that put clouds in front of a strip's sky: the grey march, once, and its colours, batch by batch. */
#include "gpu/frame.h"

#include "gpu/clouds.h"

#include <stdio.h>
#include <string.h>

bool clouds_choose_programs(struct workspace *ws, struct frame *f, struct error *err)
{
	if (!(f->plan.features & FEATURE_CLOUDS) || f->method->progressive)
		return true;
	char choices[32];
	snprintf(choices, sizeof choices, "LIGHTING=%d", f->scene.clouds.lighting);
	return (f->clouds = programs_get(ws->programs, "clouds.comp", choices, err)) &&
	       (f->compose = programs_get(ws->programs, "cloud_compose.comp", "", err));
}

bool clouds_reserve(struct workspace *ws, const struct frame *f, int pixels, struct error *err)
{
	const size_t size = (size_t)pixels * 4 * sizeof(float);
	return !f->clouds || (workspace_reserve(&ws->cloud_light, size, false, err) &&
				     workspace_reserve(&ws->cloud_place, size, false, err));
}

void clouds_run(struct workspace *ws, const struct frame *f, const int tile[4], unsigned radiance,
	unsigned transmittance, unsigned directions)
{
	struct pass march = { .name = "clouds", .program = f->clouds, .threads = { tile[2] * tile[3], 1, 1 } };
	memcpy(march.tile, tile, sizeof march.tile);
	march.storage[BIND_DIRECTIONS] = directions;
	march.storage[BIND_CLOUD_LIGHT] = ws->cloud_light.id;
	march.storage[BIND_CLOUD_PLACE] = ws->cloud_place.id;
	passes_run(ws->passes, &march);

	struct pass compose = march;
	compose.name = "cloud-light";
	compose.program = f->compose;
	compose.storage[BIND_RADIANCE] = radiance;
	compose.storage[BIND_TRANSMITTANCE] = transmittance;
	const bool spectral = f->stage == FRAME_DIRECTIONS;
	const int first = spectral ? f->batch : 0, last = spectral ? f->batch : f->scene.n_batches - 1;
	for (compose.batch = first; compose.batch <= last; compose.batch++) {
		frame_tables(ws, f, compose.batch, NULL);
		passes_run(ws->passes, &compose);
	}
}
