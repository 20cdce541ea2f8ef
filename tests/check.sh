#!/bin/sh
# What `make check` runs after its packages are there. Every step prints what it ran; the first
# failure ends it.
set -eu
cd "$(dirname "$0")/.."
jobs=$(nproc)
started=$(date +%s)

step() {
	printf '\n== %s (%d s)\n' "$1" "$(($(date +%s) - started))"
}

# Runs every cmocka program of a build, one after the other: they time things.
run_tests() {
	build=$1
	shift
	for test in "$@"; do
		echo "-- $test"
		WELKIN_BIN=$build/welkin "$build/tests/$test"
	done
}

all_tests() {
	for source in tests/test_*.c; do basename "$source" .c; done
}

step "build with gcc"
make -j"$jobs" --no-print-directory all tests programs

step "lint: clang-format, cppcheck, shader syntax"
make --no-print-directory lint

step "build with clang"
make -j"$jobs" --no-print-directory B=build-clang CC=clang all

step "tests"
run_tests build $(all_tests)

step "tests under AddressSanitizer and UndefinedBehaviorSanitizer"
make -j"$jobs" --no-print-directory B=build-asan SANITIZER=address,undefined OPT='-O1 -g' all tests
export ASAN_OPTIONS=detect_leaks=1:abort_on_error=0 LSAN_OPTIONS=suppressions=tests/lsan.supp:print_suppressions=0
run_tests build-asan $(all_tests | grep -v -x -f tests/asan_skip.txt)
# It reads what the renderer says at its end, where the leak checker may name 128 bytes of a driver that is no longer loaded.
ASAN_OPTIONS=detect_leaks=0 run_tests build-asan test_render_command
unset ASAN_OPTIONS LSAN_OPTIONS

step "tests with threads under ThreadSanitizer"
threaded="test_cache test_queue test_sun test_png test_exr test_http"
make -j"$jobs" --no-print-directory B=build-tsan SANITIZER=thread OPT='-O1 -g' all $(printf 'build-tsan/tests/%s ' $threaded)
# gcc 12's runtime does not start where the kernel spreads addresses wider than Debian 12's does.
if build-tsan/welkin --version >/dev/null 2>&1; then
	run_tests build-tsan $threaded
else
	echo "skipped: ThreadSanitizer does not start on this kernel (vm.mmap_rnd_bits above 28)"
fi

step "deployment files"
tests/deploy_check.sh build/welkin

step "install"
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
make --no-print-directory install DESTDIR="$root" PREFIX=/opt/welkin
"$root/opt/welkin/bin/welkin" --version
grep -qx 'ExecStart=/opt/welkin/bin/welkin serve' "$root/opt/welkin/lib/systemd/system/welkin.service"

step "fuzz smoke"
make --no-print-directory fuzz-smoke

step "smoke of the long programs"
make --no-print-directory smoke

step "done"
