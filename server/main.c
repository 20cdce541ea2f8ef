#include "api/api.h"
#include "gpu/renderer.h"
#include "server/loader.h"
#include "server/methods.h"
#include "server/options.h"
#include "server/render.h"
#include "server/serve.h"
#include "server/version.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

static void usage(FILE *out)
{
	fputs("Welkin renders skies: a daemon for HTTP clients, and the same on the command line.\n\n"
	      "  welkin serve [OPTION…]                     answer HTTP requests until SIGTERM\n"
	      "  welkin render REQUEST.json|- -o OUT.png    render one request to a file (welkin render --help)\n"
	      "  welkin devices                             list the devices that can render\n"
	      "  welkin methods [--method-dir DIR]          list the ways to compute a sky; checks those in DIR\n"
	      "  welkin --version | --help\n\n"
	      "Options of serve; each also in the environment and in a configuration file:\n",
		out);
	options_help(out);
}

static int devices_command(void)
{
	struct welkin_device devices[16];
	struct error err = { "" };
	const int n = welkin_list_devices(devices, 16, &err);
	for (int i = 0; i < n; i++)
		printf("%d  %-9s %s (%s, OpenGL %s)\n", devices[i].index, devices[i].software ? "software" : "hardware",
			devices[i].name, devices[i].vendor, devices[i].version);
	if (n > 0)
		return 0;
	fprintf(stderr, "welkin devices: %s\n", *err.text ? err.text : "no device with OpenGL compute shaders found");
	return 1;
}

/* `welkin renderer --fd N …`: how the supervisor starts the renderer process; not for people. */
static int renderer_command(int argc, char **argv)
{
	struct welkin_renderer_config config = {
		.device = "auto", .slice_ms = 8, .table_budget_mib = 256, .warmup = 1
	};
	int fd = -1;
	for (int i = 1; i + 1 < argc; i += 2) {
		if (!strcmp(argv[i], "--fd"))
			fd = atoi(argv[i + 1]);
		else if (!strcmp(argv[i], "--device"))
			snprintf(config.device, sizeof config.device, "%s", argv[i + 1]);
		else if (!strcmp(argv[i], "--shader-dir"))
			snprintf(config.shader_dir, sizeof config.shader_dir, "%s", argv[i + 1]);
		else if (!strcmp(argv[i], "--slice-ms"))
			config.slice_ms = atof(argv[i + 1]);
		else if (!strcmp(argv[i], "--table-mib"))
			config.table_budget_mib = atof(argv[i + 1]);
		else if (!strcmp(argv[i], "--warmup"))
			config.warmup = atoi(argv[i + 1]);
		else if (!strcmp(argv[i], "--methods-fd"))
			config.methods_fd = atoi(argv[i + 1]);
		else if (!strcmp(argv[i], "--method-states"))
			snprintf(config.method_states, sizeof config.method_states, "%s", argv[i + 1]);
	}
	if (fd < 0) {
		fprintf(stderr, "welkin renderer: started by `welkin serve` only\n");
		return 2;
	}
	/* It must not outlive a server that was killed; one that died before this line is seen in the socket. */
	prctl(PR_SET_PDEATHSIG, SIGKILL);
	prctl(PR_SET_NAME, "welkin-renderer");
	return welkin_renderer_main(fd, &config);
}

int main(int argc, char **argv)
{
	const char *command = argc > 1 ? argv[1] : "";
	if (!strcmp(command, "serve"))
		return serve_command(argc - 2, argv + 2);
	if (!strcmp(command, "render"))
		return welkin_render_command(argc - 1, argv + 1);
	if (!strcmp(command, "loader"))
		loader_command(argc - 1, argv + 1);
	if (!strcmp(command, "renderer"))
		return renderer_command(argc - 1, argv + 1);
	if (argc == 2 && !strcmp(command, "devices"))
		return devices_command();
	if (!strcmp(command, "methods"))
		return methods_command(argc - 2, argv + 2);
	if (argc == 2 && !strcmp(command, "--version")) {
		printf("%s\n", build_name);
		return 0;
	}
	if (argc == 2 && (!strcmp(command, "--help") || !strcmp(command, "-h"))) {
		usage(stdout);
		return 0;
	}
	if (argc < 2)
		fprintf(stderr, "welkin: a command is needed: serve, render, devices, methods, --version or --help\n");
	else if (argc > 2 && (!strcmp(command, "devices") || !strncmp(command, "--", 2)))
		fprintf(stderr, "welkin: %s takes no arguments\n", command);
	else
		fprintf(stderr, "welkin: unknown command \"%s\"; see welkin --help\n", command);
	return 2;
}
