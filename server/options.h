#ifndef WELKIN_SERVER_OPTIONS_H
#define WELKIN_SERVER_OPTIONS_H

#include "api/error.h"

#include <stdio.h>

/* What `welkin serve` can be told. One table (options.c) drives the command line (--max-pixels 1e6),
 * the environment (WELKIN_MAX_PIXELS), the configuration file (max-pixels = 1e6), --help and
 * --print-config. The command line wins over the environment, that over the file, that over the
 * default. */
struct options {
	char listen[128], admin[128];
	char config[512];
	char device[64];
	char shader_dir[512];
	char method_dir[512];
	char scene_dir[512];
	char renderer[512]; /* program to start as the renderer process; "" for this one */
	char log_level[16];
	double max_pixels;
	double deadline_s, watchdog_s, drain_s;
	double header_deadline_s, body_deadline_s, idle_deadline_s, reply_deadline_s;
	double slice_ms, probe_s;
	int queue, cache_mib, table_mib, encoders, in_flight;
	int max_connections, max_body_kib;
	int scene_mib, scene_triangles, scene_texture, scene_file_mib, loader_mib, uploads, upload_mib;
	double loader_s;
	int max_sequences, max_frames;
	double max_sequence_pixels;

	bool print_config, help; /* flags of the command line only */
	const char *origin[40];  /* per row of the table: "default", "file", "environment", "command line" */
};

/* Reads everything. argv holds what follows `serve`. false with one clear line in err. */
bool options_load(struct options *options, int argc, char **argv, struct error *err);

void options_print(const struct options *options, FILE *out);
void options_help(FILE *out);

#endif
