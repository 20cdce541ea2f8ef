#ifndef WELKIN_TESTS_LIB_BROWSER_H
#define WELKIN_TESTS_LIB_BROWSER_H

#include <cjson/cJSON.h>
#include <stdbool.h>

/* A headless Chromium driven through chromedriver (the WebDriver protocol, JSON over HTTP). Failures end the
 * running test with cmocka's fail_msg(). */

struct lib_browser {
	char base[64], session[256]; /* http://127.0.0.1:PORT/ and session/ID */
};

bool lib_browser_there(void);

/* A window of that size; phone: as a touch device of two pixels per CSS pixel. */
void lib_browser_start(struct lib_browser *browser, int width, int height, bool phone);
void lib_browser_stop(struct lib_browser *browser);

void lib_browser_open(struct lib_browser *browser, const char *url);
/* Runs the body of a function and returns its value, the caller's to delete. */
cJSON *lib_browser_run(struct lib_browser *browser, const char *script);
double lib_browser_number(struct lib_browser *browser, const char *script);
char *lib_browser_text(struct lib_browser *browser, const char *script); /* malloc'd */
/* Waits until the expression is true. */
void lib_browser_wait(struct lib_browser *browser, const char *expression, int timeout_ms);
/* Errors of the console since the last call, joined by line feeds, without those about HTTP status 4xx; malloc'd. */
char *lib_browser_errors(struct lib_browser *browser);
/* PNG of the whole page, also what is below the fold; whole false: of the window. */
void lib_browser_screenshot(struct lib_browser *browser, const char *path, bool whole);

#endif
