#ifndef WELKIN_SERVER_METRICS_H
#define WELKIN_SERVER_METRICS_H

#include "api/text.h"
#include "gpu/job.h"

#include <stdbool.h>
#include <sys/types.h>

/* Counters of the process, for /metrics. Any thread; nothing here blocks. */

enum metrics_resource {
	RESOURCE_RENDER_PNG,
	RESOURCE_RENDER_EXR,
	RESOURCE_RENDER_POST,
	RESOURCE_SEQUENCES,
	RESOURCE_RADIANCE,
	RESOURCE_NOISE,
	RESOURCE_METHODS,
	RESOURCE_PRESETS,
	RESOURCE_SCENES,
	RESOURCE_VERSION,
	RESOURCE_OPENAPI,
	RESOURCE_PAGE,
	RESOURCE_OTHER,
	RESOURCE_COUNT,
};

enum metrics_stage { STAGE_QUEUE, STAGE_RENDER, STAGE_ENCODE, STAGE_TOTAL, STAGE_COUNT };

void metrics_count_reply(enum metrics_resource resource, int status);
void metrics_observe(enum metrics_stage stage, double seconds);
void metrics_add_pixels(double pixels);
void metrics_count_restart(void);
void metrics_count_cancelled(void);
void metrics_count_reaped(void);
void metrics_connections(int change);
void metrics_sequences(int change); /* under way */
void metrics_count_frame(void);     /* of a sequence, on its way to the client */
void metrics_count_sequence(bool complete);
void metrics_requests(int change); /* in flight */

/* What only others know at the moment of asking. */
struct metrics_gauges {
	int queue_depth, renders_in_flight;
	size_t cache_bytes, cache_entries;
	unsigned long long cache_hits, cache_misses;
	size_t scene_bytes, scene_meshes;
	unsigned long long scene_loads, scene_faults;
	bool ready;
	struct welkin_device device;
	pid_t renderer_pid; /* 0: none */
};

/* Prometheus text format 0.0.4. */
void metrics_text(const struct metrics_gauges *gauges, struct text *text);

/* Resident bytes of a process, 0 when it is gone. */
double metrics_resident_bytes(pid_t pid);

#endif
