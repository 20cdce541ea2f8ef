#ifndef WELKIN_SERVER_SERVE_H
#define WELKIN_SERVER_SERVE_H

/* `welkin serve …`: the daemon. argv holds what follows "serve". Returns the exit status: 0 after
 * SIGTERM or SIGINT, 1 when it could not start, 2 for wrong options. */
int serve_command(int argc, char **argv);

#endif
