#ifndef WELKIN_GPU_SKY_TABLES_H
#define WELKIN_GPU_SKY_TABLES_H

#include "gpu/tables.h"

/* The tables that more than one sky method reads. Each makes sure of those it is made from. Their
 * keys hold exactly what they depend on. */

/* Columns of each medium to the top: by planet and profiles only. UNIT_OPTICAL_DEPTH. */
enum table_state need_optical_depth(struct frame_tables *tables, const struct scene *scene, struct error *err);

/* Light that has been scattered before: by planet, profiles, and the coefficients of the batch. UNIT_MULTIPLE. */
enum table_state need_multiple(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err);

/* What a ray brings, for every altitude, view and sun: by the same, and by steps. UNIT_PRECOMPUTED. */
enum table_state need_precomputed(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err);

/* Light scattered into every ray from the camera up to every distance, for shaders/aerial.glsl: by the coefficients of
 * the batch, the camera's altitude and the sun's angle to its vertical. UNIT_AERIAL. */
enum table_state need_aerial(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err);

#endif
