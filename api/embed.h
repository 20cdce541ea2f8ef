#ifndef WELKIN_API_EMBED_H
#define WELKIN_API_EMBED_H

#include <stddef.h>

/* Files that the build puts into the binary; arrays end with a NULL name. data[size] is NUL. */
struct embedded_file {
	const char *name; /* path below its folder: "methods/march.comp", "index.html" */
	const unsigned char *data;
	size_t size;
};

extern const struct embedded_file welkin_embedded_shaders[]; /* shaders/ */
extern const struct embedded_file welkin_embedded_www[];     /* api/www/ */

#endif
