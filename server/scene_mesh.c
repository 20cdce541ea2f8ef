#include "server/scene_mesh.h"

#include "gpu/bending.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

struct scene_mesh *scene_mesh_create(int fd, const struct scene_about *about, struct error *err)
{
	struct scene_mesh *m = calloc(1, sizeof *m);
	struct stat st;
	if (!m || fstat(fd, &st)) {
		close(fd);
		free(m);
		error_set(err, "out of memory");
		return NULL;
	}
	*m = (struct scene_mesh){ .references = 1, .fd = fd, .bytes = (size_t)st.st_size, .about = *about };
	void *map = mmap(NULL, m->bytes, PROT_READ, MAP_SHARED, fd, 0);
	m->header = map == MAP_FAILED ? NULL : map;
	m->heights = m->header ? heights_create(m->header) : NULL;
	if (m->heights)
		return m;
	error_set(err, "no memory for the mesh");
	scene_mesh_unref(m);
	return NULL;
}

struct scene_mesh *scene_mesh_ref(struct scene_mesh *mesh)
{
	atomic_fetch_add(&mesh->references, 1);
	return mesh;
}

void scene_mesh_unref(struct scene_mesh *mesh)
{
	if (!mesh || atomic_fetch_sub(&mesh->references, 1) != 1)
		return;
	heights_destroy(mesh->heights);
	if (mesh->header)
		munmap((void *)mesh->header, mesh->bytes);
	close(mesh->fd);
	free(mesh);
}

const char *scene_mesh_key(const struct scene_mesh *mesh)
{
	return mesh->header->key;
}

const struct mesh_header *scene_mesh_header(const struct scene_mesh *mesh)
{
	return mesh->header;
}

int scene_mesh_fd(const struct scene_mesh *mesh)
{
	return mesh->fd;
}

size_t scene_mesh_bytes(const struct scene_mesh *mesh)
{
	return mesh->bytes;
}

/* ---- a request's scene ---- */

static bool said(const struct welkin_draft *draft, const char *name)
{
	return draft->given[welkin_field_find(name)];
}

/* A default that the scene brings: NaN where it says nothing. */
static void complete(struct welkin_draft *draft, const char *name, double *field, double value)
{
	if (said(draft, name) || isnan(value))
		return;
	draft->given[welkin_field_find(name)] = 1;
	*field = value;
}

void scenes_complete(const struct scene_mesh *mesh, struct welkin_draft *draft)
{
	struct welkin_request *r = &draft->request;
	const struct scene_about *a = &mesh->about;
	complete(draft, "scene.latitude_deg", &r->scene.latitude_deg, a->latitude_deg);
	complete(draft, "scene.longitude_deg", &r->scene.longitude_deg, a->longitude_deg);
	complete(draft, "scene.altitude_m", &r->scene.altitude_m, a->altitude_m);
	complete(draft, "scene.heading_deg", &r->scene.heading_deg, a->heading_deg);
	complete(draft, "scene.scale", &r->scene.scale, a->scale);
	/* An empty horizon half a planet away from what was asked for would help nobody. */
	complete(draft, "place.latitude_deg", &r->latitude_deg, a->latitude_deg);
	complete(draft, "place.longitude_deg", &r->longitude_deg, a->longitude_deg);
}

static bool same_height(double a, double b)
{
	return fabs(a - b) <= 1e-3 + 1e-6 * fmin(fabs(a), fabs(b));
}

static void check_weather_map(
	const struct scene_mesh *mesh, const struct welkin_request *r, struct welkin_faults *faults)
{
	if (r->clouds.weather_map == WELKIN_WEATHER_SCENE && mesh->header->weather_texture < 0)
		welkin_fault_add(faults, 422, "clouds.weather.map", "procedural, or a scene with a weather.png",
			"the scene %s has no weather.png", r->scene.name);
}

static void check_volumes(const struct scene_mesh *mesh, const struct welkin_request *r, struct welkin_faults *faults)
{
	const struct mesh_header *h = mesh->header;
	if (r->clouds.noise_volumes == WELKIN_VOLUMES_SCENE && h->base_volume < 0 && h->detail_volume < 0)
		welkin_fault_add(faults, 422, "clouds.noise.volumes",
			"procedural, or a scene with a noise_base or a noise_detail",
			"the scene %s has neither noise_base nor noise_detail", r->scene.name);
}

void scenes_resolve(const struct scene_mesh *mesh, const struct welkin_draft *draft, struct welkin_request *r,
	struct welkin_faults *faults)
{
	static const double standing_m = 1.7;
	const double radius = r->atmosphere.planet_radius_m;
	struct welkin_camera *camera = &r->camera;
	double ground = 0, flat[3], height_there;
	check_weather_map(mesh, r, faults);
	check_volumes(mesh, r, faults);
	bending_flatten(r, camera->position_m, flat);
	if (heights_at(mesh->heights, flat, &height_there))
		ground = height_there * r->scene.scale + r->scene.altitude_m;
	const bool height = said(draft, "camera.altitude_m") || said(draft, "camera.position_m");
	const bool above = said(draft, "camera.above_ground_m") || !height;
	const double wanted = said(draft, "camera.above_ground_m") ? draft->request.camera.above_ground_m : standing_m;
	if (!above) {
		camera->above_ground_m = camera->altitude_m - ground;
		return;
	}
	const double altitude = ground + wanted;
	camera->above_ground_m = wanted;
	if (said(draft, "camera.altitude_m") && !same_height(altitude, draft->request.camera.altitude_m))
		welkin_fault_add(faults, 422, "camera.above_ground_m", "one of the two, or both in agreement",
			"%.10g m contradicts camera.altitude_m: the ground is %.10g m high there", wanted, ground);
	else if (altitude < 0 || altitude > 1e8)
		welkin_fault_add(faults, 422, "camera.above_ground_m", "0 to 1e8 m above sea level in all",
			"%.10g m above ground that is %.10g m high is %.10g m above sea level", wanted, ground,
			altitude);
	else if (!same_height(altitude, camera->altitude_m)) {
		if (!welkin_set_altitude(camera->position_m, radius, altitude))
			welkin_fault_add(faults, 422, "camera.position_m", "x and z within the planet's radius",
				"nothing at that x and z is %.10g m above sea level", altitude);
		camera->altitude_m = altitude;
	}
}
