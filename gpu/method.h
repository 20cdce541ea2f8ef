#ifndef WELKIN_GPU_METHOD_H
#define WELKIN_GPU_METHOD_H

#include "api/api.h"
#include "api/error.h"
#include "api/request.h"

#include <stddef.h>

/*
 * A way to compute the clear sky. Each gpu/methods/NAME.c defines `const struct method
 * method_NAME`; the registry is generated from the folder, sorted by name, and
 * request.atmosphere.method is an index into it. The shader of the same name,
 * shaders/methods/NAME.comp, defines `void method_sky(Ray ray, out vec4 L, out vec4 T)` (see
 * shaders/sky.glsl) and gets pixels, directions, bands, ground, sun disk and output for nothing.
 *
 * The first part is plain data that any process may read; the functions run in the renderer only.
 */

enum table_state { TABLE_FAILED, TABLE_WAITING, TABLE_BUILDING, TABLE_READY };

struct frame_tables; /* tables.h */
struct scene;        /* scene.h */

struct method_range {
	const char *field; /* dotted request field */
	double min, max;   /* inclusive */
	const char *why;   /* what fails outside */
};

struct method {
	const char *name;
	const char *summary;               /* one line */
	const char *source;                /* paper or origin */
	const char *const *fields;         /* fields it reads beyond camera and sun, NULL-terminated */
	const struct method_range *domain; /* terminated by field == NULL */
	int single_scattering;             /* 1: orders above the first are left out by nature */
	int progressive;                   /* 1: its kernel gives random samples, repeated until their error suffices */
	int slow_tables; /* 1: its tables take seconds, so they are not built before somebody asks for it */
	int physical;    /* 1: uses the media coefficients; 0: an analytic sky */
	/* Adds to a prepared scene what its kernel alone needs (NULL: nothing). */
	void (*prepare)(struct scene *scene, const struct welkin_request *request);
	/* Makes sure that the tables it reads for a spectral batch exist and are bound (NULL: it reads
	 * none). Building: work was dispatched, call again once it is done; waiting: for another frame. */
	enum table_state (*tables)(
		struct frame_tables *tables, const struct scene *scene, int batch, struct error *err);
	/* An operator's method: which of request.method_values are its parameters, in the order of its MethodBlock. */
	int operators; /* 1: from a file of the operator's, see operator_methods.h; 0: built in */
	int first_value, n_values;
};

/* Generated, NULL-terminated; the operator's methods are added once, before a process starts threads. */
extern const struct method *welkin_methods[WELKIN_METHODS_MAX + 1];
extern int welkin_method_count;

#endif
