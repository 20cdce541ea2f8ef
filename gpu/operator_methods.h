#ifndef WELKIN_GPU_OPERATOR_METHODS_H
#define WELKIN_GPU_OPERATOR_METHODS_H

#include "api/error.h"
#include "api/method_head.h"
#include "gpu/method.h"

#include <stdbool.h>
#include <stddef.h>

/*
 * Methods from files of the operator's: each NAME.glsl in --method-dir defines method_sky() (see
 * shaders/sky.glsl) and opens with a head that declares its parameters (api/method_head.h).
 *
 * The server process reads the folder once, at its start, and hands what it read to every renderer
 * process in a memfd, so both know the same methods by the same indices whatever happens to
 * the folder later. Entries are sorted by file name. What is at fault is kept as an entry that says
 * why, and takes nothing else down.
 *
 * Reading, receiving and forgetting are for the time before a process has threads; the rest may be
 * called from any thread.
 */

enum { OPERATOR_METHODS_MAX = 32, OPERATOR_FILE_MAX = 256 * 1024, OPERATOR_REASON_SIZE = 400 };

enum operator_state {
	OPERATOR_UNCHECKED,   /* may be asked for; the renderer has not tried it yet */
	OPERATOR_AVAILABLE,   /* compiled, and gave finite and non-negative light in the check */
	OPERATOR_UNAVAILABLE, /* see the reason; stays so until the daemon is started again */
};

struct operator_method {
	char file[256];              /* its name in the folder */
	char name[METHOD_NAME_SIZE]; /* "" where the file's name can't be one, or is a built-in method's */
	int index;                   /* into welkin_methods and welkin_method_names; -1 without a name */
	const char *text;            /* NUL-terminated; NULL where it could not be read */
	char digest[17];             /* of file name and text: goes into keys of images */
	struct method_head head;
	struct method method;
};

/* What came of it, a copy. */
struct operator_status {
	enum operator_state state;
	double ns_per_ray; /* device time of a ray of four bands; 0: not measured */
	char reason[OPERATOR_REASON_SIZE];
};

/* Reads the folder and adds its methods to the registry; "" is none. false when it can't be read at all. */
bool operator_methods_read(const char *dir, struct error *err);
/* The same from a bundle. */
bool operator_methods_receive(int fd, struct error *err);
/* All that was read as a memfd for a renderer process, close-on-exec, number 10 or above; -1 with the reason. */
int operator_methods_bundle(struct error *err);
/* Back to the built-in methods. */
void operator_methods_forget(void);

int operator_methods_count(void);
/* Files that there was no room for. */
int operator_methods_left_out(void);
const struct operator_method *operator_methods_at(int i);
/* The entry behind an index into welkin_methods; -1: built in. */
int operator_methods_find(int method);

struct operator_status operator_methods_status(int i);
/* Notes what came of a check. Unavailable is for good. Returns whether this changed the state. */
bool operator_methods_report(int i, const struct operator_status *status);
/* The renderer was lost while it worked for this method: after the second time the method is
 * unavailable, since a daemon must not be restarted for ever by one of its methods. Returns whether it now became so.
 */
bool operator_methods_blame(int i, const char *how);
/* Grows with every change of a state: what was made from the states before is out of date. */
unsigned operator_methods_changes(void);

/* One character for each entry ('?', '+', '-'), for the command line of a renderer process. */
void operator_methods_states(char text[OPERATOR_METHODS_MAX + 1]);
void operator_methods_take_states(const char *text);

/* The kernel of a method: everything around the operator's text, which it includes as "operator/FILE".
 * malloc'd; NULL: out of memory. */
char *operator_methods_kernel(const struct operator_method *method);

#endif
