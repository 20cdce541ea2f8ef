/* The web page in a real browser, at the size of a desktop and of a phone, against a real daemon. */
#include "tests/lib_browser.h"
#include "tests/lib_http.h"

#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static const char *page; /* its URL */
static char screenshots[PATH_MAX];
static struct lib_browser browser;

#define SHOWN "document.getElementById('frame').dataset.shown === 'full' && !document.querySelector('.busy')"

/* ---- helpers ---- */

static void screenshot(const char *name, bool whole)
{
	char path[PATH_MAX + 64];
	snprintf(path, sizeof path, "%s/%s.png", screenshots, name);
	lib_browser_screenshot(&browser, path, whole);
}

static void open_page(const char *hash)
{
	char url[512];
	snprintf(url, sizeof url, "%s%s", page, hash);
	lib_browser_open(&browser, "about:blank"); /* or only the hash would change */
	lib_browser_open(&browser, url);
	lib_browser_wait(&browser, SHOWN, 30000);
}

/* As a person would: the value in, then the event that typing fires. */
static void type_in(const char *field, const char *value)
{
	char script[512];
	snprintf(script, sizeof script,
		"delete document.getElementById('frame').dataset.shown;"
		"const i = document.getElementById('f-%s'); i.value = '%s';"
		"i.dispatchEvent(new Event('input', { bubbles: true })); i.dispatchEvent(new Event('change', { "
		"bubbles: true }));",
		field, value);
	cJSON_Delete(lib_browser_run(&browser, script));
}

static void press(const char *label)
{
	char script[512];
	snprintf(script, sizeof script,
		"delete document.getElementById('frame').dataset.shown;"
		"[...document.querySelectorAll('button')].find(b => b.textContent === '%s').click()",
		label);
	cJSON_Delete(lib_browser_run(&browser, script));
}

static void assert_contains(char *text, const char *part)
{
	if (!strstr(text, part))
		fail_msg("\"%s\" does not contain \"%s\"", text, part);
	free(text);
}

static void assert_no_errors(void)
{
	char *errors = lib_browser_errors(&browser);
	if (*errors)
		fail_msg("console: %s", errors);
	free(errors);
}

static double number(const char *script)
{
	return lib_browser_number(&browser, script);
}

static char *text(const char *script)
{
	return lib_browser_text(&browser, script);
}

/* ---- tests, on the desktop ---- */

static void test_first_picture(void **state)
{
	(void)state;
	open_page("");
	assert_true(number("return document.getElementById('picture').naturalWidth") == 1280);
	assert_true(number("return document.getElementById('picture').naturalHeight") == 720);
	assert_true(number("return document.querySelectorAll('#bar i').length") >= 4);
	assert_true(number("return document.querySelectorAll('#plan li').length") >= 2);
	assert_contains(text("return document.getElementById('timings').innerText"), "encode");
	assert_true(number("return Math.min(...[...document.querySelectorAll('#timings td')].map(td => "
			   "parseFloat(td.textContent)))") >= 0);
	assert_true(number("return parseFloat([...document.querySelectorAll('#timings .sum td')][0].textContent)") > 0);
	assert_true(number("return document.getElementById('bar').getBoundingClientRect().height") > 4);
	assert_contains(text("return document.getElementById('badge').textContent"), "1280 × 720");
	assert_no_errors();
	screenshot("desktop", false);
	screenshot("desktop-whole", true);
}

/* Not one field is written into the page: what the daemon lists is what there is. */
static void test_every_field_has_a_labelled_control(void **state)
{
	(void)state;
	struct http_reply document = get(page, "openapi.json");
	assert_int_equal(document.status, 200);
	cJSON *api = cJSON_Parse(document.body);
	const cJSON *parameters = cJSON_GetObjectItem(cJSON_GetObjectItem(api, "components"), "parameters");
	int fields = 0;
	for (const cJSON *p = parameters->child; p; p = p->next) {
		char script[400];
		if (!cJSON_HasObjectItem(p, "x-order"))
			continue;
		fields++;
		snprintf(script, sizeof script,
			"return document.querySelectorAll('[data-field=\"%s\"] :is(input, select)').length", p->string);
		if (number(script) < 1)
			fail_msg("%s has no control", p->string);
	}
	cJSON_Delete(api);
	reply_finish(&document);
	assert_true(fields > 30);
	assert_true(number("return document.querySelectorAll('[data-field]').length") == fields);
	assert_true(number("return [...document.querySelectorAll('input, select, button')].filter(e => "
			   "!(e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim())).length") == 0);
}

static void test_a_field_changes_picture_and_address(void **state)
{
	(void)state;
	open_page("");
	type_in("sun.elevation_deg", "5");
	lib_browser_wait(&browser, SHOWN, 30000);
	assert_contains(text("return location.hash"), "#sun.elevation_deg=5");
	assert_contains(text("return document.getElementById('curl').value"), "curl -o sky.png 'http");
	char *url = text("return document.getElementById('url').value");
	assert_non_null(strstr(url, "/v1/render.png?sun.elevation_deg=5"));
	/* What the page shows is what that address gives. */
	struct http_reply picture = ask("GET", url, "", NULL, NULL);
	assert_int_equal(picture.status, 200);
	assert_true(picture.size > 8 && !memcmp(picture.body, "\x89PNG", 4));
	reply_finish(&picture);
	cJSON_Delete(lib_browser_run(&browser,
		"const shown = document.getElementById('picture'), other = new Image();"
		"const pixels = image => { const c = new OffscreenCanvas(1280, 720).getContext('2d'); "
		"c.drawImage(image, 0, 0);"
		"return new Uint32Array(c.getImageData(0, 0, 1280, 720).data.buffer); };"
		"other.onload = () => { const a = pixels(shown), b = pixels(other); window.differing = a.filter((v, i) "
		"=> v !== b[i]).length;"
		"window.colours = new Set(a).size; }; other.src = document.getElementById('url').value;"));
	lib_browser_wait(&browser, "window.colours > 0", 5000);
	assert_true(number("return window.differing") == 0);
	assert_true(number("return window.colours") > 1000);
	free(url);

	/* The slider of the same field, and back to nothing. */
	cJSON_Delete(lib_browser_run(&browser,
		"const s = document.querySelector('[data-field=\"sun.elevation_deg\"] [type=range]');"
		"s.value = 750; s.dispatchEvent(new Event('input', { bubbles: true }))"));
	assert_contains(text("return location.hash"), "#sun.elevation_deg=45");
	assert_true(number("return Number(document.getElementById('f-sun.elevation_deg').value)") == 45);
	cJSON_Delete(lib_browser_run(
		&browser, "document.querySelector('[data-field=\"sun.elevation_deg\"] .clear').click()"));
	assert_true(number("return location.hash.length") == 0);
	assert_no_errors();
}

static void test_faults_stand_at_their_fields(void **state)
{
	(void)state;
	open_page("");
	char *before = text("return document.getElementById('picture').src");
	type_in("sun.elevation_deg", "500");
	type_in("camera.fov_deg", "wide");
	lib_browser_wait(&browser, "document.querySelectorAll('.faulty').length === 2", 10000);
	assert_contains(text("return document.querySelector('[data-field=\"sun.elevation_deg\"] .fault').innerText"),
		"allowed");
	assert_true(number("return document.querySelectorAll('[aria-invalid]').length") == 2);
	assert_true(number("return document.getElementById('problem').offsetHeight") > 0);
	assert_contains(text("return document.getElementById('picture').src"), before); /* the last good one stays */
	free(before);
	screenshot("desktop-faults", false);
	type_in("sun.elevation_deg", "");
	type_in("camera.fov_deg", "70");
	lib_browser_wait(&browser, SHOWN, 30000);
	assert_true(number("return document.querySelectorAll('.faulty').length") == 0);
	assert_true(number("return document.getElementById('problem').offsetHeight") == 0);
	assert_no_errors();
}

static void test_quick_buttons(void **state)
{
	(void)state;
	open_page("");
	press("Dome");
	lib_browser_wait(&browser, SHOWN, 30000);
	assert_true(number("return document.getElementById('picture').naturalWidth - "
			   "document.getElementById('picture').naturalHeight") == 0);
	assert_contains(text("return String([...document.querySelectorAll('.chip[aria-pressed=true]')].map(c => "
			     "c.textContent))"),
		"Dome");
	press("Panorama");
	press("Sunset");
	lib_browser_wait(&browser, SHOWN, 30000);
	assert_true(number("return document.getElementById('picture').naturalWidth / "
			   "document.getElementById('picture').naturalHeight") == 2);
	assert_contains(text("return location.hash"), "image.projection=equirectangular");
	screenshot("desktop-panorama", false);
	press("Reset everything");
	lib_browser_wait(&browser, SHOWN, 30000);
	assert_true(number("return location.hash.length") == 0);
	assert_no_errors();
}

static void test_address_restores_the_form(void **state)
{
	(void)state;
	open_page(
		"#camera.altitude_m=10000&sun.elevation_deg=2&sun.disk=false&tone.map=aces&time=2026-12-21T02:30:00Z");
	assert_contains(text("return document.getElementById('f-camera.altitude_m').value"), "10000");
	assert_contains(text("return document.getElementById('f-tone.map').value"), "aces");
	assert_contains(text("return document.getElementById('f-time').value"), "2026-12-21T02:30");
	assert_true(number("return Number(document.getElementById('f-sun.disk').checked)") == 0);
	assert_contains(text("return document.getElementById('url').value"), "sun.disk=false");
	assert_no_errors();
}

/* ---- and on the phone ---- */

static void test_phone(void **state)
{
	(void)state;
	open_page("#sun.elevation_deg=4");
	screenshot("phone", false);
	screenshot("phone-whole", true);
	cJSON_Delete(lib_browser_run(&browser, "document.querySelectorAll('details').forEach(d => { d.open = true; });"
					       "document.querySelectorAll('.more').forEach(b => b.click())"));
	assert_true(number("return document.documentElement.clientWidth") == 390);
	assert_true(number("return document.documentElement.scrollWidth") <= 390);
	/* Nothing reaches beyond the edge but what scrolls by itself. */
	assert_true(number("return [...document.querySelectorAll('body *')].filter(e => !e.closest('.chiprow') && "
			   "e.getBoundingClientRect().right > 390.5).length") == 0);
	screenshot("phone-open", true);
	type_in("sun.elevation_deg", "91");
	lib_browser_wait(&browser, "document.querySelector('.faulty .fault')?.offsetHeight > 0", 10000);
	assert_true(number("return document.documentElement.scrollWidth") <= 390);
	press("From orbit");
	press("Golden hour");
	lib_browser_wait(&browser, SHOWN, 30000);
	screenshot("phone-orbit", false);
	assert_no_errors();
}

/* ---- set-up ---- */

static int start_phone(void **state)
{
	(void)state;
	lib_browser_start(&browser, 390, 844, true);
	return 0;
}

static int stop_browser(void **state)
{
	(void)state;
	lib_browser_stop(&browser);
	return 0;
}

static void find_screenshots(const char *self)
{
	char own[PATH_MAX];
	snprintf(own, sizeof own, "%s", self);
	snprintf(screenshots, sizeof screenshots, "%.4000s/../screenshots", dirname(own));
	mkdir(screenshots, 0777);
}

static int start_desktop(void **state)
{
	(void)state;
	static const char *const software[] = { "--device", "software", NULL };
	page = daemon_start(false, software)->url;
	lib_browser_start(&browser, 1400, 950, false);
	return 0;
}

int main(int argc, char **argv)
{
	(void)argc;
	const struct CMUnitTest desktop[] = {
		cmocka_unit_test(test_first_picture),
		cmocka_unit_test(test_every_field_has_a_labelled_control),
		cmocka_unit_test(test_a_field_changes_picture_and_address),
		cmocka_unit_test(test_faults_stand_at_their_fields),
		cmocka_unit_test(test_quick_buttons),
		cmocka_unit_test(test_address_restores_the_form),
	};
	const struct CMUnitTest phone[] = { cmocka_unit_test(test_phone) };
	if (!lib_browser_there()) {
		fprintf(stderr, "test_page: chromium and chromium-driver are not installed\n");
		return 1;
	}
	find_screenshots(argv[0]);
	const int failed = cmocka_run_group_tests(desktop, start_desktop, stop_browser);
	return failed + cmocka_run_group_tests(phone, start_phone, stop_browser);
}
