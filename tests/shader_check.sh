#!/bin/sh
# Syntax check of every kernel and of what draws, flattened as the program loader does it: includes once each, then
# glslangValidator. usage: shader_check.sh SHADER_DIR
set -eu
dir=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
checked=0
for kernel in $(cd "$dir" && find . -name '*.comp' -o -name '*.vert' -o -name '*.frag' | sort); do
	out=$work/$(echo "$kernel" | tr '/' '_' | sed 's/^\._//')
	{
		printf '#version 450\n#define WELKIN_GLSL 1\n'
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
			BEGIN { emit(ARGV[1]); exit }' "$dir/$kernel"
	} > "$out"
	if ! glslangValidator -S "${kernel##*.}" "$out" > "$work/log"; then
		echo "$kernel:"
		cat "$work/log"
		exit 1
	fi
	checked=$((checked + 1))
done
echo "shader syntax: $checked shaders pass glslangValidator"
