#ifndef WELKIN_GPU_MEASURED_H
#define WELKIN_GPU_MEASURED_H

/*
 * What every method was measured to err and to cost over the calibration scenes of tests/chart/: data of the
 * product, made by `make chart` and put in place by `make chart-update` (gpu/measured.inc). One device.
 */

struct measured_scene {
	const char *name;
	double sun_elevation_deg, altitude_m;
	double aerosol_depth; /* vertical optical depth at 550 nm, from sea level */
	double albedo;        /* at 550 nm */
};

struct measured_point {
	int scene; /* index into welkin_measured_scenes */
	const char *method;
	int steps, light_steps; /* 0: it doesn't read them */
	double goal;            /* progressive methods: accuracy.max_error; 0 for others */
	int in_domain;          /* of the method */
	double error,
		uncertainty; /* relative RMSE of luminance, without the reference's noise, and its standard error */
	double p99, delta_e; /* 99th percentile of the relative error; mean CIEDE2000; noise included */
	double frame_ms;     /* device time of a frame however small: its tables among it */
	double mpixel_ms;    /* and of a million pixels */
	double first_ms;     /* tables of an atmosphere that is new to the daemon */
};

extern const char welkin_measured_device[];                  /* "" where nothing was measured */
extern const struct measured_scene welkin_measured_scenes[]; /* ends with a NULL name */
extern const struct measured_point welkin_measured[]; /* ends with a NULL method; sorted by scene, method, setting */

/* Device time of a frame of so many pixels. */
double measured_ms(const struct measured_point *point, double pixels);

#endif
