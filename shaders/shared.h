/*
 * Bindings, sizes and blocks that C and GLSL share: `#include "shared.h"` in GLSL (the program
 * loader resolves it and defines WELKIN_GLSL), `#include "shaders/shared.h"` in C. Blocks are
 * made of vec4 and of groups of four 4-byte scalars, so std140 and the C compiler agree;
 * a test compares every offset with the driver's.
 */
#ifndef WELKIN_SHADERS_SHARED_H
#define WELKIN_SHADERS_SHARED_H

#ifdef WELKIN_GLSL
#define WELKIN_BLOCK(name, point) layout(std140, binding = point) uniform name {
#define WELKIN_BLOCK_END(instance) } instance;
#else
#define WELKIN_BLOCK(name, point) struct name {
#define WELKIN_BLOCK_END(instance) };
typedef float vec4[4];
typedef int ivec4[4];
typedef unsigned int uint;
#endif

/* Uniform block bindings */
#define BIND_FRAME 0
#define BIND_MEDIA 1
#define BIND_BANDS 2
#define BIND_FITTED 3
#define BIND_METHOD 4 /* an operator's method: its parameters as floats, METHOD_VALUES at most; declared by the renderer */
#define METHOD_VALUES 16
#define BIND_CLOUDS 5

#define BIND_SURFACES_BLOCK 6 /* uniform block of a frame with a scene */

/* Shader storage bindings. A strip's pixels are numbered by rows; so are the directions of a radiance job. */
#define BIND_RADIANCE 0      /* vec4 per pixel: linear Rec.709 cd/m² added up over batches, a = luminance of sun × transmittance; FEATURE_SPECTRAL: L of the batch */
#define BIND_INSCATTER 1     /* vec4 per pixel: rgb in-scattered cd/m², a = distance to the ground in m (FEATURE_LAYERS) */
#define BIND_TRANSMITTANCE 2 /* vec4 per pixel: rgb of sun × transmittance; FEATURE_SPECTRAL: T of the batch */
#define BIND_DIRECTIONS 3    /* vec4 per pixel: unit vector, w = solid angle in sr, 0 for a bare direction, negative where the pixel shows nothing */
#define BIND_OUTPUT 4        /* packed pixels of the strip */
#define BIND_COUNTERS 5      /* uint: pixels of the frame that were not finite */
#define BIND_NODES 6         /* quadrature nodes: vec2 (position in [0,1], weight) */
#define BIND_CLOUD_LATTICE 4 /* kernels of the march: two vec4 per point, as the next two; cloud_lattice.glsl */
#define BIND_GROUPS 4        /* kernels of an image with a scene: GROUPS_ of uint, groups of WORKGROUP_LINE pixels of the strip that show something; surfaces_list.comp */
#define BIND_CLOUD_LIST 5    /* likewise: CLOUD_LIST_ of uint, points to work on */
#define BIND_CLOUD_SHADE 1   /* two vec4 per pixel: radiance of the batch that clouds take before and behind them; cloud_shade.comp */
#define BIND_CLOUD_BEFORE 0  /* likewise: uvec4 per pixel of the image, clouds of the frame before; cloud_history.glsl */
#define BIND_CLOUD_KEPT 1    /* likewise, of this frame for the next */
#define BIND_CLOUD_LIGHT 7   /* vec4 per pixel: transmittance of the clouds; response to sun, sky and ground; shaders/clouds.comp. Of a frame that follows another: BIND_CLOUD_KEPT */
#define BIND_CLOUD_PLACE 8   /* vec4 per pixel: where they are */
#define BIND_PATHS 8         /* kernel of the reference: PATH_UVEC4S per ray, paths through clouds that the next dispatch goes on with */
#define PATH_UVEC4S 8
#define PATH_DISPATCHES 32   /* so many at most, counted by LOCATION_ITERATION */
#define BIND_SURFACES 9      /* uvec4 per pixel: what of the scene it shows, shaders/surface_record.glsl */
#define BIND_CLOUD_LAYER 10   /* two vec4 per pixel: light that clouds add, linear Rec.709 cd/m², and their transmittance; x of the other: their mean distance in m */
#define BIND_BVH 10           /* nodes, gpu/bvh.h */
#define BIND_TRIANGLES 11     /* in the order of the nodes' leaves */
#define BIND_VERTICES 12     /* of the placed mesh, VERTEX_FLOATS each */
#define BIND_MATERIALS 13
#define BIND_RIDGES 0        /* kernel that gathers records: workgroups along x, y, z, how many entries; then for each a record of the other side of a ridge that crosses a pixel, as BIND_SURFACES, and the pixel; surfaces_gather.comp */
#define BIND_LAYER 0         /* kernel of see-through surfaces: records of a layer of them, as BIND_SURFACES */
#define BIND_AMBIENT 14      /* float per vertex: share of the sky above it that is open */

/* Texture units; a method's tables sit at fixed units so that programs need no set-up. */
#define UNIT_OPTICAL_DEPTH 0
#define UNIT_MULTIPLE 1
#define UNIT_SKY_VIEW 2
#define UNIT_PRECOMPUTED 3
#define UNIT_AERIAL 4
#define UNIT_BLUE_NOISE 7
#define UNIT_CLOUD_WEATHER 8
#define UNIT_CLOUD_BASE 9
#define UNIT_CLOUD_DETAIL 10
#define UNIT_CLOUD_CURL 11
#define UNIT_CLOUD_HIGH 12
#define UNIT_CLOUD_CELLS 13    /* grids of cloud_grid.glsl */
#define UNIT_CLOUD_OPENNESS 14
#define UNIT_CLOUD_DIFFUSE 15
#define UNIT_CLOUD_LIGHT 16
#define UNIT_CLOUD_MAJORANT 17

/* Light in clouds: grids around the camera's footprint, each CLOUD_GRID_GROWTH times as coarse and wide as the one before,
 * stacked in one 3-D texture: x east, y south, z up, level by level. */
#define CLOUD_GRID_ACROSS 48
#define CLOUD_GRID_UP 20
#define CLOUD_GRID_LEVELS 3
#define CLOUD_GRID_GROWTH 4.0
#define CLOUD_DIFFUSE_RUNS 14 /* of the diffusion equation: columns alone, relaxations (their number prime to 5), light emitted */

/* The sun's way through clouds: boxes as wide, of more and smaller cells (cloud_sun.glsl). */
#define CLOUD_SUN_ACROSS 128
#define CLOUD_SUN_UP 40

/* Majorants for paths through clouds (cloud_majorant.glsl): boxes around the camera, each CLOUD_GRID_GROWTH times as
 * wide as the one before, stacked likewise; their texture is made in so many runs. */
#define MAJORANT_ACROSS 128
#define MAJORANT_UP 40
#define MAJORANT_LEVELS 3
#define MAJORANT_RUNS 60
#define BLUE_NOISE_SIDE 64

#define CLOUD_BASE_RUNS 16 /* slabs that the base shape is made in */
#define UNIT_ALBEDO 18        /* array of the materials' colours, sRGB */
#define UNIT_NORMAL 19        /* array of their normal maps */
#define UNIT_RASTER 20       /* multisampled triangles of the strip in hand, counted from 1; 0: none */
#define UNIT_SHADOW 21       /* depth from the sun, a layer for each cascade, compared */
#define UNIT_SHADOW_DEPTH 22 /* the same, read as it is */
#define UNIT_SHADOW_MOMENTS 23
#define UNIT_SHAFTS 24       /* shadowed light by chord of the angle from the sun, plane and distance */
#define UNIT_SHAFT_TREE 25   /* depth from the sun along the planes: minima and maxima */

/* Storage that kernels read as buffer textures: a load from storage goes over components and invocations one by one on
 * llvmpipe, at several times the cost of a fetch (gpu/passes.c). */
#define UNIT_DIRECTIONS 26
#define UNIT_SURFACES 27
#define UNIT_BVH 28
#define UNIT_TRIANGLES 29
#define UNIT_VERTICES 30
#define UNIT_MATERIALS 31
#define UNIT_AMBIENT 32
#define UNIT_RADIANCE 33

#define UNIT_CLOUD_LATTICE 35
#define UNIT_CLOUD_SHADE 36
#define UNIT_CLOUD_BEFORE 37
#define UNIT_CLOUD_LIGHT_OF_RAYS 38
#define UNIT_CLOUD_PLACE 39
#define UNIT_CLOUD_KEPT 42       /* of a frame that follows another, in place of those two: what it keeps, as half floats; cloud_sight.glsl */
#define UNIT_CLOUD_KEPT_WORDS 43 /* the same as it is */

#define UNIT_RASTER_DEPTH 40  /* of the samples of UNIT_RASTER: near over distance */
#define UNIT_CLOUD_SUN 34     /* optical depth of clouds to the sun; cloud_sun.glsl */
#define UNIT_CLOUD_LIT 44     /* share of the sun that a scene leaves to the cells of the grids */
#define UNIT_CLOUD_AROUND 41  /* what clouds do to the light around them; cloud_shadow.glsl */

/* Where profiles of types end, of the layer's height, for stratus and stratocumulus (cumulus: 1); by how much the map's types differ from the one asked for;
 * how high bases lie at most, of cumulus. */
#define CLOUD_STRATUS_END 0.12
#define CLOUD_STRATOCUMULUS_END 0.7
#define CLOUD_TYPE_SPREAD 0.12
#define CLOUD_BASE_RISE 0.08

/* Layers of that table for each level of the grids. */
#define CLOUD_AROUND_LIT 0
#define CLOUD_AROUND_GAIN 1
#define CLOUD_AROUND_BELOW 2
#define CLOUD_AROUND_ABOVE 3
#define CLOUD_AROUND_GROUND 4
#define CLOUD_AROUND_SKY 5
#define CLOUD_AROUND_LAYERS 6

/* Samples of a pixel in the raster pass. */
#define RASTER_SAMPLES 4
#define VERTEX_FLOATS 8
#define VERTEX_BITS 24       /* of a triangle's corner, the rest of its word is a third of the material */
#define SHADOW_CASCADES 4
#define SEE_THROUGH_LAYERS 4 /* of see-through surfaces that a pixel shows, one behind the other; surfaces_layer.comp */

/* Samples of the shafts' table: angle from the sun, planes through it, distances; depths along a plane, whose minima and
 * maxima go up to blocks of 2^SHAFT_LEVELS. */
#define SHAFT_ANGLES 64
#define SHAFT_PLANES 160
#define SHAFT_DISTANCES 32
#define SHAFT_DEPTHS 512
#define SHAFT_LEVELS 4

/* Samples of the four-dimensional scattering table: the sun's angle, the view's zenith angle (above and below the
 * horizon), the angle between their azimuths, altitude. */
#define PRECOMPUTED_SUNS 48
#define PRECOMPUTED_VIEWS 96
#define PRECOMPUTED_AZIMUTHS 12
#define PRECOMPUTED_ALTITUDES 20

/* Layers of the multiple-scattering table that readers see, of 2 sets; the runs that make it, an order each, and which of them is the first
 * with coarse rules. */
#define MULTIPLE_LAYERS 9
#define MULTIPLE_SETS 2
#define MULTIPLE_RUNS 6
#define MULTIPLE_COARSE_RUN 2

/* Samples of the aerial-perspective table: azimuth from the sun, angle from the horizon (above and below), distance. */
#define AERIAL_AZIMUTHS 32
#define AERIAL_VIEWS 64
#define AERIAL_DISTANCES 32

/* MediaBlock.rule: Gauss-Legendre on [0,1]. A view ray cut into k pieces uses RULE_VIEW + k - 1 on
 * each: its steps add up to atmosphere.steps, or to a few more where pieces would get next to none.
 * RULE_LIGHT likewise for atmosphere.light_steps on rays to the sun (1 or 2 pieces), RULE_TABLE for
 * tables, whose accuracy is not the client's choice. */
#define RULE_VIEW 0
#define RULE_LIGHT 4
#define RULE_TABLE 6
#define RULE_AROUND 8 /* directions above and below the horizon, multiple-scattering table */
#define RULE_AROUND_COARSE 9 /* the same, fewer */
#define RULE_SLICE 10 /* between two distances of the aerial-perspective table */
#define RULE_LOBES 11 /* not a rule: the aerosol's scaled phase function and its lobes by angle, multiple_table.glsl */
#define RULE_COUNT 12

/* Plain uniforms */
#define LOCATION_TILE 0  /* ivec4: x, y, width, height of the strip in the image; a radiance job: first direction, 0, count, 1 */
#define LOCATION_GROUPS 11 /* int: which list of BIND_GROUPS says what pixels to work on, counted from 1; 0: all */
#define LOCATION_BATCH 1 /* int: index of the spectral batch; 0 clears the accumulators */
#define LOCATION_PLANES 2 /* ivec4: where in BIND_OUTPUT, in uints, inscatter, transmittance, depth and clouds start; -1: not wanted */
#define LOCATION_WHITE 3 /* vec4: linear Rec.709 of the sun's irradiance over all batches, and its luminance: what a transmittance of 1 adds up to */
#define LOCATION_SAMPLES 6 /* ivec4, progressive methods: first group of paths, groups per ray in this dispatch, paths per group, highest order; clouds of a frame that follows another: cloud_history.glsl */
#define LOCATION_ITERATION 5 /* int: how often a table's kernel has run before */
#define LOCATION_ROWS 8  /* vec4[3]: of the matrix that a program which draws projects by, or that gives places in the frame before; cloud_history.glsl */
#define LOCATION_BOX 4   /* ivec4: x, y, width, height of the part of the strip that the sun's disk may touch; of the image that the scene is drawn of */

#define WORKGROUP_X 16
#define WORKGROUP_Y 4
#define WORKGROUP_LINE 64 /* of kernels that number pixels instead */

/* BIND_GROUPS: for each list workgroups along x, y, z, and one unused; then the lists, interleaved: groups of pixels that show
 * surfaces, and that show sky. GROUPS_FILLED on a group of the former: it was not in the latter when that bit was set. */
#define GROUPS_SURFACES 0
#define GROUPS_SKY 1
#define GROUPS_LISTS 2
#define GROUPS_HEAD 4
#define GROUPS_FIRST 8
#define GROUPS_FILLED 0x80000000u

/* Bits of FrameBlock.features: what the planner left in. A kernel skips what is not set. */
#define FEATURE_SUN_DISK 1
#define FEATURE_GROUND 2
#define FEATURE_LAYERS 4
#define FEATURE_CLOUDS 16
#define FEATURE_SKY_ON_GROUND 32 /* the method's ground is lit by the sky as well as by the sun */
#define FEATURE_SPECTRAL 8 /* radiance job: L and T per band, no matrix */
#define FEATURE_SURFACES 64 /* BIND_SURFACES says what of a scene the pixels show */
#define FEATURE_SHAFTS 512 /* the scene shadows the air */
#define FEATURE_TRACED 256 /* paths meet the scene */
#define FEATURE_SHADOWS 128 /* the shadow map is there */

#define PHASE_CORNETTE_SHANKS 0
#define PHASE_HENYEY_GREENSTEIN 1
#define PHASE_SCHLICK 2

#define CLOUDS_PHYSICAL 0
#define CLOUDS_ARTISTIC 1

/* Which rays a kernel of the march is for; clouds.comp. */
#define CLOUD_RAYS_GIVEN 0
#define CLOUD_RAYS_CORNERS 1
#define CLOUD_RAYS_LATTICE 2
#define CLOUD_RAYS_PIXELS 3
#define CLOUD_RAYS_BLOCKS 4

/* Sides in pixels: of a block, of which a frame that follows another marches one pixel (cloud_history.glsl); of the cells that fewer rays are
 * marched at the corners of, and of four of those, whose nine corners say whether they change evenly; of the cells that shade is worked out at the
 * corners of (cloud_lattice.glsl). */
#define CLOUD_BLOCK 4
#define CLOUD_LATTICE_CELL 4
#define CLOUD_LATTICE_BLOCK (2 * CLOUD_LATTICE_CELL)
#define CLOUD_SHADE_CELL 8

/* BIND_CLOUD_LIST: for each of two lists workgroups along x, y, z, and how many points; then the points; pixel_list.glsl. Of the
 * march: points of the lattice or blocks, and pixels. */
#define CLOUD_LIST_POINTS 0
#define CLOUD_LIST_PIXELS 1
#define CLOUD_LIST_HEAD 4
#define CLOUD_LIST_FIRST 8

/* How a kernel of cloud_compose.comp has what clouds take from the light below them. */
#define SHADE_HERE 0    /* it works it out, pixel by pixel */
#define SHADE_THERE 1   /* BIND_CLOUD_SHADE */
#define SHADE_OF_RAYS 2 /* it works it out for cloud_shade.comp, and does nothing else */
#define CLOUD_LIST_COMPOSED 0 /* its lists, of rows of cells: with clouds, and those whose shade is not worked out between the cells' corners */
#define CLOUD_LIST_SHADED 1
#define COURSE_NO_AIR 0
#define COURSE_TO_GROUND 1
#define COURSE_TO_NEAR_GROUND 2 /* where shadows are smooth between the corners of cells */
#define COURSE_IN_AIR 3 /* and above, by the shells that are met */

#define SHAPE_DILATED_SQUARED 0
#define SHAPE_DILATED 1
#define SHAPE_CARVED 2
#define SHAPE_ERODED 3
#define SHAPE_PRODUCT 4
#define SHAPE_PERLIN 5
#define SHAPE_WORLEY 6
#define SHAPE_UNIFORM 7

/* Waves of cloud_region() (cloud_density.glsl), east and south, in periods per side of the weather map: none fits another. */
#define CLOUD_WAVE_A 0.208, 0.083
#define CLOUD_WAVE_B -0.097, 0.154
#define CLOUD_WAVE_C 0.037, -0.126

/* CloudsBlock.painted_parts: what clouds have from a scene's files. */
#define PAINTED_WEATHER 1
#define PAINTED_BASE 2
#define PAINTED_DETAIL 4

#define SAVE_STEPS_BY_ELEVATION 1
#define SAVE_EARLY_EXIT 2
#define SAVE_EMPTY_SPACE 4
#define SAVE_ADAPTIVE_STEPS 8
#define SAVE_LIGHT_VOLUME 16
#define SAVE_HALF_RESOLUTION 32
#define SAVE_BLUE_NOISE 64
#define SAVE_SHARED_LIGHT 128

/* FrameBlock.projection, cube_face and tone_map: enums of api/request.h, whose order they follow. */
#define PROJECTION_PERSPECTIVE 0
#define PROJECTION_EQUIRECTANGULAR 1
#define PROJECTION_FISHEYE 2
#define PROJECTION_CUBE_FACE 3
#define PROJECTION_CUBEMAP 4
#define FACE_FRONT 0
#define FACE_RIGHT 1
#define FACE_BACK 2
#define FACE_LEFT 3
#define FACE_UP 4
#define FACE_DOWN 5
#define TONE_AGX 0
#define TONE_ACES 1
#define TONE_REINHARD 2
#define TONE_EXPONENTIAL 3
#define TONE_NONE 4

#define SHADING_PHYSICAL 0
#define SHADING_PHONG 1
#define SHADOW_NONE 0
#define SHADOW_BILINEAR 1
#define SHADOW_GAUSSIAN 2
#define SHADOW_VARIANCE 3
#define SHADOW_SOFT 4

/* FrameBlock.output_format */
#define OUTPUT_RGBA8 0
#define OUTPUT_RGBA16 1
#define OUTPUT_HALF 2
#define OUTPUT_FLOAT 3

/* Camera, sun and output of a frame. */
WELKIN_BLOCK(FrameBlock, BIND_FRAME)
	vec4 camera_right;   /* xyz unit vectors, world frame */
	vec4 camera_up;
	vec4 camera_forward;
	vec4 vertical;       /* xyz: away from the planet's centre at the camera */
	vec4 sun_direction;  /* xyz: to the sun's centre; w: cosine of its angular radius */
	int width, height, projection, cube_face;
	float tan_half_fov;  /* perspective: of half the vertical field of view */
	float fov;           /* rad, fisheye */
	float camera_altitude; /* m above the ground sphere */
	float sun_angular_radius; /* rad */
	float exposure_scale;  /* pixel = cd/m² × this; PNG path */
	int tone_map;        /* enum welkin_tone_map */
	int dither;
	uint seed;
	int features;        /* FEATURE_ bits */
	int output_format;   /* OUTPUT_ */
	float sun_solid_angle; /* sr */
	int reserved0;
	vec4 limb;             /* xyz: exponents of the sun's limb darkening, L ~ mu^limb, for linear Rec.709; 0: a uniform disk */
	vec4 limb_law;         /* xyz: the same for a wavelength, a polynomial of the wave number in 1/um */
WELKIN_BLOCK_END(frame)

/* The atmosphere's geometry and profiles: the same for all bands. */
WELKIN_BLOCK(MediaBlock, BIND_MEDIA)
	float planet_radius, top;              /* m; top above the ground */
	float rayleigh_scale_height, aerosol_scale_height; /* m */
	float ozone_center, ozone_half_width;  /* m: tent profile, 1 at the centre */
	float aerosol_g;
	int aerosol_phase;                     /* PHASE_ */
	int steps, light_steps;
	float turbidity;
	float sun_intensity;                   /* already in the bands' irradiance; for skies given in luminance */
	vec4 aerosol_moments;                  /* of its phase function after delta-M: chi1', chi2', 1 - f */
	vec4 aerosol_higher;                   /* chi3', chi4' */
	ivec4 rule[RULE_COUNT];                /* quadrature rules in BIND_NODES: x first node, y how many */
WELKIN_BLOCK_END(media)

/* The clouds: a layer between two shells, described in cloud_density.glsl, and a thin one above. Offsets are those of
 * the origin of cloud space in textures, in units of their side, wrapped. The origin is near the camera's footprint, and stays where it
 * is in the air that moves with the clouds, until the footprint has moved on by a cell of the finest grid: so do tables. */
WELKIN_BLOCK(CloudsBlock, BIND_CLOUDS)
	vec4 east, south;      /* xyz: horizontal axes at the camera, world frame */
	vec4 origin;           /* x, z: the camera's footprint from the origin of cloud space, m; y: how far shapes have risen since they were as the tables of light have them */
	vec4 base, detail;     /* xyz offset, w 1 / side in 1/m */
	vec4 grid[CLOUD_GRID_LEVELS]; /* xy: least x and z in m, z: side of a cell in m; cloud_grid.glsl */
	vec4 regions;          /* xyz: phases of cloud_region() at the camera's footprint, in periods; w: its amplitude, 0 where the map just repeats */
	vec4 weather, curl, high; /* xy offset, z: of weather: coverage, of curl: strength in m, of high: coverage; w 1 / side */
	float bottom, top;     /* m above the ground sphere: of what may hold clouds */
	float extinction;      /* 1/m where densest */
	float albedo;
	float type, precipitation, anvil, detail_strength;
	float forward_g, backward_g, backward_share;
	float high_altitude;   /* m */
	float high_depth;      /* vertical optical depth where densest */
	float shear_east, shear_south; /* m from the layer's bottom to its top */
	int high_type;
	int lighting, steps, light_steps, savings;
	int perlin_frequency, perlin_octaves, worley_frequency, base_shape;
	int worley_metric, worley_inverted, detail_frequency;
	uint cloud_seed;
	float persistence, base_gamma, detail_gamma;
	float sky_edge;        /* how much brighter than its mean the sky is at its horizon; cloud_grid.glsl */
	float thickness;       /* m: of the layer as asked for, by which profiles go; gpu/clouds.c */
	float reserved1, reserved2, reserved3;
	uint painted_a, painted_b, painted_c; /* which scene's weather map and noise volumes, for the keys of tables; 0: none's */
	uint painted_parts;                   /* which of them: PAINTED_WEATHER and so on */
WELKIN_BLOCK_END(clouds)

/* One batch of four wavelengths. */
WELKIN_BLOCK(BandsBlock, BIND_BANDS)
	vec4 wavelength;       /* nm */
	vec4 sun_irradiance;   /* W/m²/nm at the top of the atmosphere, intensity in */
	vec4 rayleigh;         /* scattering, 1/m at the ground */
	vec4 aerosol_scattering; /* 1/m at the ground */
	vec4 aerosol_extinction;
	vec4 aerosol_scaled_extinction; /* less the share of the forward peak, delta-M */
	vec4 ozone;            /* absorption, 1/m at the tent's peak */
	vec4 ground_albedo;
	vec4 red, blue;        /* reflectance of surfaces of these Rec.709 colours; green has what both leave */
	vec4 daylight[3];      /* CIE daylight components S0, S1, S2 at the wavelengths */
	vec4 daylight_luminance; /* xyz: 683 lm/W times the integral of each component times ybar, in cd/m² */
	vec4 sun_luminance;    /* cd/m² of the sun's irradiance taken as a radiance: what transmittances are weighted by for alpha */
	vec4 to_rgb[3];        /* rows: linear Rec.709 in cd/m² from the four radiances */
WELKIN_BLOCK_END(bands)

/* The scene under the sky: where the mesh stands and how it is lit. */
WELKIN_BLOCK(SurfacesBlock, BIND_SURFACES_BLOCK)
	vec4 axis[3];          /* xyz: the mesh's unit vectors in the world frame */
	vec4 camera_high, camera_low; /* xyz: the camera in the mesh's frame is the sum of both, m */
	vec4 low, high;        /* xyz: bounds in the mesh's frame, m */
	vec4 sun;              /* xyz: to the sun, mesh's frame */
	vec4 shadow_row[3 * SHADOW_CASCADES]; /* of cascade c, from 3 c: dot(xyz, v) + w of a point v relative to the camera, in world axes, is u, v, depth in [0,1], depth away from the sun */
	vec4 shadow_reach;     /* m from the camera: cascade c is for points nearer than that */
	vec4 shadow_texel;     /* m: across a texel of each cascade */
	int shading, shadow_filter, shadow_cascades, shadow_size; /* enums of api/request.h */
	float shadow_depth;    /* m: from depth 0 to 1 of cascade 0 */
	int shaft_steps, shadow_region;
	float shaft_phi;       /* rad: middle of the planes through the sun that the view has */
	vec4 shaft_range;      /* chord of the angle from the sun, from and to; angle of the plane about shaft_phi, from and to, rad */
	vec4 shaft_reach;      /* m from the camera, from and to: where the mesh can throw shadows */
	int see_through_root;  /* node of the hierarchy above the triangles that light passes through; 0: there are none */
	float clouds_east, clouds_south; /* m: the camera's footprint from the origin of cloud space, as the scene's shadow on clouds has it; gpu/clouds.c */
	int reserved1;
WELKIN_BLOCK_END(surfaces)

/* The sky of method fitted for a batch; gpu/fitted.h. */
WELKIN_BLOCK(FittedBlock, BIND_FITTED)
	vec4 term[17];         /* W/m²/sr/nm: coefficient of each product, in the order of fitted_terms() */
	vec4 depth[3];         /* vertical optical depth above the camera: Rayleigh, aerosol, ozone */
	vec4 ground;           /* W/m²/sr/nm */
	vec4 least;            /* W/m²/sr/nm: no sky is darker */
	vec4 exponent;         /* of theta, of theta, of gamma; H */
	vec4 geometry;         /* cosine to the vertical of the horizon; air mass of a horizontal ray, Rayleigh, aerosol; ((R + h) / (R + 25 km))² */
WELKIN_BLOCK_END(fitted)

#endif
