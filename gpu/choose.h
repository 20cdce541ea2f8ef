#ifndef WELKIN_GPU_CHOOSE_H
#define WELKIN_GPU_CHOOSE_H

#include "api/request.h"
#include "gpu/method.h"

#include <stdbool.h>

/*
 * atmosphere.method auto: the cheapest method and setting that is valid for a request and errs by at most
 * accuracy.max_error, or the most accurate within accuracy.budget_ms, by the numbers of measured.h. Pure: the
 * same request is answered the same by a build, so that cache keys and ETags stay what they are. No GL; any
 * process may call it.
 *
 * The error that is expected of a method for a request comes from the scenes nearest to it: interpolated over
 * the sun's elevation among those on the ground, the worst of the two that enclose its altitude, times what
 * haze, very clear air and bright ground were found to add. Costs are those of welkin_measured_device; on another
 * device they say which method is cheaper rather than how long it takes.
 */

/* Does a request keep to one range of a domain? *outside: the number that does not. */
bool method_range_holds(const struct method_range *range, const struct welkin_request *request, double *outside);
/* And to all of the method's? */
bool method_can_do(const struct method *method, const struct welkin_request *request);

/* atmosphere.method of a request that leaves it to the daemon: one past the methods. */
bool method_is_auto(const struct welkin_request *request);

/* What the client said itself, and how many pixels (or directions) there are to compute. */
struct choose_terms {
	bool steps, light_steps, max_error;
	double pixels;
};

/* Replaces auto: sets atmosphere.method, steps that were not given, and atmosphere.choice. Does nothing to
 * a request that names its method. */
void choose_method(struct welkin_request *request, const struct choose_terms *terms);

/* What is expected of the method and steps that a request has now: relative RMSE of luminance, and device
 * time on the device that was measured. NAN: not measured for such a request. */
struct expectation {
	double error, ms;
	double tables_ms; /* the frame's part of tables that take seconds, which are kept for many */
};
struct expectation choose_expect(const struct welkin_request *request, double pixels);

/* Why atmosphere.choice is what it is; "" where the client chose. */
const char *choose_reason(const struct welkin_request *request);

#endif
