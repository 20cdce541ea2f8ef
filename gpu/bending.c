#include "gpu/bending.h"

#include <math.h>
#include <string.h>

struct bending bending_of(const struct welkin_request *request)
{
	return (struct bending){ request->atmosphere.planet_radius_m, request->scene.altitude_m, request->scene.scale };
}

/* On the ground sphere, below the placed mesh's origin. */
static void origin_of(const struct placing *placing, double altitude_m, double origin[3])
{
	for (int k = 0; k < 3; k++)
		origin[k] = placing->origin[k] - altitude_m * placing->axes[1][k];
}

void bending_turn(const struct placing *placing, const double world[3], double mesh[3])
{
	for (int axis = 0; axis < 3; axis++)
		mesh[axis] = placing->axes[axis][0] * world[0] + placing->axes[axis][1] * world[1] +
			     placing->axes[axis][2] * world[2];
}

void bending_from_world(const struct welkin_request *request, const double world[3], double mesh[3])
{
	const struct placing placing = placing_of(request);
	double offset[3];
	origin_of(&placing, request->scene.altitude_m, offset);
	for (int k = 0; k < 3; k++)
		offset[k] = world[k] - offset[k];
	bending_turn(&placing, offset, mesh);
}

void bending_vertex(const struct bending *b, const struct mesh_vertex *from, struct mesh_vertex *to)
{
	const double R = b->planet_radius_m, x = (double)from->position[0] * b->scale,
		     z = (double)from->position[2] * b->scale;
	const double h = (double)from->position[1] * b->scale + b->altitude_m, s = hypot(x, z);
	const double a = fmin(s / R, M_PI), half = sin(a / 2), east = s > 0 ? x / s : 0, south = s > 0 ? z / s : 0;
	to->position[0] = (float)((R + h) * sin(a) * east);
	to->position[1] = (float)(h * cos(a) - 2 * R * half * half);
	to->position[2] = (float)((R + h) * sin(a) * south);
	const double n[3] = { (double)from->normal[0], (double)from->normal[1], (double)from->normal[2] };
	const double along = n[0] * east + n[2] * south;
	const double turned = along * cos(a) + n[1] * sin(a) - along; /* what the turn adds along the arc */
	to->normal[0] = (float)(n[0] + turned * east);
	to->normal[1] = (float)(n[1] * cos(a) - along * sin(a));
	to->normal[2] = (float)(n[2] + turned * south);
	memcpy(to->uv, from->uv, sizeof to->uv);
}

void bending_flatten(const struct welkin_request *request, const double world[3], double flat[3])
{
	const struct bending b = bending_of(request);
	const double R = b.planet_radius_m;
	double p[3];
	bending_from_world(request, world, p);
	const double across = hypot(p[0], p[2]), r = hypot(across, p[1] + R);
	const double arc = R * atan2(across, p[1] + R), scale = across > 0 ? arc / across / b.scale : 0;
	/* r - R, without the digits that both share */
	const double h = (across * across + p[1] * (p[1] + 2 * R)) / (r + R);
	flat[0] = p[0] * scale;
	flat[1] = (h - b.altitude_m) / b.scale;
	flat[2] = p[2] * scale;
}

double bending_sphere(const struct mesh_header *mesh, const struct welkin_request *request, double center[3])
{
	const struct bending bending = bending_of(request);
	const struct placing placing = placing_of(request);
	const double R = bending.planet_radius_m;
	struct mesh_vertex middle = { { 0 }, { 0, 1, 0 }, { 0 } }, bent;
	double half = 0, reach = 0, origin[3];
	for (int k = 0; k < 3; k++) {
		const double low = (double)mesh->low[k], high = (double)mesh->high[k];
		middle.position[k] = (float)((low + high) / 2);
		half += pow((high - low) / 2, 2);
		reach += pow(fmax(fabs(low), fabs(high)), 2);
	}
	bending_vertex(&bending, &middle, &bent);
	origin_of(&placing, request->scene.altitude_m, origin);
	for (int k = 0; k < 3; k++) {
		center[k] = origin[k];
		for (int axis = 0; axis < 3; axis++)
			center[k] += placing.axes[axis][k] * (double)bent.position[axis];
	}
	/* bending moves a point at arc length s by less than s²/R, and twice the planet at most */
	reach = fmin(sqrt(reach) * placing.scale, 2 * R);
	return sqrt(half) * placing.scale * (1 + reach / R) + reach * reach / R + 1;
}
