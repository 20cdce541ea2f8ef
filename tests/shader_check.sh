#!/bin/sh
# Syntax check of every kernel and of what draws, flattened as the program loader does it: includes once each, then
# glslangValidator. Kernels that ask for one of these choices are checked with them as well. usage: shader_check.sh SHADER_DIR
set -eu
dir=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
checked=0
# check SHADER DEFINE
check() {
	out=$work/shader
	{
		printf '#version 450\n#define WELKIN_GLSL 1\n%s\n' "$2"
		awk -v dir="$dir" '
			function emit(path,    line, name) {
				if (path in seen) return
				seen[path] = 1
				while ((getline line < path) > 0) {
					if (line ~ /^#include "/) { name = line; sub(/^#include "/, "", name); sub(/".*/, "", name); emit(dir "/" name) }
					else print line
				}
				close(path)
			}
			BEGIN { emit(ARGV[1]); exit }' "$dir/$1"
	} > "$out"
	if ! glslangValidator -S "${1##*.}" "$out" > "$work/log"; then
		echo "$1 $2:"
		cat "$work/log"
		exit 1
	fi
	checked=$((checked + 1))
}
for kernel in $(cd "$dir" && find . -name '*.comp' -o -name '*.vert' -o -name '*.frag' | sort); do
	check "$kernel" ""
	for choice in CLOUDS SHAFTS SEE_THROUGH LAYER RIDGES; do
		if grep -q "^#ifdef $choice" "$dir/$kernel"; then
			check "$kernel" "#define $choice 1"
		fi
	done
done
echo "shader syntax: $checked shaders pass glslangValidator"
