#ifndef WELKIN_API_ERROR_H
#define WELKIN_API_ERROR_H

#include <stdbool.h>

/* Why an operation of ours failed: one line for the log or the operator. A fault in what a
 * client sent is data and belongs in struct faults instead (faults.h). */
struct error {
	char text[1024];
};

/* Formats the reason into err (may be NULL) and returns false, so that callers write
 * `return error_set(err, …)`. Thread-safe for distinct err. */
__attribute__((format(printf, 2, 3))) bool error_set(struct error *err, const char *format, ...);

#endif
