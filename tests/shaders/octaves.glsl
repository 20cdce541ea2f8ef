/*
 * The popular approximation of multiple scattering, to compare with: the octaves of Wrenninge et al. 2013, eight, each of half the
 * scattering, extinction and anisotropy of the last. Per unit of optical depth and sun irradiance of 1.
 */
float octaves(float sun_depth, float nu)
{
	float sum = 0.0, a = 1.0;
	for (int i = 0; i < 8; i++) {
		sum += a * exp(-a * sun_depth) * mix(phase_henyey_greenstein(a * clouds.forward_g, nu),
			phase_henyey_greenstein(a * clouds.backward_g, nu), clouds.backward_share);
		a *= 0.5;
	}
	return clouds.albedo * sum;
}
