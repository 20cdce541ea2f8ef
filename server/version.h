#ifndef WELKIN_SERVER_VERSION_H
#define WELKIN_SERVER_VERSION_H

extern const char build_version[];  /* "0.1.0" */
extern const char build_revision[]; /* of the source tree, "-dirty" when it had changes */
extern const char build_name[];     /* "welkin 0.1.0 (revision)": salt of keys and what files record */

#endif
