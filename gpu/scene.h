#ifndef WELKIN_GPU_SCENE_H
#define WELKIN_GPU_SCENE_H

#include "api/error.h"
#include "gpu/job.h"
#include "shaders/shared.h"

enum { SCENE_MAX_BATCHES = WELKIN_MAX_WAVELENGTHS / 4, SCENE_MAX_NODES = 4096 };

/* A request turned into what kernels read: blocks, batches of four bands, quadrature nodes.
 * Pure CPU work, no GL, so tests and tools use it too. */
struct scene {
	struct FrameBlock frame; /* features, exposure_scale and output_format are the planner's */
	struct MediaBlock media;
	struct CloudsBlock clouds;
	const struct mesh_header *painted; /* whose files clouds.painted_parts are from; NULL: all is procedural */
	const struct cast_shadow *cast;    /* what shades clouds; cloud_light.h; NULL: nothing does */
	int n_bands;                       /* real wavelengths; the last batch is padded with copies */
	int n_batches;
	struct BandsBlock batches[SCENE_MAX_BATCHES];
	struct FittedBlock fitted[SCENE_MAX_BATCHES]; /* the method's prepare() fills it in */
	struct SurfacesBlock surfaces;                /* surfaces.h fills it in, for a frame with a scene */
	float method_values[METHOD_VALUES];           /* MethodBlock: parameters of an operator's method */
	int n_nodes;
	float nodes[SCENE_MAX_NODES][2]; /* Gauss-Legendre: position in [0,1], weight (sum 1) */
};

/* Image: wavelengths_nm NULL, bands and the matrix to Rec.709 by request->atmosphere.spectrum.
 * Radiance: the n wavelengths, matrix rows zero. Never fails for a resolved request. */
void scene_prepare(struct scene *scene, const struct welkin_request *request, const double *wavelengths_nm, int n);

#endif
