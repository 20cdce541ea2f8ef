/*
 * Depth of the mesh from the sun along each plane's line (shafts.glsl), and minima and maxima over blocks of 2, 4, … samples:
 * an invocation for every block of the largest size.
 */
#include "shafts.glsl"

layout(local_size_x = 32, local_size_y = 2) in;
layout(rg32f, binding = 0) uniform writeonly image2D table;

const int BLOCK = 1 << SHAFT_LEVELS;

void main()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (at.x >= SHAFT_DEPTHS / BLOCK || at.y >= SHAFT_PLANES)
		return;
	float phi = surfaces.shaft_phi + mix(surfaces.shaft_range.z, surfaces.shaft_range.w, float(at.y) / float(SHAFT_PLANES - 1));
	vec2 line = shaft_line(phi), lowest[BLOCK];
	int row = shaft_row();
	vec2 start = vec2(surfaces.shadow_row[row].w, surfaces.shadow_row[row + 1].w);
	vec2 per_m = vec2(length(surfaces.shadow_row[row].xyz) * cos(phi), length(surfaces.shadow_row[row + 1].xyz) * sin(phi));
	for (int i = 0; i < BLOCK; i++) {
		float s = mix(line.x, line.y, (float(at.x * BLOCK + i) + 0.5) / float(SHAFT_DEPTHS));
		float depth = line.y > line.x ? textureLod(shadow_depth, vec3(start + s * per_m, float(surfaces.shadow_cascades - 1)), 0.0).r : 1e9;
		depth = depth >= 1.0 ? 1e9 : depth; /* nothing there throws a shadow */
		lowest[i] = vec2(depth);
		imageStore(table, ivec2(at.x * BLOCK + i, at.y), vec4(depth, depth, 0.0, 0.0));
	}
	for (int level = 1; level <= SHAFT_LEVELS; level++)
		for (int i = 0; i < BLOCK >> level; i++) {
			lowest[i] = vec2(min(lowest[2 * i].x, lowest[2 * i + 1].x), max(lowest[2 * i].y, lowest[2 * i + 1].y));
			imageStore(table, ivec2(shaft_level(level) + at.x * (BLOCK >> level) + i, at.y), vec4(lowest[i], 0.0, 0.0));
		}
}
