/* The core of the image correlation as plain C: arrays in, arrays out, no state of its own.

   Points are (column, row) in px, pictures row by row. Every array belongs to the caller and is large enough for what
   is counted beside it; a null pointer stands for "not given" where that is said. Pictures and patterns do not change
   once they are made, so that any number of threads may use them at the same time. Except for dic_interface and those
   that free, functions return a dic_outcome; unless it is DIC_DONE, `text` then holds a sentence. */
#ifndef DIC_INTERFACE_H
#define DIC_INTERFACE_H

#include <stdint.h>

#define DIC_INTERFACE 3 /* counts up whenever something below changes */
#define DIC_TEXT 256    /* bytes of every `text` */
#define DIC_API __attribute__((visibility("default")))

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { DIC_DONE = 0, DIC_REFUSED = 1, DIC_NO_MEMORY = 2, DIC_FAILED = 3 } dic_outcome;

typedef struct dic_picture dic_picture;
typedef struct dic_pattern dic_pattern;

typedef struct {
  int32_t half, model, max_iterations, threads; /* model: 0 translation, 1 rigid, 2 affine */
  double tolerance, wander, accept;
} dic_settings;

/* A whole subset. Warps are u, v, u_x, u_y, v_x, v_y. */
typedef struct {
  double warp[6], zncc, residual, level[2], covariance[3]; /* covariance of u, v and mixed, per grey² of noise */
  double contrast, score, bend, suspect[4];                /* suspect: angle, offset, jump of u and v */
  int32_t outcome, iterations, count;                      /* outcome −1: never reached */
} dic_matched;

/* A subset cut by a line. */
typedef struct {
  double near[6], far[6], line[2], margin, cost[3]; /* cost: single, parted, swapped */
  double near_fit[5], far_fit[5];                     /* zncc, residual, gain, offset, score */
  double near_covariance[36], far_covariance[36];
  int32_t attempted, far_matched, count[2], iterations;
} dic_parted;

DIC_API int32_t dic_interface(void);

/* Grey values up to `floor` and from `ceiling` on are those of too little and too much light; infinities where there
   is neither. */
DIC_API int32_t dic_new_picture(const float *grey, int64_t rows, int64_t columns, float floor, float ceiling,
                                dic_picture **made, char *text);
DIC_API void dic_free_picture(dic_picture *picture);

/* A speckle pattern of blobs: column, row, sigma and grey of each. */
DIC_API int32_t dic_new_pattern(const double *blobs, int64_t count, dic_pattern **made, char *text);
DIC_API void dic_free_pattern(dic_pattern *pattern);
DIC_API int32_t dic_evaluate(const dic_pattern *pattern, const double *points, int64_t count, int32_t threads,
                             float *grey, char *text);

/* `neighbours`: 8 a point, −1 for none. `carried`: one warp a point, or null. */
DIC_API int32_t dic_propagate(const dic_picture *reference, const dic_picture *current, const double *points,
                              int64_t count, const int32_t *neighbours, const int32_t *seeds, const double *guesses,
                              int64_t seed_count, const double *carried, const dic_settings *settings,
                              dic_matched *found, char *text);

/* `guesses`: one warp a point. */
DIC_API int32_t dic_match(const dic_picture *reference, const dic_picture *current, const double *points, int64_t count,
                          const double *guesses, const double *carried, const dic_settings *settings,
                          dic_matched *found, char *text);

/* Candidates of all points one after the other: warp, gain, offset, ξ, η (where it was seen, NaN: the point's own);
   those of point i are the rows first[i] to first[i + 1]. `carried`, `far_carried`, `lines` (angle, offset; offset −1:
   none) may be null. */
DIC_API int32_t dic_split(const dic_picture *reference, const dic_picture *current, const double *points, int64_t count,
                          const double *candidates, int64_t candidate_count, const int32_t *first, double variance,
                          const double *carried, const double *far_carried, const double *lines,
                          const dic_settings *settings, dic_parted *found, char *text);

/* number[row * columns + column]: the last triangle that covers the raster's node, −1 where there is none. */
DIC_API int32_t dic_cover(const double *corners, int64_t corner_count, const int32_t *triangles, int64_t count,
                          double column0, double row0, double step, int32_t columns, int32_t rows, int32_t *number,
                          char *text);

#ifdef __cplusplus
}
#endif
#endif
