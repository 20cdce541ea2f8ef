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

/* A ray from (h, mu) to the top, in one piece or cut at its lowest point; nodes are counted
 * through both. */
struct Climb {
	float h, mu, lowest, extent;
	int first, half_way, count; /* nodes: first of the rule, of the falling piece, of all */
};

/* Nothing past the last node. */
vec3 climb_sample(Climb climb, int i)
{
	bool down = i < climb.half_way;
	int at = down ? i : i - climb.half_way;
	Piece piece = Piece(down ? 0.0 : climb.lowest, down ? climb.lowest : climb.extent - climb.lowest, down);
	vec2 n = i < climb.count ? node[climb.first + at] : vec2(0.0);
	return piece_sample(climb.h, climb.mu, piece, n);
}

vec3 climb_four(Climb climb, int i)
{
	return climb_sample(climb, i) + climb_sample(climb, i + 1) + climb_sample(climb, i + 2) + climb_sample(climb, i + 3);
}

/* Column from (h, mu), inside the air, to its top, for a ray that misses the ground. rules: the
 * index of the rule for one piece; the one after it is for two.
 *
 * llvmpipe ends an invocation's loops after 65,535 turns in all, without a word
 * (LP_MAX_TGSI_LOOP_ITERATIONS), and counts the turns of all lanes that run together. 512 x 512
 * steps fit in when a turn does sixteen nodes, written out (a loop would count unless the compiler
 * unrolls it), and when rays of one and of two pieces share one loop. */
vec3 column_to_top(float h, float mu, int rules)
{
	float extent = ray_top_distance(h, mu);
	bool bent = mu < 0.0;
	ivec2 rule = media.rule[rules + int(bent)].xy;
	float lowest = bent ? min(-(media.planet_radius + h) * mu, extent) : 0.0;
	Climb climb = Climb(h, mu, lowest, extent, rule.x, bent ? rule.y : 0, bent ? 2 * rule.y : rule.y);
	vec3 sum = vec3(0.0);
	for (int i = 0; i < climb.count; i += 16)
		sum += climb_four(climb, i) + climb_four(climb, i + 4) + climb_four(climb, i + 8) + climb_four(climb, i + 12);
	return sum;
}
