# Welkin. `make run` and `make check` do everything on a fresh Debian 12; CONTRIBUTING.md lists the rest.
.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules

B        ?= build
CC       ?= gcc
PREFIX   ?= /usr/local
DESTDIR  ?=
VERSION  := $(shell sed -n 's/^## \([0-9][^ ]*\).*/\1/p' CHANGELOG.md 2>/dev/null | head -1)
ifeq ($(VERSION),)
VERSION  := 0.1.0
endif
REVISION := $(shell git describe --always --dirty --exclude '*' 2>/dev/null || echo unknown)

ifneq ($(filter default undefined,$(origin CC)),)
CC := gcc
endif

BUILD_PKGS := libmicrohttpd epoxy egl libpng libdeflate OpenEXR libsystemd inih libcjson libarchive libseccomp nettle
TEST_PKGS  := cmocka libcurl gsl

WARN   := -Wall -Wextra -Werror -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wpointer-arith -Wvla \
          -Wwrite-strings -Wundef -Wno-missing-field-initializers
OPT    ?= -O2 -g
CFLAGS_ALL = -std=gnu17 $(OPT) $(WARN) -MMD -MP -I. -I$(B)/gen -D_GNU_SOURCE \
          -DWELKIN_VERSION='"$(VERSION)"' -fno-math-errno $(SAN_FLAGS) $(PKG_CFLAGS) $(CFLAGS)
LDFLAGS_ALL = $(SAN_FLAGS) $(LDFLAGS)
SANITIZER ?=
ifneq ($(SANITIZER),)
comma := ,
SAN_FLAGS := -fsanitize=$(SANITIZER) -fno-omit-frame-pointer -fno-sanitize-recover=all
endif
# Asked apart: pkg-config says nothing at all where one of its packages is missing, and a build needs none of the tests'.
PKG_CFLAGS = $(eval PKG_CFLAGS := $$(shell pkg-config --cflags $(BUILD_PKGS) 2>/dev/null; pkg-config --cflags $(TEST_PKGS) 2>/dev/null))$(PKG_CFLAGS)
PKG_LIBS   = $(eval PKG_LIBS := $$(shell pkg-config --libs $(BUILD_PKGS) 2>/dev/null))$(PKG_LIBS)
LIBS       = $(PKG_LIBS) -lnova -lpthread -lm # libnova has no .pc file

# ---- sources ----
API_SRC    := $(sort $(wildcard api/*.c))
METHOD_SRC := $(sort $(wildcard gpu/methods/*.c))
METHODS    := $(notdir $(basename $(METHOD_SRC)))
GPU_SRC    := $(sort $(wildcard gpu/*.c)) $(METHOD_SRC)
SERVER_SRC := $(sort $(wildcard server/*.c))
SHADERS    := $(sort $(wildcard shaders/*.h shaders/*.glsl shaders/*.vert shaders/*.frag shaders/*.comp shaders/methods/*.comp shaders/tables/*.comp))
WWW        := $(sort $(wildcard api/www/*))
GEN        := $(B)/gen/registry.c $(B)/gen/method_names.c $(B)/gen/shaders.c $(B)/gen/www.c

obj = $(patsubst %.c,$(B)/obj/%.o,$(1))
API_OBJ    := $(call obj,$(API_SRC)) $(B)/obj/gen/method_names.o
GPU_OBJ    := $(call obj,$(GPU_SRC)) $(B)/obj/gen/registry.o $(B)/obj/gen/shaders.o
SERVER_OBJ := $(call obj,$(filter-out server/main.c,$(SERVER_SRC))) $(B)/obj/gen/www.o
MAIN_OBJ   := $(B)/obj/server/main.o

.PHONY: all
all: $(B)/welkin

$(B)/welkin: $(MAIN_OBJ) $(SERVER_OBJ) $(GPU_OBJ) $(API_OBJ)
	@echo "  LINK $@"; $(CC) $(LDFLAGS_ALL) -o $@ $^ $(LIBS)

$(B)/obj/gen/%.o: $(B)/gen/%.c $(B)/flags
	@mkdir -p $(@D)
	@echo "  CC   $<"; $(CC) $(CFLAGS_ALL) -c -o $@ $<
$(B)/obj/%.o: %.c $(B)/flags
	@mkdir -p $(@D)
	@echo "  CC   $<"; $(CC) $(CFLAGS_ALL) -c -o $@ $<

# Rebuild everything when compiler or flags change, nothing otherwise.
FLAGS_NOW = $(CC) $(CFLAGS_ALL) $(LDFLAGS_ALL)
.PHONY: FORCE
$(B)/flags: FORCE
	@mkdir -p $(B)/gen
	@echo '$(subst ','\'',$(FLAGS_NOW))' | cmp -s - $@ || echo '$(subst ','\'',$(FLAGS_NOW))' > $@

# ---- generated ----
$(B)/gen/revision.h: FORCE
	@mkdir -p $(@D)
	@echo '#define WELKIN_REVISION "$(REVISION)"' | cmp -s - $@ || echo '#define WELKIN_REVISION "$(REVISION)"' > $@
$(B)/obj/server/version.o: $(B)/gen/revision.h

# One C array per file: bytes, NUL-terminated, with the name it is looked up by.
define embed
	@mkdir -p $(@D)
	@{ echo '#include "api/embed.h"'; i=0; \
	  for f in $(2); do i=$$((i+1)); printf 'static const unsigned char file%d[] = {' $$i; \
	    od -An -v -tu1 $$f | sed 's/[0-9][0-9]*/&,/g'; echo '0 };'; done; \
	  echo 'const struct embedded_file $(1)[] = {'; i=0; \
	  for f in $(2); do i=$$((i+1)); printf '\t{ "%s", file%d, sizeof file%d - 1 },\n' "$${f#*$(3)}" $$i $$i; done; \
	  echo '	{ 0, 0, 0 },'; echo '};'; } > $@
endef

$(B)/gen/shaders.c: $(SHADERS) Makefile
	$(call embed,welkin_embedded_shaders,$(SHADERS),shaders/)
$(B)/gen/www.c: $(WWW) Makefile
	$(call embed,welkin_embedded_www,$(WWW),api/www/)
$(B)/gen/registry.c: $(METHOD_SRC) Makefile
	@mkdir -p $(@D)
	@{ echo '#include "gpu/method.h"'; for m in $(METHODS); do echo "extern const struct method method_$$m;"; done; \
	  echo 'const struct method *welkin_methods[WELKIN_METHODS_MAX + 1] = {'; for m in $(METHODS); do echo "	&method_$$m,"; done; \
	  echo '	0,'; echo '};'; echo 'int welkin_method_count = $(words $(METHODS));'; } > $@
$(B)/gen/method_names.c: $(METHOD_SRC) Makefile
	@mkdir -p $(@D)
	@{ echo '#include "api/api.h"'; echo 'const char *welkin_method_names[WELKIN_METHODS_MAX + 1] = {'; \
	  for m in $(METHODS) auto; do echo "	\"$$m\","; done; echo '	0,'; echo '};'; } > $@

# ---- tests ----
# tests/test_*.c: one cmocka program each, linked with everything but main. tests/lib_*.c: what they share.
TEST_SRC  := $(sort $(wildcard tests/test_*.c))
TEST_BIN  := $(patsubst tests/%.c,$(B)/tests/%,$(TEST_SRC))
TEST_LIB  := $(call obj,$(sort $(wildcard tests/lib_*.c)))
TEST_LIBS  = $(shell pkg-config --libs $(TEST_PKGS) 2>/dev/null)

$(B)/tests/%: $(B)/obj/tests/%.o $(TEST_LIB) $(SERVER_OBJ) $(GPU_OBJ) $(API_OBJ)
	@mkdir -p $(@D)
	@echo "  LINK $@"; $(CC) $(LDFLAGS_ALL) -o $@ $^ $(LIBS) $(TEST_LIBS)

PROGRAMS  := bench_madrid bench_clouds scene_error cloud_light cloud_scenes soak bench_probe bench_encode bench_frames accuracy chart failures
.PHONY: tests programs
tests: $(TEST_BIN) $(B)/welkin
programs: $(PROGRAMS:%=$(B)/tests/%) $(B)/welkin

# ---- fuzzers: libFuzzer, AddressSanitizer and UndefinedBehaviorSanitizer; of api/ and of what reads scenes ----
FUZZ_SECONDS ?= 600
$(B)-fuzz/fuzz_%: tests/fuzz_%.c tests/fuzz_check.h $(API_SRC) $(B)/gen/method_names.c
	@mkdir -p $(@D)
	clang -std=gnu17 -O1 -g -I. -D_GNU_SOURCE $(PKG_CFLAGS) -fsanitize=fuzzer,address,undefined \
	  -fno-sanitize-recover=all -o $@ $< $(API_SRC) $(B)/gen/method_names.c -lcjson -lnova -lm -lpthread
SCENE_SRC := $(sort $(wildcard server/scene_*.c)) server/mesh_build.c gpu/mesh.c api/error.c api/text.c
SCENE_SRC := $(filter-out server/scene_mesh.c,$(SCENE_SRC))
$(B)-fuzz/fuzz_scene: tests/fuzz_scene.c $(SCENE_SRC)
	@mkdir -p $(@D)
	clang -std=gnu17 -O1 -g -I. -D_GNU_SOURCE $(PKG_CFLAGS) -fsanitize=fuzzer,address,undefined \
	  -fno-sanitize-recover=all -o $@ $< $(SCENE_SRC) -larchive -lpng -lcjson -lm
.PHONY: fuzz fuzz-smoke
fuzz: $(B)-fuzz/fuzz_query $(B)-fuzz/fuzz_json $(B)-fuzz/fuzz_scene
	@cd $(B)-fuzz && for t in query json scene; do mkdir -p new_$$t; ./fuzz_$$t -max_total_time=$(FUZZ_SECONDS) -max_len=4096 \
	  -timeout=20 -print_final_stats=1 new_$$t $(CURDIR)/tests/corpus/$$t 2>fuzz_$$t.log || { tail -40 fuzz_$$t.log; exit 1; }; \
	  echo "fuzz_$$t: $$(sed -n 's/^stat::number_of_executed_units: *//p' fuzz_$$t.log) inputs in $(FUZZ_SECONDS) s, no fault"; done
fuzz-smoke:
	@$(MAKE) --no-print-directory fuzz FUZZ_SECONDS=30

# ---- two commands ----
RUN_DEPS   := build-essential pkg-config libmicrohttpd-dev libepoxy-dev libegl-dev libgl1-mesa-dri libegl-mesa0 libpng-dev \
              libdeflate-dev libopenexr-dev libnova-dev libsystemd-dev libinih-dev libcjson-dev \
              libarchive-dev libseccomp-dev nettle-dev
CHECK_DEPS := $(RUN_DEPS) git curl libcmocka-dev libcurl4-openssl-dev libgsl-dev gnuplot-nox clang libclang-rt-14-dev clang-format \
              assimp-testmodels cppcheck glslang-tools openexr pngcheck prometheus chromium chromium-driver python3-jsonschema \
              openapi-specification python3-yaml python3-requests haproxy varnish systemd

# Installs what is missing of the named packages; without root or sudo it prints the line to type.
define install_missing
	@missing=; for p in $(1); do \
	  [ "$$(dpkg-query -W -f='$${db:Status-Status}' $$p 2>/dev/null)" = installed ] || missing="$$missing $$p"; done; \
	[ -z "$$missing" ] || { line="apt-get install -y --no-install-recommends$$missing"; \
	  if [ "$$(id -u)" = 0 ]; then apt-get update -q && DEBIAN_FRONTEND=noninteractive $$line; \
	  elif sudo -n true 2>/dev/null; then sudo apt-get update -q && sudo DEBIAN_FRONTEND=noninteractive $$line; \
	  else echo "Packages are missing. As root, type:"; echo "  apt-get update && $$line"; exit 1; fi; }
endef

.PHONY: run check deps-run deps-check
deps-run:
	$(call install_missing,$(RUN_DEPS))
deps-check:
	$(call install_missing,$(CHECK_DEPS))

LISTEN ?= 127.0.0.1:8080
ADMIN  ?= 127.0.0.1:8081
run: deps-run
	@$(MAKE) --no-print-directory $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$$(nproc)) all
	@echo "Starting. First it compiles shaders and fills tables, which takes ten seconds without a GPU; then it names its URL."
	exec $(B)/welkin serve --listen $(LISTEN) --admin $(ADMIN) $(ARGS)

check: deps-check
	@tests/check.sh

# ---- tools that measure ----
.PHONY: bench bench-clouds soak smoke fit fit-spectrum blue-noise accuracy
bench: programs
	@status=0; for p in bench_encode bench_frames bench_probe; do $(B)/tests/$$p || status=1; done; exit $$status
.PHONY: bench-madrid
bench-madrid: $(B)/tests/bench_madrid
	$(B)/tests/bench_madrid
# Whole pictures of a scene against the path tracer, and where they differ.
.PHONY: scene-error
scene-error: $(B)/tests/scene_error
	@mkdir -p $(B)/scene-error
	$(B)/tests/scene_error $(B)/scene-error
# What each saving of the march through clouds saves, and costs in accuracy.
bench-clouds: $(B)/tests/bench_clouds
	$(B)/tests/bench_clouds
soak: programs
	$(B)/tests/soak
smoke: programs $(B)/octaves/cloud_light.glsl
	$(B)/tests/soak --smoke
	$(B)/tests/bench_probe --smoke
	$(B)/tests/bench_frames --smoke
	$(B)/tests/cloud_light --smoke
	$(B)/tests/cloud_scenes --smoke --octaves $(B)/octaves
	$(B)/tests/bench_madrid --smoke
	$(B)/tests/scene_error --smoke
	$(B)/tests/bench_clouds --smoke
fit: $(B)/tests/fit_sky
	$(B)/tests/fit_sky gpu/fitted_data.inc
fit-spectrum: $(B)/tests/fit_spectrum
	$(B)/tests/fit_spectrum gpu/spectrum_fit.h
blue-noise: $(B)/tests/blue_noise
	$(B)/tests/blue_noise shaders/blue_noise.glsl
accuracy: $(B)/tests/accuracy
	@mkdir -p $(B)/accuracy
	$(B)/tests/accuracy $(B)/accuracy
	gnuplot -e "folder='$(B)/accuracy'" tests/accuracy.gp

# Light in clouds against Monte Carlo, which is kept for the next time.
.PHONY: cloud-light
cloud-light: $(B)/tests/cloud_light
	@mkdir -p $(B)/cloud-light
	$(B)/tests/cloud_light $(B)/cloud-light

# Whole pictures of clouds against the path tracer, whose own are kept for the next time; beside them the popular octaves.
.PHONY: cloud-scenes
$(B)/octaves/cloud_light.glsl: $(SHADERS) tests/shaders/cloud_octaves.glsl tests/shaders/octaves.glsl
	@mkdir -p $(@D)
	cp -R shaders/. $(@D)
	cp tests/shaders/octaves.glsl $(@D)
	cp tests/shaders/cloud_octaves.glsl $@
cloud-scenes: $(B)/tests/cloud_scenes $(B)/octaves/cloud_light.glsl
	@mkdir -p $(B)/cloud-scenes
	$(B)/tests/cloud_scenes --octaves $(B)/octaves $(B)/cloud-scenes

# Error against milliseconds, and where methods fail. WELKIN_DEVICE names the device; auto by default.
.PHONY: chart chart-update chart-smoke failures failures-smoke
chart: $(B)/tests/chart
	@mkdir -p $(B)/chart
	$(B)/tests/chart $(B)/chart
	gnuplot -e "folder='$(B)/chart'" tests/chart.gp
chart-update:
	cp $(B)/chart/measured.inc gpu/measured.inc
	@mkdir -p deploy/pictures
	cp $(B)/chart/chart.png deploy/pictures/chart.png
chart-smoke: $(B)/tests/chart
	@mkdir -p $(B)/chart-smoke
	$(B)/tests/chart --smoke $(B)/chart-smoke
failures: $(B)/tests/failures
	@mkdir -p $(B)/failures
	$(B)/tests/failures $(B)/failures; status=$$?; \
	gnuplot -e "folder='$(B)/failures'" tests/failures.gp; exit $$status
failures-smoke: $(B)/tests/failures
	@mkdir -p $(B)/failures-smoke
	$(B)/tests/failures --smoke $(B)/failures-smoke
.PHONY: smoke
smoke: chart-smoke failures-smoke

# ---- lint ----
C_FILES := $(API_SRC) $(GPU_SRC) $(SERVER_SRC) $(sort $(wildcard tests/*.c))
H_FILES := $(sort $(wildcard api/*.h gpu/*.h server/*.h tests/*.h))
.PHONY: lint format
lint: $(GEN)
	@clang-format --dry-run -Werror $(C_FILES) $(H_FILES)
	@cppcheck -j2 --quiet --error-exitcode=1 --std=c11 --enable=warning,performance,portability --inline-suppr \
	  --suppressions-list=tests/cppcheck.supp -I. -D_GNU_SOURCE $(API_SRC) $(GPU_SRC) $(SERVER_SRC)
	tests/shader_check.sh shaders
format:
	clang-format -i $(C_FILES) $(H_FILES)

# ---- install ----
.PHONY: install
install: all
	install -D -m 755 $(B)/welkin $(DESTDIR)$(PREFIX)/bin/welkin
	install -d $(DESTDIR)$(PREFIX)/lib/systemd/system
	sed 's,/usr/local/bin,$(PREFIX)/bin,' deploy/welkin.service > $(DESTDIR)$(PREFIX)/lib/systemd/system/welkin.service

.PHONY: clean
clean:
	rm -rf $(B) $(B)-asan $(B)-tsan $(B)-clang $(B)-fuzz

.SECONDARY:
-include $(shell find $(B)/obj -name '*.d' 2>/dev/null)
