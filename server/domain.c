#include "server/domain.h"
#include "gpu/choose.h"
#include "gpu/clouds.h"
#include "gpu/operator_methods.h"

#include <stdio.h>
#include <string.h>

/* Another method for this request, a physical one if possible. */
static const struct method *alternative(const struct welkin_request *request)
{
	const struct method *found = NULL;
	for (int i = 0; i < welkin_method_count; i++) {
		const struct method *m = welkin_methods[i];
		if (i != request->atmosphere.method && !m->operators && method_can_do(m, request) &&
			(!found || (m->physical && !found->physical)))
			found = m;
	}
	return found;
}

void domain_check(const struct welkin_request *request, struct welkin_faults *faults)
{
	const int index = request->atmosphere.method;
	if (faults->n || index < 0 || index >= welkin_method_count)
		return;
	const struct method *method = welkin_methods[index];
	const int entry = operator_methods_find(index);
	const struct operator_status status =
		entry >= 0 ? operator_methods_status(entry) : (struct operator_status){ .state = OPERATOR_AVAILABLE };
	if (status.state == OPERATOR_UNAVAILABLE) {
		welkin_fault_add(faults, 422, "atmosphere.method", "see /v1/methods",
			"the method %s is not available: %s", method->name, status.reason);
		return;
	}
	if (method->progressive && request->image.format == WELKIN_EXR && request->image.layers & WELKIN_LAYER_CLOUDS &&
		clouds_present(&request->clouds))
		welkin_fault_add(faults, 422, "image.layers", "depth, transmittance, inscatter",
			"the paths of method %s don't tell what of the light comes by clouds", method->name);
	for (const struct method_range *r = method->domain; r && r->field; r++) {
		double value = 0;
		if (method_range_holds(r, request, &value))
			continue;
		char allowed[96];
		const struct method *other = alternative(request);
		snprintf(allowed, sizeof allowed, "%.9g to %.9g for method %s", r->min, r->max, method->name);
		welkin_fault_add(faults, 422, r->field, allowed, "%.9g is outside the domain of %s: %s.%s%s%s", value,
			method->name, r->why ? r->why : "not valid there", other ? " Method " : "",
			other ? other->name : "", other ? " can do it." : "");
	}
}

/* The name of a scene that nobody could load stays a fault, whoever forgot to look. */
static void resolve_scene(const struct welkin_draft *draft, const struct scene_mesh *mesh, struct welkin_request *out,
	struct welkin_faults *faults)
{
	if (mesh)
		scenes_resolve(mesh, draft, out, faults);
	else if (out->scene.name[0])
		welkin_fault_add(
			faults, 422, "scene.name", "see /v1/scenes", "there is no scene \"%s\"", out->scene.name);
}

void domain_resolve(const struct welkin_draft *draft, enum welkin_format format, const struct welkin_limits *limits,
	double samples, const struct scene_mesh *mesh, struct welkin_request *out, struct welkin_faults *faults)
{
	struct welkin_draft completed = *draft;
	if (mesh)
		scenes_complete(mesh, &completed);
	welkin_resolve(&completed, format, limits, out, faults);
	if (!faults->n)
		resolve_scene(draft, mesh, out, faults);
	if (faults->n)
		return;
	const struct choose_terms terms = { .steps = draft->given[welkin_field_find("atmosphere.steps")],
		.light_steps = draft->given[welkin_field_find("atmosphere.light_steps")],
		.max_error = draft->given[welkin_field_find("accuracy.max_error")],
		.pixels = samples > 0 ? samples : (double)out->image.width * out->image.height };
	choose_method(out, &terms);
	domain_check(out, faults);
}
