/* libFuzzer target: any bytes as a query either have faults or resolve to a finite request whose canonical texts
 * bring the same bytes again. The first byte picks the format. */
#include "tests/fuzz_check.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	const enum welkin_format format = size && data[0] & 1 ? WELKIN_EXR : WELKIN_PNG;
	welkin_parse_query(&draft, (const char *)data, size, &faults);
	fuzz_check(&draft, format, &faults);
	return 0;
}
