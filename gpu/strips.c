#include "gpu/strips.h"

#include "shaders/shared.h"

static int at_most(int a, int b)
{
	return a < b ? a : b;
}

static int whole_groups(int n, int group)
{
	return n < group ? group : n / group * group;
}

bool strips_done(const struct strips *strips)
{
	return strips->y >= strips->height;
}

/* Rows from the band's first on to where another one has to begin. */
static int rows_left(const struct strips *strips)
{
	if (strips->y < strips->from && strips->from < strips->to)
		return strips->from - strips->y;
	return (strips->y < strips->to ? strips->to : strips->height) - strips->y;
}

void strips_next(struct strips *strips, int max_pixels, int tile[4])
{
	if (strips->rows == 0)
		strips->rows = at_most(whole_groups(max_pixels / strips->width, WORKGROUP_Y), rows_left(strips));
	int columns = strips->width - strips->x;
	if ((double)columns * strips->rows > max_pixels)
		columns = at_most(whole_groups(max_pixels / strips->rows, WORKGROUP_X), columns);
	tile[0] = strips->x;
	tile[1] = strips->y;
	tile[2] = columns;
	tile[3] = strips->rows;
	strips->x += columns;
	if (strips->x < strips->width)
		return;
	strips->x = 0;
	strips->y += strips->rows;
	strips->rows = 0;
}

double strips_left(const struct strips *strips)
{
	return (double)strips->width * (strips->height - strips->y) - (double)strips->x * strips->rows;
}
