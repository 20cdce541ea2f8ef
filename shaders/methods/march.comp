/* Nested ray march: the column to the sun is integrated anew at every step. */
#include "sky.glsl"
#include "scatter_sky.glsl"

vec3 sun_column(float h, float mu_s)
{
	return column_to_top(h, mu_s, RULE_LIGHT);
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	scatter_sky(ray, L, T);
}
