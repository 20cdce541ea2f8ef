/* libFuzzer target: any bytes as a JSON body, of a picture and of the photometer, either have faults or
 * resolve to a finite request whose canonical texts bring the same bytes again. */
#include "tests/fuzz_check.h"

#include <math.h>

static void check_photometer(const struct welkin_photometer *p)
{
	assert(p->n_directions >= 1 && p->n_directions <= 16384 && p->n_wavelengths >= 1 && p->n_wavelengths <= 64);
	for (int i = 0; i < p->n_directions; i++) {
		const double *d = p->directions + 3 * i;
		assert(fabs(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - 1) < 1e-12);
	}
	for (int i = 0; i < p->n_wavelengths; i++)
		assert(p->wavelengths_nm[i] >= 360 && p->wavelengths_nm[i] <= 830);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	for (int pass = 0; pass < 2; pass++) {
		struct welkin_draft draft = { 0 };
		struct welkin_faults faults = { 0 };
		struct welkin_photometer photometer = { 0 };
		welkin_parse_json(&draft, (const char *)data, size, pass ? &photometer : NULL, &faults);
		if (pass && faults.n == 0)
			check_photometer(&photometer);
		fuzz_check(&draft, size & 1 ? WELKIN_EXR : WELKIN_PNG, &faults);
		welkin_photometer_finish(&photometer);
	}
	return 0;
}
