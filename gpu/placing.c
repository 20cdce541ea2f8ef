#include "gpu/placing.h"

#include <math.h>
#include <string.h>

static double radians(double degrees)
{
	return degrees * (M_PI / 180.0);
}

struct placing placing_of(const struct welkin_request *request)
{
	const struct welkin_scene *scene = &request->scene;
	return (struct placing){ scene->latitude_deg, scene->longitude_deg, scene->altitude_m, scene->heading_deg,
		scene->scale };
}

/* East, up and south at a place, in a frame of the planet. */
static void local_axes(double latitude_deg, double longitude_deg, double axes[3][3])
{
	const double lat = radians(latitude_deg), lon = radians(longitude_deg);
	const double east[3] = { -sin(lon), cos(lon), 0 };
	const double up[3] = { cos(lat) * cos(lon), cos(lat) * sin(lon), sin(lat) };
	const double south[3] = { sin(lat) * cos(lon), sin(lat) * sin(lon), -cos(lat) };
	memcpy(axes[0], east, sizeof east);
	memcpy(axes[1], up, sizeof up);
	memcpy(axes[2], south, sizeof south);
}

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

struct mesh_frame mesh_frame_of(const struct welkin_request *request)
{
	const struct welkin_scene *scene = &request->scene;
	const double heading = radians(scene->heading_deg), c = cos(heading), s = sin(heading);
	double world[3][3], there[3][3], turned[3][3];
	local_axes(request->latitude_deg, request->longitude_deg, world);
	local_axes(scene->latitude_deg, scene->longitude_deg, there);
	for (int k = 0; k < 3; k++) {
		turned[0][k] = c * there[0][k] + s * there[2][k];
		turned[1][k] = there[1][k];
		turned[2][k] = c * there[2][k] - s * there[0][k];
	}
	struct mesh_frame frame;
	for (int axis = 0; axis < 3; axis++)
		for (int k = 0; k < 3; k++)
			frame.axes[axis][k] = dot(turned[axis], world[k]);
	const double away[3] = { there[1][0] - world[1][0], there[1][1] - world[1][1], there[1][2] - world[1][2] };
	for (int k = 0; k < 3; k++)
		frame.origin[k] = request->atmosphere.planet_radius_m * dot(away, world[k]);
	return frame;
}

void mesh_frame_turn(const struct mesh_frame *frame, const double world[3], double mesh[3])
{
	for (int axis = 0; axis < 3; axis++)
		mesh[axis] = dot(frame->axes[axis], world);
}

void mesh_frame_from_world(const struct mesh_frame *frame, const double world[3], double mesh[3])
{
	const double offset[3] = { world[0] - frame->origin[0], world[1] - frame->origin[1],
		world[2] - frame->origin[2] };
	mesh_frame_turn(frame, offset, mesh);
}

void placing_bend(
	const struct placing *placing, double planet_radius_m, const struct mesh_vertex *from, struct mesh_vertex *to)
{
	const double R = planet_radius_m, x = (double)from->position[0] * placing->scale,
		     z = (double)from->position[2] * placing->scale;
	const double h = (double)from->position[1] * placing->scale + placing->altitude_m, s = hypot(x, z);
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

double placing_sphere(const struct mesh_header *mesh, const struct welkin_request *request, double center[3])
{
	const struct placing placing = placing_of(request);
	const struct mesh_frame frame = mesh_frame_of(request);
	const double R = request->atmosphere.planet_radius_m;
	struct mesh_vertex middle = { { 0 }, { 0, 1, 0 }, { 0 } }, bent;
	double half = 0, reach = 0;
	for (int k = 0; k < 3; k++) {
		const double low = (double)mesh->low[k], high = (double)mesh->high[k];
		middle.position[k] = (float)((low + high) / 2);
		half += pow((high - low) / 2, 2);
		reach += pow(fmax(fabs(low), fabs(high)), 2);
	}
	placing_bend(&placing, R, &middle, &bent);
	for (int k = 0; k < 3; k++) {
		center[k] = frame.origin[k];
		for (int axis = 0; axis < 3; axis++)
			center[k] += frame.axes[axis][k] * (double)bent.position[axis];
	}
	/* bending moves a point at arc length s by less than s²/R, and twice the planet at most */
	reach = fmin(sqrt(reach) * placing.scale, 2 * R);
	return sqrt(half) * placing.scale * (1 + reach / R) + reach * reach / R + 1;
}
