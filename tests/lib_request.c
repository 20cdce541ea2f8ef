#include "tests/lib_request.h"

#include <math.h>
#include <string.h>

static void set_triple(double out[3], double red, double green, double blue)
{
	out[0] = red;
	out[1] = green;
	out[2] = blue;
}

/* Rayleigh scattering of Bruneton 2017's demo: 1.24062e-6 (λ/µm)⁻⁴ /m. */
static void set_rayleigh_2017(double out[3])
{
	set_triple(out, 1.24062e-6 * pow(0.68, -4), 1.24062e-6 * pow(0.55, -4), 1.24062e-6 * pow(0.44, -4));
}

static void set_earth(struct welkin_request *r)
{
	struct welkin_atmosphere *a = &r->atmosphere;
	double aerosol = 4.44e-6;

	set_rayleigh_2017(a->rayleigh_scattering_per_m);
	set_triple(a->aerosol_scattering_per_m, 0.9 * aerosol, 0.9 * aerosol, 0.9 * aerosol);
	set_triple(a->aerosol_absorption_per_m, 0.1 * aerosol, 0.1 * aerosol, 0.1 * aerosol);
	a->aerosol_g = 0.8;
	a->ozone_column_du = 300;
	set_triple(r->ground_albedo, 0.1, 0.1, 0.1);
	r->sun.spectrum = WELKIN_SUN_SOLAR;
}

static void set_madrid(struct welkin_request *r)
{
	struct welkin_atmosphere *a = &r->atmosphere;

	set_triple(a->rayleigh_scattering_per_m, 5.8e-6, 13.5e-6, 33.1e-6);
	a->rayleigh_scale_height_m = 7994;
	set_triple(a->aerosol_scattering_per_m, 2e-5, 2e-5, 2e-5);
	set_triple(a->aerosol_absorption_per_m, 2e-6, 2e-6, 2e-6);
	a->aerosol_g = 0.76;
}

struct welkin_request request_of(int preset, double altitude_m, double sun_elevation_deg)
{
	struct welkin_request r;
	struct welkin_atmosphere *a = &r.atmosphere;

	memset(&r, 0, sizeof r);
	r.image.width = r.image.height = 64;
	r.image.png_bits = 8;
	r.camera.fov_deg = 60;
	r.camera.altitude_m = r.camera.position_m[1] = altitude_m;
	r.sun.elevation_deg = sun_elevation_deg;
	r.sun.intensity = 1;
	r.sun.angular_radius_deg = 0.2666;
	r.sun.spectrum = WELKIN_SUN_FLAT;
	r.scene.scale = 1;
	r.scene.shadow = WELKIN_SHADOW_GAUSSIAN;
	r.scene.shadow_size = 1024;
	r.scene.shaft_steps = 64;
	a->preset = preset;
	a->spectrum = WELKIN_SPECTRUM_4;
	a->steps = 30;
	a->light_steps = 30;
	a->turbidity = 3;
	a->density_factor = 1;
	a->planet_radius_m = 6360e3;
	a->top_m = 60e3;
	a->rayleigh_scale_height_m = 8000;
	a->aerosol_scale_height_m = 1200;
	a->aerosol_g = 0.8;
	a->aerosol_phase = WELKIN_CORNETTE_SHANKS;
	a->ozone_center_m = 25e3;
	a->ozone_half_width_m = 15e3;
	if (preset == WELKIN_EARTH)
		set_earth(&r);
	else if (preset == WELKIN_MADRID2015)
		set_madrid(&r);
	else
		set_rayleigh_2017(a->rayleigh_scattering_per_m);
	return r;
}

void direction_of(double elevation_deg, double azimuth_deg, double out[3])
{
	double e = elevation_deg * M_PI / 180, z = azimuth_deg * M_PI / 180;

	out[0] = cos(e) * sin(z);
	out[1] = sin(e);
	out[2] = -cos(e) * cos(z);
}
