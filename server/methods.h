#ifndef WELKIN_SERVER_METHODS_H
#define WELKIN_SERVER_METHODS_H

/* `welkin methods [--method-dir DIR] [--device D] [--shader-dir DIR]`: lists the ways to compute a sky. With
 * a folder of methods (WELKIN_METHOD_DIR counts too) its files are compiled, checked and timed as the daemon
 * would. argv holds what follows `methods`. Exit status: 1 when one of them is of no use, 2 for a wrong command line.
 */
int methods_command(int argc, char **argv);

#endif
