#ifndef WELKIN_TESTS_LIB_COLOUR_H
#define WELKIN_TESTS_LIB_COLOUR_H

/* CIE L*a*b* of an XYZ whose white is white[3] (same scale). */
void colour_lab(const double xyz[3], const double white[3], double lab[3]);

/* CIEDE2000 colour difference, kL = kC = kH = 1 (Sharma, Wu & Dalal 2005, equations 2 to 22). */
double colour_delta_e_2000(const double lab1[3], const double lab2[3]);

/* D65, Y = 1. */
extern const double colour_d65[3];

/* XYZ from linear Rec.709 with Y = 1 for (1, 1, 1). */
void colour_xyz_of_rec709(const double rgb[3], double xyz[3]);

#endif
