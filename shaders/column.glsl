/*
 * Columns: the integral of each medium's density along a ray, in m.
 */
#include "atmosphere.glsl"

layout(std430, binding = BIND_NODES) readonly buffer Nodes { vec2 node[]; };

/* A stretch of a ray on which altitude rises or falls throughout, from t = start over extent. The
 * dense end gets more samples: t - start = extent·s² from a dense start, mirrored for a dense
 * end. fall is true for a dense end. */
struct Piece {
	float start, extent;
	bool fall;
};

/* Position on the piece of a node at s in [0,1]; jacobian is dt/ds. */
float piece_position(Piece piece, float s, out float jacobian)
{
	float u = piece.fall ? 1.0 - s : s;
	jacobian = 2.0 * u * piece.extent;
	float x = u * u * piece.extent;
	return piece.start + (piece.fall ? piece.extent - x : x);
}

vec3 piece_sample(float h, float mu, Piece piece, vec2 n)
{
	float jacobian, t = piece_position(piece, n.x, jacobian);
	return density_at(altitude_at(h, mu, t)) * (n.y * jacobian);
}

/* Eight nodes a turn: llvmpipe ends an invocation's loops after 65,535 turns in all, without a word
 * (LP_MAX_TGSI_LOOP_ITERATIONS), which a march of 256 x 256 steps would reach. */
vec3 piece_column(float h, float mu, Piece piece, ivec2 rule)
{
	vec3 sum = vec3(0.0);
	int first = rule.x, end = rule.x + rule.y;
	for (; first + 8 <= end; first += 8)
		for (int i = 0; i < 8; i++)
			sum += piece_sample(h, mu, piece, node[first + i]);
	for (; first < end; first++)
		sum += piece_sample(h, mu, piece, node[first]);
	return sum;
}

/* Column from (h, mu), inside the air, to its top, for a ray that misses the ground. rules: the
 * index of the rule for one piece; the one after it is for two. */
vec3 column_to_top(float h, float mu, int rules)
{
	float extent = ray_top_distance(h, mu);
	if (mu >= 0.0)
		return piece_column(h, mu, Piece(0.0, extent, false), media.rule[rules].xy);
	float lowest = min(-(media.planet_radius + h) * mu, extent);
	ivec2 rule = media.rule[rules + 1].xy;
	return piece_column(h, mu, Piece(0.0, lowest, true), rule) +
	       piece_column(h, mu, Piece(lowest, extent - lowest, false), rule);
}
