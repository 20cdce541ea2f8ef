#include "gpu/placing.h"

#include <math.h>

/* East, north and up at one point of the sphere, each as east, north and up of another. Written with half angles, so
 * that metres survive beside the planet's radius. */
struct horizon {
	double east[3], north[3], up[3];
	double drop; /* 1 − up[2] */
};

static double squared(double x)
{
	return x * x;
}

static struct horizon horizon_seen(double latitude, double longitude, double from_latitude, double from_longitude)
{
	const double along = longitude - from_longitude, up = latitude - from_latitude;
	const double s0 = sin(from_latitude), c0 = cos(from_latitude), c1 = cos(latitude);
	const double half = squared(sin(along / 2)), drop = 2 * (squared(sin(up / 2)) + c0 * c1 * half);
	struct horizon h = {
		.east = { cos(along), s0 * sin(along), -c0 * sin(along) },
		.up = { c1 * sin(along), sin(up) + 2 * s0 * c1 * half, 1 - drop },
		.drop = drop,
	};
	/* north = up × east */
	for (int i = 0; i < 3; i++) {
		const int j = (i + 1) % 3, k = (i + 2) % 3;
		h.north[i] = h.up[j] * h.east[k] - h.up[k] * h.east[j];
	}
	return h;
}

/* From east, north, up to the world frame's x, y, z. */
static void set_axis(double axis[3], const double enu[3], double sign)
{
	axis[0] = sign * enu[0];
	axis[1] = sign * enu[2];
	axis[2] = -sign * enu[1];
}

struct placing placing_of(const struct welkin_request *request)
{
	const struct welkin_scene *scene = &request->scene;
	const double deg = M_PI / 180, radius = request->atmosphere.planet_radius_m;
	const struct horizon h = horizon_seen(scene->latitude_deg * deg, scene->longitude_deg * deg,
		request->latitude_deg * deg, request->longitude_deg * deg);
	const double c = cos(scene->heading_deg * deg), s = sin(scene->heading_deg * deg);
	struct placing p = { .scale = scene->scale };
	double right[3], ahead[3];
	for (int i = 0; i < 3; i++) {
		right[i] = c * h.east[i] - s * h.north[i];
		ahead[i] = c * h.north[i] + s * h.east[i];
	}
	set_axis(p.axes[0], right, 1);
	set_axis(p.axes[1], h.up, 1);
	set_axis(p.axes[2], ahead, -1);
	for (int i = 0; i < 3; i++)
		p.origin[i] = p.axes[1][i] * (radius + scene->altitude_m);
	p.origin[1] = scene->altitude_m * h.up[2] - radius * h.drop;
	return p;
}

void placing_to_world(const struct placing *p, const double local[3], double world[3])
{
	for (int i = 0; i < 3; i++)
		world[i] = p->origin[i] +
			   p->scale * (p->axes[0][i] * local[0] + p->axes[1][i] * local[1] + p->axes[2][i] * local[2]);
}

void placing_to_local(const struct placing *p, const double world[3], double local[3])
{
	const double from[3] = { world[0] - p->origin[0], world[1] - p->origin[1], world[2] - p->origin[2] };
	for (int i = 0; i < 3; i++)
		local[i] = (p->axes[i][0] * from[0] + p->axes[i][1] * from[1] + p->axes[i][2] * from[2]) / p->scale;
}
