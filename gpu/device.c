#include "gpu/device.h"

#include "gpu/clock.h"
#include "gpu/renderer.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <stdlib.h>
#include <string.h>

/*
 * Where contexts come from: the devices that EGL enumerates (GPUs and Mesa's software device), and
 * where none can be enumerated, Mesa's surfaceless platform. eglGetPlatformDisplay of EGL 1.5 is
 * out of reach: libepoxy refuses it before a display exists, so the EXT entry point it is.
 */

enum { DEVICES_MAX = 16 };

struct candidate {
	EGLDeviceEXT device; /* EGL_NO_DEVICE_EXT: the surfaceless platform */
	bool software;
};

static bool has_word(const char *list, const char *word)
{
	const size_t n = strlen(word);
	for (const char *p = list; p && (p = strstr(p, word)); p += n)
		if ((p == list || p[-1] == ' ') && (p[n] == ' ' || p[n] == '\0'))
			return true;
	return false;
}

static int find_candidates(struct candidate *list, int capacity)
{
	const char *client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
	EGLDeviceEXT devices[DEVICES_MAX];
	EGLint n = 0;
	if (has_word(client, "EGL_EXT_platform_device") &&
		(has_word(client, "EGL_EXT_device_base") || has_word(client, "EGL_EXT_device_enumeration")))
		if (!eglQueryDevicesEXT(DEVICES_MAX, devices, &n))
			n = 0;
	int count = 0;
	for (EGLint i = 0; i < n && count < capacity; i++) {
		const char *ext = eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS);
		list[count++] = (struct candidate){ devices[i], has_word(ext, "EGL_MESA_device_software") };
	}
	if (count == 0 && capacity > 0 && has_word(client, "EGL_MESA_platform_surfaceless"))
		list[count++] = (struct candidate){ EGL_NO_DEVICE_EXT, true };
	return count;
}

static EGLContext create_context(EGLDisplay display)
{
	/* A context that says when the GPU was reset, so that the process can go and be replaced. */
	static const EGLint with_reset[] = { EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5,
		EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
		EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET, EGL_NONE };
	static const EGLint plain[] = { EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5,
		EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE };
	EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, with_reset);
	if (context == EGL_NO_CONTEXT)
		context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, plain);
	return context;
}

static void describe(struct welkin_device *info, int index)
{
	memset(info, 0, sizeof *info);
	strncpy(info->name, (const char *)glGetString(GL_RENDERER), sizeof info->name - 1);
	strncpy(info->vendor, (const char *)glGetString(GL_VENDOR), sizeof info->vendor - 1);
	strncpy(info->version, (const char *)glGetString(GL_VERSION), sizeof info->version - 1);
	info->software = strstr(info->name, "llvmpipe") || strstr(info->name, "softpipe") ||
			 strstr(info->name, "swrast") || strstr(info->name, "SWR");
	info->index = index;
}

static bool open_candidate(struct device *device, const struct candidate *candidate, int index, struct error *err)
{
	const bool surfaceless = candidate->device == EGL_NO_DEVICE_EXT;
	EGLDisplay display =
		surfaceless ? eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL)
			    : eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, candidate->device, NULL);
	if (display == EGL_NO_DISPLAY)
		return error_set(err, "device %d: no EGL display (0x%x)", index, eglGetError());
	if (!eglInitialize(display, NULL, NULL))
		return error_set(err, "device %d: eglInitialize failed (0x%x)", index, eglGetError());
	EGLContext context = EGL_NO_CONTEXT;
	const char *extensions = eglQueryString(display, EGL_EXTENSIONS);
	if (!has_word(extensions, "EGL_KHR_surfaceless_context") ||
		!(has_word(extensions, "EGL_KHR_no_config_context") ||
			has_word(extensions, "EGL_MESA_configless_context"))) {
		error_set(err, "device %d: no contexts without a surface", index);
		goto fail;
	}
	if (!eglBindAPI(EGL_OPENGL_API) || (context = create_context(display)) == EGL_NO_CONTEXT) {
		error_set(err, "device %d: no OpenGL 4.5 core context (0x%x)", index, eglGetError());
		goto fail;
	}
	if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
		error_set(err, "device %d: eglMakeCurrent failed (0x%x)", index, eglGetError());
		goto fail;
	}
	device->display = display;
	device->context = context;
	describe(&device->info, index);
	return true;
fail:
	if (context != EGL_NO_CONTEXT)
		eglDestroyContext(display, context);
	eglTerminate(display);
	return false;
}

/* Tries candidates of one kind (-1: any) in their order. */
static bool open_first(struct device *device, const struct candidate *list, int n, int software, struct error *err)
{
	for (int i = 0; i < n; i++)
		if ((software < 0 || list[i].software == (software == 1)) && open_candidate(device, &list[i], i, err))
			return true;
	return false;
}

bool device_open(struct device *device, const char *which, struct error *err)
{
	const double start_ms = clock_ms();
	memset(device, 0, sizeof *device);
	struct candidate list[DEVICES_MAX];
	const int n = find_candidates(list, DEVICES_MAX);
	if (n == 0)
		return error_set(err, "EGL lists no device (are the Mesa or vendor EGL libraries installed?)");
	bool ok;
	if (strcmp(which, "auto") == 0 || which[0] == '\0') {
		ok = open_first(device, list, n, 0, err) || open_first(device, list, n, 1, err);
	} else if (strcmp(which, "software") == 0) {
		error_set(err, "EGL lists no software device");
		ok = open_first(device, list, n, 1, err);
	} else {
		char *end;
		const long index = strtol(which, &end, 10);
		if (end == which || *end != '\0')
			return error_set(err, "device \"%s\" is neither auto, software nor a number", which);
		if (index < 0 || index >= n)
			return error_set(err, "there is no device %ld; there are %d, from 0", index, n);
		ok = open_candidate(device, &list[index], (int)index, err);
	}
	device->info.startup_ms = clock_ms() - start_ms;
	return ok;
}

void device_close(struct device *device)
{
	if (!device->display)
		return;
	eglMakeCurrent(device->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
	eglDestroyContext(device->display, device->context);
	eglTerminate(device->display);
	memset(device, 0, sizeof *device);
}

const char *device_trouble(void)
{
	if (glGetGraphicsResetStatus() != GL_NO_ERROR)
		return "the device was reset";
	switch (glGetError()) {
	case GL_NO_ERROR:
		return NULL;
	case GL_OUT_OF_MEMORY:
		return "GL_OUT_OF_MEMORY";
	case GL_INVALID_ENUM:
		return "GL_INVALID_ENUM";
	case GL_INVALID_VALUE:
		return "GL_INVALID_VALUE";
	case GL_INVALID_OPERATION:
		return "GL_INVALID_OPERATION";
	default:
		return "a GL error";
	}
}

int welkin_list_devices(struct welkin_device *devices, int capacity, struct error *err)
{
	struct candidate list[DEVICES_MAX];
	const int n = find_candidates(list, DEVICES_MAX);
	int count = 0;
	if (n == 0)
		error_set(err, "EGL lists no device");
	for (int i = 0; i < n && count < capacity; i++) {
		const double start_ms = clock_ms();
		struct device device = { 0 };
		if (!open_candidate(&device, &list[i], i, err))
			continue;
		devices[count] = device.info;
		devices[count++].startup_ms = clock_ms() - start_ms;
		device_close(&device);
	}
	return count;
}
