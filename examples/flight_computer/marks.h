/* marks.h - finds the lamps around the port in an image: bright spots, and which of them is which lamp. */
#ifndef MARKS_H
#define MARKS_H

#include <stdbool.h>
#include <stdint.h>

#include "mission.h"

enum { SPOTS_MAX = 512, NO_SPOT = -1 };

struct spot {
    double x, y, area; /* centre, px; px^2 */
};
/* Where a lamp should be in the image. */
struct view {
    bool is_visible; /* before the camera */
    double x, y, area;
};

/* Spots that stand out from what a morphological opening leaves, of a size that one of the lamps may have; none of
 * those at the edge of the image. Returns how many. */
int find_spots(const uint8_t *image, int width, int height, const struct view *views, int lamps,
               struct spot spots[SPOTS_MAX]);

/* The spot of each lamp, found[l], or NO_SPOT; returns how many lamps have one. All views may be off by one shift of up
 * to `reach_px` and by one of the scales about their centre: the shift and scale count that bring most lamps within
 * `window_px` of a spot of their size. */
int assign_spots(const struct view *views, int lamps, const struct spot *spots, int n, double reach_px,
                 double window_px, const double *scales, int n_scales, int found[LAMPS_MAX]);

#endif
