/*
 * The grids on which light in clouds is worked out: CLOUD_GRID_LEVELS boxes around the camera's footprint that share the
 * layer's height, the cells of each CLOUD_GRID_GROWTH times as wide as those of the one before. A level's place
 * p = (x, z, h) is in cells; textures have the levels one above the other.
 *
 * Light is worked out in a scaled medium: the share f = g of what is scattered counts as not deflected (van de Hulst's
 * similarity: what then scatters, scatters isotropically), so extinction is smaller by cloud_light_scale().
 */
#include "cloud_density.glsl"

layout(binding = UNIT_CLOUD_CELLS) uniform sampler3D cloud_cells_texture;

const float CLOUD_GRID_DEPTH = float(CLOUD_GRID_UP * CLOUD_GRID_LEVELS);

/* Share of scattering that is regarded as straight on: the mean cosine. */
float cloud_straight_share()
{
	return max(mix(clouds.forward_g, clouds.backward_g, clouds.backward_share), 0.0);
}

/* Scaled over true extinction. */
float cloud_light_scale()
{
	return 1.0 - clouds.albedo * cloud_straight_share();
}

/* Albedo of the scaled medium. */
float cloud_light_albedo()
{
	float f = cloud_straight_share();
	return clouds.albedo * (1.0 - f) / max(1.0 - clouds.albedo * f, 1e-6);
}

/* A cell's sides: east, south, up, in m. */
vec3 cloud_grid_cell(int level)
{
	float side = clouds.grid[level].z;
	return vec3(side, side, (clouds.top - clouds.bottom) / float(CLOUD_GRID_UP));
}

vec3 cloud_grid_place(vec3 q, int level)
{
	return (q.xzy - vec3(clouds.grid[level].xy, clouds.bottom)) / cloud_grid_cell(level);
}

vec3 cloud_grid_point(vec3 place, int level)
{
	return (vec3(clouds.grid[level].xy, clouds.bottom) + place * cloud_grid_cell(level)).xzy;
}

/* Texture coordinates of a place; neighbours of other levels don't bleed in. */
vec3 cloud_grid_coordinates(vec3 place, int level)
{
	float h = clamp(place.z, 0.5, float(CLOUD_GRID_UP) - 0.5) + float(level * CLOUD_GRID_UP);
	return vec3(place.xy / float(CLOUD_GRID_ACROSS), h / CLOUD_GRID_DEPTH);
}

/* How far a point is from the middle of a level, horizontally: 1 at its sides less half a cell. */
float cloud_grid_reach(vec3 q, int level)
{
	vec2 off = abs(cloud_grid_place(q, level).xy - 0.5 * float(CLOUD_GRID_ACROSS));
	return max(off.x, off.y) / (0.5 * float(CLOUD_GRID_ACROSS) - 0.5);
}

/* The finest level, `least` or above, that holds a point; the last one for all that is farther. */
int cloud_grid_level(vec3 q, int least)
{
	int level = least;
	for (int i = 0; i < CLOUD_GRID_LEVELS - 1; i++)
		level = i >= least && cloud_grid_reach(q, i) > 1.0 ? i + 1 : level;
	return min(level, CLOUD_GRID_LEVELS - 1);
}

/* A point as the grids know it: beyond them, one of the same weather within, since the coarsest level holds a whole weather map. */
vec3 cloud_grid_home(vec3 q)
{
	bool outside = cloud_grid_reach(q, CLOUD_GRID_LEVELS - 1) > 1.0;
	return outside ? vec3(cloud_same_weather(q.xz), q.y).xzy : q;
}

/* 1 within the layer's height, 0 outside. */
float cloud_grid_within(vec3 q)
{
	return step(clouds.bottom, q.y) * step(q.y, clouds.top);
}

/* Distance from q, within the layer, to where d leaves it. */
float cloud_grid_way_out(vec3 q, vec3 d)
{
	return (d.y > 0.0 ? clouds.top - q.y : q.y - clouds.bottom) / max(abs(d.y), 1e-5);
}

/* Distance through a cell along d, through its middle. */
float cloud_grid_crossing(vec3 d, int level)
{
	vec3 rate = abs(d.xzy) / cloud_grid_cell(level);
	return 1.0 / max(rate.x, max(rate.y, rate.z));
}

/* 14 directions: the axes and the diagonals of a cube, weights exact for polynomials of degree 5 (McLaren 1963). The cube is turned so that
 * none is level, which at the bounds of a layer would be neither the cloud's side nor the other, and that they give the share of light that
 * crosses a slab, E2(τ), within 2 % for τ from 0.03 to 3. */
const int CLOUD_DIRECTIONS = 14;
const mat3 CLOUD_CUBE = mat3(0.9192787, 0.1900000, -0.3447124, -0.1955539, 0.9805101, 0.0189386, 0.3415924, 0.0500000, 0.9385173);

vec3 cloud_grid_direction(int i)
{
	if (i < 6)
		return CLOUD_CUBE[i >> 1] * ((i & 1) == 0 ? 1.0 : -1.0);
	return CLOUD_CUBE * vec3((i & 1) == 0 ? 0.57735027 : -0.57735027, (i & 2) == 0 ? 0.57735027 : -0.57735027, (i & 4) == 0 ? 0.57735027 : -0.57735027);
}

float cloud_grid_weight(int i)
{
	return i < 6 ? 1.0 / 15.0 : 3.0 / 40.0;
}

/*
 * The sky that clouds see is the brighter the nearer to its horizon. Its radiance, in units in which its irradiance on level ground is π, is
 *
 *     1 + b (1 / (μ + 0.1) - m),     b = clouds.sky_edge, m such that the irradiance is π.
 *
 * Fitted to clear skies of the earth seen from 1 and 3 km, sun between -3° and 85°: its mean is within 15 % of theirs in luminance, most off where the sun stands high. At
 * the zenith they have 0.3 to 0.8 of their mean, this one 0.35.
 */
const float SKY_EDGE = 0.1, SKY_EDGE_MEAN = 1.5204209;

float cloud_sky(float mu)
{
	return 1.0 + clouds.sky_edge * (1.0 / (max(mu, 0.0) + SKY_EDGE) - SKY_EDGE_MEAN);
}

/* Its mean over the half-sphere. */
float cloud_sky_mean()
{
	return 1.0 + clouds.sky_edge * (log(1.0 / SKY_EDGE + 1.0) - SKY_EDGE_MEAN);
}

/*
 * Rays in the directions of the grid. Those stand for directions up to DIRECTION_WIDTH away in the cosine to the vertical: more than the rise of four of them,
 * so that two opposite ones see about the same. Such a one is two rays, one to the sky, one to the ground, since what is above a cloud's level foot is
 * no sky.
 */
const int CLOUD_RAYS = CLOUD_DIRECTIONS + 4;
const float DIRECTION_WIDTH = 0.3;

/* weight: its share of all directions; outside: radiance of sky and ground in its direction, the ground's is 1. */
vec3 cloud_grid_ray(int i, out float weight, out vec2 outside)
{
	int of = i < CLOUD_DIRECTIONS ? i : i < CLOUD_DIRECTIONS + 2 ? i - CLOUD_DIRECTIONS : i - CLOUD_DIRECTIONS + 2;
	vec3 d = cloud_grid_direction(of);
	float low = max(abs(d.y) - DIRECTION_WIDTH, -1.0), high = min(abs(d.y) + DIRECTION_WIDTH, 1.0), near = max(-low, 0.0) / (high - low);
	weight = cloud_grid_weight(of) * (i < CLOUD_DIRECTIONS ? 1.0 - near : near);
	d.y *= i < CLOUD_DIRECTIONS ? 1.0 : -1.0;
	outside = d.y > 0.0 ? vec2(cloud_sky(d.y), 0.0) : vec2(0.0, 1.0);
	return d;
}
