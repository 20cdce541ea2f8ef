/*
 * How a surface of the scene looks: light of the sun and of the sky on it, per band, and what of both it sends to the
 * viewer. Irradiance comes from the optical-depth and multiple-scattering tables; both belong to the delta-scaled medium
 * (multiple_table.glsl), so that the sun's aureole counts with the sun.
 */
#include "surface_material.glsl"
#include "multiple_table.glsl"

/* Reflectance at the bands' wavelengths of a Rec.709 colour: three curves that add up to one, so that grey stays grey. */
vec4 spectral_albedo(vec3 rgb)
{
	return rgb.b * bands.blue + rgb.r * bands.red + rgb.g * (1.0 - bands.blue - bands.red);
}

/* Irradiance from sky and ground on a plane with normal n at altitude h, per sun irradiance of 1: the cosine lobe's
 * expansion to degree 2 (Ramamoorthi & Hanrahan 2001) on the table's moments, with the level plane's exact value put in; that
 * is `level`. */
vec4 sky_irradiance(float h, vec3 up, vec3 n, out vec4 level)
{
	float mu_s = clamp(dot(up, frame.sun_direction.xyz), -1.0, 1.0), nz = dot(n, up);
	float nx = (dot(n, frame.sun_direction.xyz) - nz * mu_s) * inversesqrt(max(1.0 - mu_s * mu_s, 1e-6));
	nx = clamp(nx, -1.0, 1.0);
	vec2 uv = multiple_from_point(h, mu_s);
	/* relative to the radiance from all around, as the table has them */
	vec4 m0 = exp2(multiple_layer(uv, 0)), m_xx = multiple_layer(uv, 1), m_zz = multiple_layer(uv, 2);
	vec4 m_xz = multiple_layer(uv, 3), v_x = multiple_layer(uv, 4), v_z = multiple_layer(uv, 5), exact = multiple_layer(uv, 6);
	float xx = min(nx * nx, 1.0 - min(nz * nz, 1.0)), yy = max(1.0 - nz * nz - xx, 0.0);
	vec4 q = m_xx * xx + (1.0 - m_xx - m_zz) * yy + m_zz * (nz * nz) + m_xz * (2.0 * nx * nz);
	const float c0 = 0.25 - 5.0 / 32.0, c2 = 15.0 / 32.0;
	vec4 E = c0 + 0.5 * (v_x * nx + v_z * nz) + c2 * q, E_level = c0 + 0.5 * v_z + c2 * m_zz;
	level = m0 * exact;
	return m0 * max(E + (exact - E_level) * max(nz, 0.0), 0.0);
}

struct Lighting {
	vec3 n, v, l;   /* normal, to the viewer, to the sun */
	vec4 sun;       /* irradiance facing the sun, W/m²/nm, without shadow */
	vec4 sky;       /* irradiance on the surface */
	vec4 level_sky; /* on level ground */
	float lit;      /* share of the sun that is seen */
	float level_sun; /* cosine of the sun to the vertical, 0 below the horizon */
	float rise;      /* cosine of the normal to the vertical */
	float open;
};

float ggx_visibility(float alpha, float nl, float nv)
{
	float a2 = alpha * alpha;
	return 0.5 / max(nl * sqrt(a2 + nv * nv * (1.0 - a2)) + nv * sqrt(a2 + nl * nl * (1.0 - a2)), 1e-6);
}

/* Specular BRDF (Trowbridge & Reitz, Smith, Schlick) of Phong's exponent. */
vec3 specular_brdf(Material m, Lighting light)
{
	vec3 h = normalize(light.l + light.v);
	float nh = clamp(dot(light.n, h), 0.0, 1.0), nl = max(dot(light.n, light.l), 0.0), nv = max(dot(light.n, light.v), 1e-3);
	float a2 = 2.0 / (max(m.diffuse.w, 0.0) + 2.0), d = nh * nh * (a2 - 1.0) + 1.0;
	vec3 fresnel = m.specular.rgb + (1.0 - m.specular.rgb) * pow(1.0 - clamp(dot(light.l, h), 0.0, 1.0), 5.0) * step(1e-6, dot(m.specular.rgb, vec3(1.0)));
	return fresnel * (a2 / (PI * d * d) * ggx_visibility(sqrt(a2), nl, nv));
}

/*
 * Radiance towards the viewer; MATTE, chosen when the program is built: no material has a highlight. The table's light from below is that of endless level ground; around a surface of the scene there
 * is more of the scene. So what the surface sees below the horizon, and what hides the sky from it, are taken to be of its own colour
 * and lit or shadowed like it, under no more open sky, with light between them to and fro; of what stands up against the sky half is
 * lit, and of what lies below as much as the sky is open. Without these shares of the sky, walls of the built-in city in the sun at 45
 * degrees were 8 to 15 % brighter than by paths, with them 0 to 8 %.
 */
vec4 shade_physical(Material m, vec3 albedo, Lighting light)
{
	vec4 rho = spectral_albedo(albedo), level_sun = light.level_sun * light.sun;
	float nl = max(dot(light.n, light.l), 0.0), below = 0.5 - 0.5 * clamp(light.rise, -1.0, 1.0);
	vec4 from_above = max(light.sky - below * bands.ground_albedo * (light.level_sky + level_sun), 0.0);
	vec4 around = rho * light.open / (1.0 - rho * (1.0 - light.open));
	vec4 from_below = below * around * (light.level_sky + light.open * light.lit * level_sun);
	vec4 hidden = (1.0 - below) * around * (light.level_sky + 0.5 * light.lit * level_sun);
	vec4 E = mix(hidden, from_above, light.open) + from_below, direct = light.sun * (light.lit * nl);
#ifdef MATTE
	return rho * (E + direct) / PI;
#else
	vec4 glint = spectral_albedo(clamp(specular_brdf(m, light), 0.0, 1e3));
	return rho * (E + direct) / PI + glint * direct;
#endif
}

/* Madrid 2015: ambient and diffuse by the texture, the smaller of shadow and diffuse, a highlight. */
vec4 shade_phong(Material m, vec3 albedo, Lighting light)
{
	float nl = max(dot(light.n, light.l), 0.0), shine = max(dot(reflect(-light.l, light.n), light.v), 0.0);
	vec4 texel = spectral_albedo(albedo), ambient = spectral_albedo(m.ambient.rgb);
	vec4 highlight = spectral_albedo(m.specular.rgb) * (pow(shine, max(m.diffuse.w, 1.0)) * light.lit * step(1e-6, nl));
	return (ambient * texel * light.level_sky + light.sun * (texel * min(light.lit, nl) + highlight)) / PI;
}
