#ifndef WELKIN_TESTS_LIB_SETTINGS_H
#define WELKIN_TESTS_LIB_SETTINGS_H

#include "gpu/method.h"

enum { SETTINGS_MAX = 16 };

/* One way to run a method: the request fields that it declares, swept. */
struct setting {
	int method;             /* index into welkin_methods */
	char label[40];         /* "steps 30", "" where there is nothing to set */
	int steps, light_steps; /* 0: the method doesn't read it */
	double max_error;       /* 0: likewise; progressive methods */
};

/* Coarse: two of each, for a smoke test. Returns how many. */
int settings_of(int method, bool coarse, struct setting settings[SETTINGS_MAX]);

void setting_apply(const struct setting *setting, struct welkin_request *request);

/* Is the request within the method's declared domain? */
bool method_covers(int method, const struct welkin_request *request);

#endif
