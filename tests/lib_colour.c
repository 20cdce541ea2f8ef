#include "tests/lib_colour.h"

#include <math.h>

const double colour_d65[3] = { 0.3127 / 0.3290, 1, (1 - 0.3127 - 0.3290) / 0.3290 };

static double lab_f(double t)
{
	return t > 216.0 / 24389 ? cbrt(t) : (24389.0 / 27 * t + 16) / 116;
}

void colour_lab(const double xyz[3], const double white[3], double lab[3])
{
	double x = lab_f(xyz[0] / white[0]), y = lab_f(xyz[1] / white[1]), z = lab_f(xyz[2] / white[2]);

	lab[0] = 116 * y - 16;
	lab[1] = 500 * (x - y);
	lab[2] = 200 * (y - z);
}

void colour_xyz_of_rec709(const double rgb[3], double xyz[3])
{
	static const double m[3][3] = {
		{ 0.4123907992659595, 0.3575843393838780, 0.1804807884018343 },
		{ 0.2126390058715104, 0.7151686787677559, 0.0721923153607337 },
		{ 0.0193308187155918, 0.1191947797946260, 0.9505321522496608 },
	};

	for (int i = 0; i < 3; i++)
		xyz[i] = m[i][0] * rgb[0] + m[i][1] * rgb[1] + m[i][2] * rgb[2];
}

/* In degrees, [0, 360); 0 for no chroma. */
static double hue(double a, double b)
{
	double h;

	if (a == 0 && b == 0)
		return 0;
	h = atan2(b, a) * 180 / M_PI;
	return h < 0 ? h + 360 : h;
}

static double cos_deg(double deg)
{
	return cos(deg * M_PI / 180);
}

static double pow7(double x)
{
	return x * x * x * x * x * x * x;
}

double colour_delta_e_2000(const double lab1[3], const double lab2[3])
{
	double chroma = (hypot(lab1[1], lab1[2]) + hypot(lab2[1], lab2[2])) / 2;
	double g = 0.5 * (1 - sqrt(pow7(chroma) / (pow7(chroma) + pow7(25))));
	double a1 = (1 + g) * lab1[1], a2 = (1 + g) * lab2[1];
	double c1 = hypot(a1, lab1[2]), c2 = hypot(a2, lab2[2]), h1 = hue(a1, lab1[2]), h2 = hue(a2, lab2[2]);
	double dl = lab2[0] - lab1[0], dc = c2 - c1, dh_deg = 0, dh;
	double l = (lab1[0] + lab2[0]) / 2, c = (c1 + c2) / 2, h = h1 + h2, t, sl, sc, sh, rt;

	if (c1 * c2 != 0) {
		dh_deg = h2 - h1;
		if (fabs(dh_deg) > 180) {
			h += h < 360 ? 360 : -360;
			dh_deg += dh_deg > 0 ? -360 : 360;
		}
		h /= 2;
	}
	dh = 2 * sqrt(c1 * c2) * sin(dh_deg / 2 * M_PI / 180);
	t = 1 - 0.17 * cos_deg(h - 30) + 0.24 * cos_deg(2 * h) + 0.32 * cos_deg(3 * h + 6) - 0.20 * cos_deg(4 * h - 63);
	sl = 1 + 0.015 * (l - 50) * (l - 50) / sqrt(20 + (l - 50) * (l - 50));
	sc = 1 + 0.045 * c;
	sh = 1 + 0.015 * c * t;
	rt = -sin(60 * exp(-((h - 275) / 25) * ((h - 275) / 25)) * M_PI / 180) * 2 *
	     sqrt(pow7(c) / (pow7(c) + pow7(25)));
	dl /= sl;
	dc /= sc;
	dh /= sh;
	return sqrt(fmax(0, dl * dl + dc * dc + dh * dh + rt * dc * dh));
}
