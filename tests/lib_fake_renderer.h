#ifndef WELKIN_TESTS_LIB_FAKE_RENDERER_H
#define WELKIN_TESTS_LIB_FAKE_RENDERER_H

/*
 * A renderer process without a GPU, for tests of the server: it speaks the channel's protocol and
 * goes wrong on demand. A test program starts the daemon with itself as `--renderer`; its main()
 * calls fake_renderer_run() first, which takes over when the program was started as one.
 *
 * What a frame does is told by its seed. The pixels depend on the request only.
 */
enum {
	FAKE_CRASH = 1001,   /* the process dies when the job arrives */
	FAKE_HANG = 1002,    /* it stops reading and answering, for ever */
	FAKE_FAIL = 1003,    /* a result that says failed */
	FAKE_IGNORE = 1004,  /* it keeps ponging but never finishes the frame and ignores a cancel */
	FAKE_SLOW = 1000000, /* FAKE_SLOW + ms: takes that long, in small slices */
};

/* With WELKIN_FAKE=broken in the environment it says that it cannot start, with =silent nothing at all; with =checks
 * it dies while it checks the first of the operator's methods whose state is not known, and starts when there is none.
 * Returns when the program was started as anything but a renderer; does not return otherwise. */
void fake_renderer_run(int argc, char **argv);

#endif
