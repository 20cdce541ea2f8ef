#include "gpu/open_sky.h"

#include <epoxy/gl.h>
#include <stdlib.h>

enum { VERTICES_PER_SLICE = 4096, VERTICES_IN_FULL = 1 << 18, STRIDE_MOST = 4 };

/* Of how many directions each vertex looks into one: rays of all for a million vertices would take a minute. */
static uint32_t stride_of(const struct surfaces *s)
{
	const uint32_t stride = (s->n_vertices - 1) / VERTICES_IN_FULL + 1;
	return stride < STRIDE_MOST ? stride : STRIDE_MOST;
}

bool open_sky_smooth(float *open, uint32_t n_vertices, const uint32_t *corners, uint32_t n_triangles)
{
	enum { OWN = 3 }; /* neighbours of a vertex of a grid count 12 together, those that look the same way 0 or 4 */
	struct sum {
		float open, weight;
	} *sums = calloc(n_vertices, sizeof *sums);
	if (!sums)
		return false;
	for (uint32_t i = 0; i < 3 * n_triangles; i++) {
		const uint32_t first = i - i % 3, a = corners[first + (i + 1) % 3], b = corners[first + (i + 2) % 3];
		sums[corners[i]].open += open[a] + open[b];
		sums[corners[i]].weight += 2;
	}
	for (uint32_t i = 0; i < n_vertices; i++)
		open[i] = (OWN * open[i] + sums[i].open) / (OWN + sums[i].weight);
	free(sums);
	return true;
}

static bool smooth(struct surfaces *s, const struct mesh_header *mesh, struct error *err)
{
	const GLsizeiptr size = (GLsizeiptr)(s->n_vertices * sizeof(float));
	float *open = malloc((size_t)size);
	if (open)
		glGetNamedBufferSubData(s->ambient, 0, size, open);
	const bool ok = open && open_sky_smooth(open, s->n_vertices, mesh_indices(mesh), mesh->n_indices / 3);
	if (ok)
		glNamedBufferSubData(s->ambient, 0, size, open);
	free(open);
	return ok || error_set(err, "out of memory");
}

enum table_state open_sky_need(struct passes *passes, struct programs *programs, struct surfaces *s,
	const struct mesh_header *mesh, struct error *err)
{
	const uint32_t left = s->n_vertices - s->ambient_done,
		       n = left < VERTICES_PER_SLICE ? left : VERTICES_PER_SLICE, stride = stride_of(s);
	if (n == 0 || s->n_triangles == 0)
		return TABLE_READY;
	struct pass pass = { .name = "open-sky",
		.program = programs_get(programs, "surfaces_ambient.comp", "", err),
		.tile = { (int)s->ambient_done, 0, (int)n, (int)stride },
		.threads = { (int)((n + stride - 1) / stride * stride), 1, 1 } };
	if (!pass.program)
		return TABLE_FAILED;
	surfaces_bind(s, passes, pass.storage);
	passes_run(passes, &pass);
	if (n == left && stride > 1 && !smooth(s, mesh, err))
		return TABLE_FAILED;
	s->ambient_done += n;
	return TABLE_BUILDING;
}
