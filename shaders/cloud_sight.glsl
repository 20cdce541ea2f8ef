/* What a pixel of the strip shows of clouds: as the march left it, or, KEPT, as the frame keeps it for the next (cloud_history.glsl). */
#include "cloud_lattice.glsl"

#ifdef KEPT
layout(binding = UNIT_CLOUD_KEPT) uniform samplerBuffer cloud_kept_texels; /* of two the first is a pixel's light */
layout(binding = UNIT_CLOUD_KEPT_WORDS) uniform usamplerBuffer cloud_kept_words;

vec4 cloud_light_of(int i, ivec2 pixel)
{
	return texelFetch(cloud_kept_texels, 2 * (pixel.y * frame.width + pixel.x));
}

vec4 cloud_place_of(int i, ivec2 pixel)
{
	return place_unpack(texelFetch(cloud_kept_words, pixel.y * frame.width + pixel.x).zw);
}
#else
layout(binding = UNIT_CLOUD_LIGHT_OF_RAYS) uniform samplerBuffer cloud_light_texels;
layout(binding = UNIT_CLOUD_PLACE) uniform samplerBuffer cloud_place_texels;

/* i: the pixel's number in the strip, and beyond those the other sides'. */
vec4 cloud_light_of(int i, ivec2 pixel)
{
	return texelFetch(cloud_light_texels, i);
}

vec4 cloud_place_of(int i, ivec2 pixel)
{
	return texelFetch(cloud_place_texels, i);
}
#endif
