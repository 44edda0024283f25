#include "marks.h"

#include <math.h>
#include <string.h>

enum { STANDS_OUT = 150 }; /* grey levels */
enum { LINE_MAX_PX = 65536 };

/* The largest (flip 0) or smallest (flip 0xFF) of the values within `reach` of each of `n` values, in time O(n). */
static void extremes(const uint8_t *in, uint8_t *out, int n, int stride, int reach, uint8_t flip) {
    static int candidate[LINE_MAX_PX]; /* indices of falling values, the largest first */
    int first = 0, end = 0;
    for (int i = 0; i < n + reach; ++i) {
        if (i < n) {
            const uint8_t value = in[i * stride] ^ flip;
            while (end > first && (in[candidate[end - 1] * stride] ^ flip) <= value) --end;
            candidate[end++] = i;
        }
        if (i < reach) continue;
        if (candidate[first] < i - 2 * reach) ++first;
        out[(i - reach) * stride] = in[candidate[first] * stride];
    }
}

/* Over squares of 2 * reach + 1 pixels a side. */
static void extremes_of_squares(const uint8_t *in, uint8_t *out, int width, int height, int reach, uint8_t flip) {
    static uint8_t rows[IMAGE_BYTES_MAX];
    for (int y = 0; y < height; ++y) extremes(in + y * width, rows + y * width, width, 1, reach, flip);
    for (int x = 0; x < width; ++x) extremes(rows + x, out + x, height, width, reach, flip);
}

/* The spot of connected pixels of the mask around `seed`, which it clears; false: it touches the edge of the image. */
static bool take_spot(uint8_t *mask, int width, int height, int seed, struct spot *spot) {
    static int pending[IMAGE_BYTES_MAX];
    int n = 0;
    bool whole = true;
    double sum_x = 0, sum_y = 0;
    spot->area = 0;
    pending[n++] = seed, mask[seed] = 0;
    while (n > 0) {
        const int at = pending[--n], x = at % width, y = at / width;
        sum_x += x, sum_y += y, spot->area += 1;
        const bool inside[4] = {x > 0, x + 1 < width, y > 0, y + 1 < height};
        const int neighbours[4] = {at - 1, at + 1, at - width, at + width};
        for (int i = 0; i < 4; ++i) {
            whole = whole && inside[i];
            if (inside[i] && mask[neighbours[i]]) mask[neighbours[i]] = 0, pending[n++] = neighbours[i];
        }
    }
    spot->x = sum_x / spot->area, spot->y = sum_y / spot->area;
    return whole;
}

/* Their sizes agree. */
static bool fits(const struct view *view, const struct spot *spot) {
    return view->is_visible && spot->area > 0.75 * view->area - 2 && spot->area < 1.25 * view->area + 3;
}

int find_spots(const uint8_t *image, int width, int height, const struct view *views, int lamps,
               struct spot spots[SPOTS_MAX]) {
    static uint8_t eroded[IMAGE_BYTES_MAX], opened[IMAGE_BYTES_MAX];
    double widest = 1;
    for (int l = 0; l < lamps; ++l)
        if (views[l].is_visible && views[l].x > 0 && views[l].y > 0 && views[l].x < width && views[l].y < height)
            widest = fmax(widest, views[l].area);
    const double diameter_px = 2 * sqrt(widest / 3.14159265358979323846);
    const int reach = (int)fmin((diameter_px + 5) / 2, fmin(width, height) / 2.0), pixels = width * height;
    extremes_of_squares(image, eroded, width, height, reach, 0xFF);
    extremes_of_squares(eroded, opened, width, height, reach, 0);
    uint8_t *mask = eroded;
    for (int i = 0; i < pixels; ++i) mask[i] = image[i] - opened[i] > STANDS_OUT;
    int n = 0;
    for (int i = 0; i < pixels && n < SPOTS_MAX; ++i) {
        if (!mask[i] || !take_spot(mask, width, height, i, &spots[n])) continue;
        bool any = false;
        for (int l = 0; l < lamps && !any; ++l) any = fits(&views[l], &spots[n]);
        n += any;
    }
    return n;
}

/* The spots that a lamp may have at any shift and scale. */
struct candidates {
    int n, spot[SPOTS_MAX];
};

static void find_candidates(const struct view *view, const struct spot *spots, int n, double distance_px,
                            struct candidates *out) {
    out->n = 0;
    for (int s = 0; s < n; ++s)
        if (fits(view, &spots[s]) && hypot(spots[s].x - view->x, spots[s].y - view->y) < distance_px)
            out->spot[out->n++] = s;
}

int assign_spots(const struct view *views, int lamps, const struct spot *spots, int n, double reach_px,
                 double window_px, const double *scales, int n_scales, int found[LAMPS_MAX]) {
    static struct candidates near[LAMPS_MAX];
    int best = 0, visible = 0;
    double centre_x = 0, centre_y = 0;
    for (int l = 0; l < lamps; ++l) {
        found[l] = NO_SPOT;
        if (views[l].is_visible) centre_x += views[l].x, centre_y += views[l].y, ++visible;
    }
    if (visible == 0) return 0;
    centre_x /= visible, centre_y /= visible;
    for (int l = 0; l < lamps; ++l) {
        double distance_px = reach_px + window_px;
        for (int k = 0; k < n_scales; ++k)
            distance_px =
                fmax(distance_px,
                     reach_px + window_px + fabs(scales[k] - 1) * hypot(views[l].x - centre_x, views[l].y - centre_y));
        find_candidates(&views[l], spots, n, distance_px, &near[l]);
    }
    for (int k = 0; k < n_scales; ++k) {
        double x[LAMPS_MAX], y[LAMPS_MAX]; /* scaled */
        for (int l = 0; l < lamps; ++l) {
            x[l] = centre_x + scales[k] * (views[l].x - centre_x);
            y[l] = centre_y + scales[k] * (views[l].y - centre_y);
        }
        for (int of = -1; of < lamps; ++of) /* a lamp and a spot of it are a shift; before these, none */
            for (int i = 0; i < (of < 0 ? 1 : near[of].n); ++i) {
                const double shift_x = of < 0 ? 0 : spots[near[of].spot[i]].x - x[of];
                const double shift_y = of < 0 ? 0 : spots[near[of].spot[i]].y - y[of];
                if (of >= 0 && hypot(shift_x, shift_y) >= reach_px) continue;
                int candidate[LAMPS_MAX], count = 0;
                for (int l = 0; l < lamps; ++l) {
                    double nearest = window_px * window_px;
                    candidate[l] = NO_SPOT;
                    for (int j = 0; j < near[l].n; ++j) {
                        const int s = near[l].spot[j];
                        const double dx = spots[s].x - x[l] - shift_x, dy = spots[s].y - y[l] - shift_y;
                        if (dx * dx + dy * dy < nearest) nearest = dx * dx + dy * dy, candidate[l] = s;
                    }
                    count += candidate[l] != NO_SPOT;
                }
                if (count > best) best = count, memcpy(found, candidate, sizeof candidate[0] * (size_t)lamps);
            }
    }
    return best;
}
