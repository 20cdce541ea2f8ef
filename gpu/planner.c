#include "gpu/planner.h"

#include "gpu/bending.h"
#include "gpu/choose.h"
#include "gpu/clouds.h"
#include "gpu/shafts.h"
#include "gpu/view.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

_Static_assert(PROJECTION_PERSPECTIVE == WELKIN_PERSPECTIVE && PROJECTION_EQUIRECTANGULAR == WELKIN_EQUIRECTANGULAR &&
		       PROJECTION_FISHEYE == WELKIN_FISHEYE && PROJECTION_CUBE_FACE == WELKIN_CUBE_FACE &&
		       PROJECTION_CUBEMAP == WELKIN_CUBEMAP,
	"projections of shaders/shared.h follow api/request.h");
_Static_assert(FACE_FRONT == WELKIN_FRONT && FACE_RIGHT == WELKIN_RIGHT && FACE_BACK == WELKIN_BACK &&
		       FACE_LEFT == WELKIN_LEFT && FACE_UP == WELKIN_UP && FACE_DOWN == WELKIN_DOWN,
	"cube faces of shaders/shared.h follow api/request.h");
_Static_assert(TONE_AGX == WELKIN_TONE_AGX && TONE_ACES == WELKIN_TONE_ACES && TONE_REINHARD == WELKIN_TONE_REINHARD &&
		       TONE_EXPONENTIAL == WELKIN_TONE_EXPONENTIAL && TONE_NONE == WELKIN_TONE_NONE,
	"tone maps of shaders/shared.h follow api/request.h");
_Static_assert(PHASE_CORNETTE_SHANKS == WELKIN_CORNETTE_SHANKS && PHASE_HENYEY_GREENSTEIN == WELKIN_HENYEY_GREENSTEIN &&
		       PHASE_SCHLICK == WELKIN_SCHLICK,
	"phase functions of shaders/shared.h follow api/request.h");

/* Angles are compared with this much to spare (rad), which covers float directions in kernels. */
static const double margin = 1e-3;

void planner_note(struct plan *plan, const char *pass, bool ran, const char *why, ...)
{
	if (plan->n == WELKIN_MAX_PASSES)
		return;
	struct welkin_plan_entry *entry = &plan->entries[plan->n++];
	memset(entry, 0, sizeof *entry);
	snprintf(entry->pass, sizeof entry->pass, "%s", pass);
	entry->ran = ran;
	va_list args;
	va_start(args, why);
	vsnprintf(entry->why, sizeof entry->why, why, args);
	va_end(args);
}

/* Half the angle under which the planet is seen from the camera. */
static double planet_half_angle(const struct scene *scene)
{
	const double R = scene->media.planet_radius, h = scene->frame.camera_altitude;
	return asin(R / (R + h));
}

static void plan_sun_disk(struct plan *plan, const struct welkin_request *request, const struct scene *scene,
	const struct view_cone *view)
{
	static const char pass[] = "sun-disk";
	const struct FrameBlock *frame = &scene->frame;
	double nadir[3];
	for (int i = 0; i < 3; i++)
		nadir[i] = -(double)frame->vertical[i];
	if (!request->sun.disk)
		planner_note(plan, pass, false, "not asked for");
	else if (view_angle(view->axis, frame->sun_direction) >
		 view->half_angle + (double)frame->sun_angular_radius + margin)
		planner_note(plan, pass, false, "the sun is out of view");
	else if (view_angle(nadir, frame->sun_direction) + (double)frame->sun_angular_radius + margin <
		 planet_half_angle(scene))
		planner_note(plan, pass, false, "the sun is below the horizon");
	else {
		plan->features |= FEATURE_SUN_DISK;
		planner_note(plan, pass, true, "the sun is in view");
	}
}

static void plan_ground(struct plan *plan, const struct scene *scene, const struct view_cone *view)
{
	const double up = view_angle(view->axis, scene->frame.vertical);
	if (M_PI - up > view->half_angle + planet_half_angle(scene) + margin) {
		planner_note(plan, "ground", false, "no direction of the view meets it");
		return;
	}
	plan->features |= FEATURE_GROUND;
	planner_note(plan, "ground", true, "the view may meet it");
}

static void plan_clouds(struct plan *plan, const struct welkin_request *request, const struct method *method)
{
	const struct welkin_clouds *clouds = &request->clouds;
	if (!clouds_present(clouds)) {
		planner_note(plan, "clouds", false, "their coverage is 0");
	} else {
		plan->features |= FEATURE_CLOUDS;
		if (method->physical && !method->single_scattering)
			plan->features |= FEATURE_SKY_ON_GROUND;
		planner_note(plan, "clouds", true, method->progressive ? "in the path tracer" : "%d steps at most",
			clouds->steps);
	}
}

static void plan_output(struct plan *plan, const struct welkin_request *request)
{
	const struct welkin_image *image = &request->image;
	const bool png = image->format == WELKIN_PNG;
	if (request->exposure_mode == WELKIN_EXPOSURE_AUTO) {
		plan->meter = true;
		planner_note(plan, "meter", true, "exposure.mode auto measures the view");
	} else {
		planner_note(plan, "meter", false, "the exposure is given by exposure.mode");
	}
	if (!png)
		planner_note(plan, "tone-map", false, "EXR keeps linear light");
	else if (request->tone_map == WELKIN_TONE_NONE)
		planner_note(plan, "tone-map", false, "tone.map none");
	else
		planner_note(plan, "tone-map", true, "PNG is for displays");
	if (!png || !image->dither)
		planner_note(plan, "dither", false, png ? "not asked for" : "EXR is not quantised");
	else
		planner_note(plan, "dither", true, "%d-bit steps would show as bands", image->png_bits);
	if (png || image->layers == 0)
		planner_note(plan, "layers", false, png ? "PNG has none" : "not asked for");
	else {
		plan->features |= FEATURE_LAYERS;
		planner_note(plan, "layers", true, "asked for");
	}
}

/* Is the sun up for the highest point of a mesh whose surfaces are in the plan? */
static bool sun_reaches(const struct welkin_job *job, const struct mesh_header *mesh)
{
	const struct welkin_request *r = &job->request;
	const double R = r->atmosphere.planet_radius_m;
	double center[3];
	const double radius = bending_sphere(mesh, r, center);
	const double up[3] = { center[0], center[1] + R, center[2] },
		     from = sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]);
	const double high = fmax((double)mesh->high[1] * r->scene.scale + r->scene.altitude_m, 0);
	const double elevation = r->sun.elevation_deg * (M_PI / 180), azimuth = r->sun.azimuth_deg * (M_PI / 180);
	const double sun[3] = { sin(azimuth) * cos(elevation), sin(elevation), -cos(azimuth) * cos(elevation) };
	const double sine = (sun[0] * up[0] + sun[1] * up[1] + sun[2] * up[2]) / from;
	return asin(sine) > -acos(R / (R + high)) - radius / from - margin;
}

static void plan_shadows(struct plan *plan, const struct welkin_job *job, const struct mesh_header *mesh)
{
	static const char pass[] = "shadow-map", *const filters[] = { "one comparison", "bilinear", "gaussian",
		"variance", "by the sun's size" };
	if (job->request.scene.shadow == WELKIN_SHADOW_OFF)
		planner_note(plan, pass, false, "not asked for");
	else if (!sun_reaches(job, mesh))
		planner_note(plan, pass, false, "the sun is below every point's horizon");
	else {
		plan->features |= FEATURE_SHADOWS;
		planner_note(plan, pass, true, "the sun is up, filter %s", filters[job->request.scene.shadow]);
	}
}

static void plan_shafts(struct plan *plan, const struct welkin_job *job)
{
	static const char pass[] = "shafts";
	const struct welkin_scene *scene = &job->request.scene;
	const struct welkin_image *image = &job->request.image;
	const double pixels = job->kind == WELKIN_JOB_IMAGE ? (double)image->width * image->height : job->n_directions;
	if (!(plan->features & FEATURE_SHADOWS))
		planner_note(plan, pass, false, "there is no shadow map");
	else if (scene->shafts == WELKIN_SHAFTS_NONE)
		planner_note(plan, pass, false, "not asked for");
	else {
		plan->features |= FEATURE_SHAFTS;
		plan->epipolar =
			scene->shafts == WELKIN_SHAFTS_EPIPOLAR ||
			(scene->shafts == WELKIN_SHAFTS_AUTO && shafts_epipolar_pays(scene->shaft_steps, pixels));
		if (plan->epipolar)
			planner_note(plan, pass, true, "epipolar, %d planes", SHAFT_PLANES);
		else
			planner_note(plan, pass, true, "%d steps on every ray", scene->shaft_steps);
	}
}

/* Lets the scene in where the view may see it. */
static void plan_surfaces(struct plan *plan, const struct welkin_job *job, const struct mesh_header *mesh,
	const struct method *method, const struct view_cone *view)
{
	static const char pass[] = "surfaces";
	if (!mesh)
		return;
	double center[3], distance = 0;
	const double radius = bending_sphere(mesh, &job->request, center);
	for (int k = 0; k < 3; k++) {
		center[k] -= job->request.camera.position_m[k];
		distance += center[k] * center[k];
	}
	distance = sqrt(distance);
	const float towards[3] = { (float)(center[0] / distance), (float)(center[1] / distance),
		(float)(center[2] / distance) };
	if (mesh->n_indices == 0)
		planner_note(plan, pass, false, "the scene has no triangles");
	else if (distance > radius &&
		 view_angle(view->axis, towards) > view->half_angle + asin(radius / distance) + margin)
		planner_note(plan, pass, false, "the scene is out of view");
	else {
		plan->features |= method->progressive ? FEATURE_TRACED : FEATURE_SURFACES;
		planner_note(plan, pass, true, "%u triangles%s", mesh->n_indices / 3,
			method->progressive ? ", met by paths" : "");
		if (!method->progressive) {
			plan_shadows(plan, job, mesh);
			plan_shafts(plan, job);
		}
	}
}

void planner_plan(struct plan *plan, const struct welkin_job *job, const struct scene *scene,
	const struct method *method, const struct mesh_header *mesh)
{
	memset(plan, 0, sizeof *plan);
	planner_note(plan, "sky", true, "method %s, %d wavelengths in %d %s", method->name, scene->n_bands,
		scene->n_batches, scene->n_batches == 1 ? "batch" : "batches");
	if (*choose_reason(&job->request))
		planner_note(plan, "method", true, "auto: %s", choose_reason(&job->request));
	if (!method->tables)
		planner_note(plan, "tables", false, "method %s reads none", method->name);
	if (job->kind == WELKIN_JOB_IMAGE) {
		const struct view_cone view = view_cone_of(&scene->frame);
		plan_sun_disk(plan, &job->request, scene, &view);
		plan_ground(plan, scene, &view);
		plan_surfaces(plan, job, mesh, method, &view);
		plan_clouds(plan, &job->request, method);
		plan_output(plan, &job->request);
		return;
	}
	/* Directions may point anywhere, and their spectra are replied as they are. */
	const struct view_cone all = { .half_angle = M_PI, .axis = { 0, 1, 0 } };
	plan->features |= FEATURE_SPECTRAL;
	plan_sun_disk(plan, &job->request, scene, &all);
	plan_ground(plan, scene, &all);
	plan_clouds(plan, &job->request, method);
	plan_surfaces(plan, job, mesh, method, &all);
	planner_note(plan, "output", false, "radiance is replied as it is");
}
