#ifndef WELKIN_GPU_DEVICE_H
#define WELKIN_GPU_DEVICE_H

#include "api/error.h"
#include "gpu/job.h"

/* An OpenGL 4.5 core context without a window, on a GPU where there is one. */
struct device {
	void *display; /* EGLDisplay */
	void *context; /* EGLContext, current in the thread that opened it */
	struct welkin_device info;
};

/* which: "auto" (hardware first), "software", or a number of `welkin devices`. On failure the
 * device is left zeroed and err names what was tried. */
bool device_open(struct device *device, const char *which, struct error *err);
/* Takes a zeroed device too. */
void device_close(struct device *device);

/* NULL while all is well; otherwise why the context can't be used any more (a reset, a GL error). */
const char *device_trouble(void);

#endif
