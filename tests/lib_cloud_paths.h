#ifndef WELKIN_TESTS_LIB_CLOUD_PATHS_H
#define WELKIN_TESTS_LIB_CLOUD_PATHS_H

/* The path tracer's kernel on bare directions, with as many paths as wanted, in this process. lib_gpu_open() comes
 * first. */
struct cloud_paths {
	const char *query;   /* the request, as the URL has it: method and image do not matter */
	const char *choices; /* of the kernel, beside CLOUDS=1; "" for none; NULL: that of the clear sky */
	int paths;           /* per direction, a multiple of PATHS_TOGETHER */
	int max_order;       /* 0: all */
	unsigned seed;
};

enum { PATHS_TOGETHER = 4 };

/* At 550 nm; radiance in W/m²/sr/nm. */
struct cloud_paths_answer {
	double L, std_error, T;
};

/* Puts the request's blocks and tables on the device. */
void cloud_paths_prepare(const struct cloud_paths *what);

/* Fails the test where the kernel fails or a value is not finite. Returns the device's time in ms. */
double cloud_paths_trace(
	const struct cloud_paths *what, const double (*directions)[3], int n, struct cloud_paths_answer *answers);

#endif
