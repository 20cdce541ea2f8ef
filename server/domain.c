#include "server/domain.h"
#include "gpu/operator_methods.h"

#include <stdio.h>
#include <string.h>

/* The numbers of a field: how many, and where; integers are widened into *one. */
static int field_values(const struct welkin_field *field, const struct welkin_request *request, double values[3])
{
	const char *at = (const char *)request + field->offset;
	int32_t whole;
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
		memcpy(values, at, sizeof *values);
		return 1;
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		memcpy(values, at, 3 * sizeof *values);
		return 3;
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_BOOL:
	case WELKIN_TYPE_ENUM:
		memcpy(&whole, at, sizeof whole);
		values[0] = whole;
		return 1;
	default:
		return 0;
	}
}

/* false and the offending value when the request is outside. */
static bool within(const struct method_range *range, const struct welkin_request *request, double *value)
{
	double values[3] = { 0 };
	const int index = welkin_field_find(range->field);
	const int n = index < 0 ? 0 : field_values(&welkin_fields[index], request, values);
	for (int i = 0; i < n; i++)
		if (!(values[i] >= range->min && values[i] <= range->max)) {
			*value = values[i];
			return false;
		}
	return true;
}

static bool can_do(const struct method *method, const struct welkin_request *request)
{
	double value;
	for (const struct method_range *r = method->domain; r && r->field; r++)
		if (!within(r, request, &value))
			return false;
	return true;
}

/* Another method for this request, a physical one if possible. */
static const struct method *alternative(const struct welkin_request *request)
{
	const struct method *found = NULL;
	for (int i = 0; i < welkin_method_count; i++) {
		const struct method *m = welkin_methods[i];
		if (i != request->atmosphere.method && !m->operators && can_do(m, request) &&
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
	for (const struct method_range *r = method->domain; r && r->field; r++) {
		double value = 0;
		if (within(r, request, &value))
			continue;
		char allowed[96];
		const struct method *other = alternative(request);
		snprintf(allowed, sizeof allowed, "%.9g to %.9g for method %s", r->min, r->max, method->name);
		welkin_fault_add(faults, 422, r->field, allowed, "%.9g is outside the domain of %s: %s.%s%s%s", value,
			method->name, r->why ? r->why : "not valid there", other ? " Method " : "",
			other ? other->name : "", other ? " can do it." : "");
	}
}
