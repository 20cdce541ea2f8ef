/*
 * Where paths need not look: for each cell of boxes around the camera an extinction that is hardly ever exceeded, so
 * that delta tracking takes long steps through clear air. A box is MAJORANT_ACROSS cells wide, cells of each level
 * CLOUD_GRID_GROWTH times as wide as those of the one before; the last reaches to where the horizon hides the layer.
 *
 * A majorant is the largest of samples, not a bound, and the paths are weighted so that they are right all the same.
 * Only 0 must be true.
 */
#include "cloud_density.glsl"

/* Side of the finest cells, m: as high as cells are, within reason. */
float majorant_side()
{
	return clamp((clouds.top - clouds.bottom) / 20.0, 60.0, 100.0);
}

float majorant_cell_height()
{
	return (clouds.top - clouds.bottom) / float(MAJORANT_UP);
}

/* The finest level that holds a point so far off, east or south; MAJORANT_LEVELS: none does. */
int majorant_level(float off)
{
	float halves = off / (0.5 * float(MAJORANT_ACROSS) * majorant_side());
	return clamp(int(ceil(log2(max(halves, 1e-3)) / log2(CLOUD_GRID_GROWTH))), 0, MAJORANT_LEVELS);
}

/* A cell's sides: east, south, up. */
vec3 majorant_cell(int level)
{
	float side = majorant_side() * pow(CLOUD_GRID_GROWTH, float(level));
	return vec3(side, side, majorant_cell_height());
}

/* From cells (east, south, up) of a level to cloud space. */
vec3 majorant_point(vec3 place, int level)
{
	vec3 p = (place - vec3(0.5 * float(MAJORANT_ACROSS), 0.5 * float(MAJORANT_ACROSS), 0.0)) * majorant_cell(level);
	return vec3(p.x, p.z + clouds.bottom, p.y);
}
