#ifndef WELKIN_SERVER_RENDER_H
#define WELKIN_SERVER_RENDER_H

/* `welkin render …`: renders one request file to disk without a daemon. argv[0] is "render".
 * Returns the exit status: 0, 1 (failed) or 2 (wrong options or request). */
int welkin_render_command(int argc, char **argv);

#endif
