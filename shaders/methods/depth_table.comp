/* Ray march with the column to the sun from the optical-depth table. */
#include "sky.glsl"
#include "scatter_sky.glsl"
#include "sun_column.glsl"

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	scatter_sky(ray, L, T);
}
