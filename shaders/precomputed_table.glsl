/*
 * The four-dimensional scattering table: what a ray brings, for every altitude, view and sun (Bruneton & Neyret
 * 2008). Different from theirs:
 *   - the third angle is the azimuth between view and sun, not the cosine nu between them, so every texel is a
 *     ray that exists;
 *   - sunlight that the air scattered once is divided by a blend of Rayleigh's phase function and a constant, which leaves
 *     little variation over azimuth for its few samples to miss (theirs err by up to 9 % there), and sunlight that the
 *     aerosol scattered once by all of its own;
 *   - values are kept as log2, since twilight falls e-fold within a degree or two;
 *   - rays are followed through the multiple-scattering table, so there is no loop over orders.
 * A 3-D texture: x the sun's elevation (axis of multiple_table.glsl), y the angle from the horizon (axis of sky_view.glsl
 * inside the air), z altitude within a slab; slabs by azimuth, first of the smooth part, then of the aerosol's.
 */
const float PRECOMPUTED_FLOOR = 1e-30;

/* What the smooth part is divided by. */
float azimuth_shape(float nu)
{
	return 1.0 + 0.7 * nu * nu;
}

/* How much there is to scatter along a ray, between 0 and 1: what the aerosol's part, and above the horizon the smooth part, are
 * divided by, so that rays which soon meet the ground or leave the air have values to interpolate and no
 * logarithm of 0. */
float path_opacity(float h, float mu, bool below)
{
	float amount = below ? ray_ground_distance(h, mu) * 1e-4 : sun_column(h, mu).x * 1e-3;
	return 1.0 - exp(-max(amount, 1e-6));
}

/* Altitudes that the table is filled for: at the very bottom and top some rays have no length, and in its last rows
 * the optical-depth table has no digits. */
float precomputed_altitude(float h)
{
	return clamp(h, 0.5, media.top * 0.984);
}

/* Angle of the ray that grazes the ground from altitude h, from the zenith. */
float horizon_angle(float h)
{
	return 0.5 * PI + atan(grazing_distance(h), media.planet_radius);
}
