#include "scenes/generate/textures.h"

#include <png.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "scenes/generate/noise.h"

namespace narpa::scenes {
namespace {

constexpr int kSize = 1024;

/// A picture in display values (0 black, 1 white), stored as 8-bit sRGB-coded grey or colour.
class Picture {
public:
    Picture() : pixels_(static_cast<std::size_t>(kSize) * kSize, Vec3{1, 1, 1}) {}
    Vec3& at(int x, int y) { return pixels_[static_cast<std::size_t>(y) * kSize + static_cast<std::size_t>(x)]; }
    void tint(int x, int y, double factor) {
        if (x >= 0 && y >= 0 && x < kSize && y < kSize) at(x, y) *= factor;
    }
    template <class Shade>  // Vec3(x, y)
    void paint(Shade shade) {
        for (int y = 0; y < kSize; ++y)
            for (int x = 0; x < kSize; ++x) at(x, y) = shade(x, y);
    }
    void write(const std::string& path) const {
        std::vector<png_byte> bytes;
        bytes.reserve(pixels_.size() * 3);
        for (const Vec3& p : pixels_)
            for (int band = 0; band < 3; ++band)
                bytes.push_back(static_cast<png_byte>(std::lround(255 * std::clamp(p[band], 0.0, 1.0))));
        png_image image{};
        image.version = PNG_IMAGE_VERSION;
        image.width = image.height = kSize;
        image.format = PNG_FORMAT_RGB;
        if (!png_image_write_to_file(&image, path.c_str(), 0, bytes.data(), 0, nullptr))
            throw std::runtime_error(path + ": " + image.message);
    }

private:
    std::vector<Vec3> pixels_;
};

/// 1 inside, 0 outside, with a soft edge `soft` wide.
double inside(double distance, double half_width, double soft) {
    return std::clamp((half_width - std::abs(distance)) / soft + 0.5, 0.0, 1.0);
}

/// A row of made-up characters, 5 x 7 cells of `cell` pixels each.
void letters(Picture& picture, int x0, int y0, int count, int cell, double factor, Random& random) {
    for (int n = 0; n < count; ++n)
        for (int row = 0; row < 7; ++row) {
            const int bits = random.below(8) | (row % 3 == 0 ? 2 : 0);
            for (int column = 0; column < 5; ++column) {
                const int mirrored = std::min(column, 4 - column);  // left-right symmetric, as most letters are
                if (!(bits >> mirrored & 1)) continue;
                for (int dy = 0; dy < cell; ++dy)
                    for (int dx = 0; dx < cell; ++dx)
                        picture.tint(x0 + (6 * n + column) * cell + dx, y0 + row * cell + dy, factor);
            }
        }
}

/// One shield panel: its border, rivets, pressed cross, stains, and on some a mark.
void panel(Picture& picture, int x0, int y0, std::uint64_t seed) {
    constexpr int kTile = kSize / kPanelsPerSide;
    Random random(seed);
    const double shade = random.uniform(0.80, 0.97);
    const Vec3 hue{1.0, random.uniform(0.965, 1.0), random.uniform(0.90, 0.985)};
    const double streak_x = random.uniform(20, 108), streak_width = random.uniform(3, 14);
    const double cross_depth = random.uniform() < 0.6 ? 0.12 : 0.0;
    const int split = random.below(3) == 0 ? 30 + random.below(60) : -1;
    for (int y = 0; y < kTile; ++y)
        for (int x = 0; x < kTile; ++x) {
            const double edge = std::min({x, y, kTile - 1 - x, kTile - 1 - y});
            double value = shade * (1 + 0.07 * fractal_noise(x / 24.0, y / 24.0, seed));
            value *= 1 - 0.16 * std::max(0.0, fractal_noise(x / 48.0, y / 48.0, seed + 9));
            value *=
                1 - cross_depth * std::max(inside(x - y, 2, 3), inside(x + y - (kTile - 1), 2, 3)) * (edge > 14);
            value *= 1 - 0.22 * inside(x - streak_x, streak_width, 8) *
                             (0.5 + 0.5 * value_noise(x / 3.0, y / 40.0, seed));
            if (split > 0) value *= 1 - 0.45 * inside(y - split, 1, 1);
            if (edge < 3) value *= 0.72;
            picture.at(x0 + x, y0 + y) = value * hue;
        }
    for (int k = 8; k < kTile - 4; k += 10)  // rivets, with the lit and the dark side of each head
        for (const auto& [x, y] : {std::pair{k, 7}, {k, kTile - 8}, {7, k}, {kTile - 8, k}}) {
            for (int dy = 0; dy < 2; ++dy)
                for (int dx = 0; dx < 2; ++dx) picture.tint(x0 + x + dx, y0 + y + dy, 0.55);
            picture.tint(x0 + x - 1, y0 + y - 1, 1.08);
        }
    const int kind = random.below(5);
    if (kind == 0) letters(picture, x0 + 22, y0 + 26, 2 + random.below(3), 3, 0.25, random);
    if (kind == 1)  // warning stripes
        for (int y = 96; y < 108; ++y)
            for (int x = 20; x < 108; ++x)
                if ((x + y) / 8 % 2) picture.tint(x0 + x, y0 + y, 0.3);
    if (kind == 2)  // an access plate
        for (int y = 40; y < 90; ++y)
            for (int x = 34; x < 98; ++x) {
                const int e = std::min({x - 34, y - 40, 97 - x, 89 - y});
                picture.tint(x0 + x, y0 + y, e < 2 ? 0.5 : 0.88);
            }
}

Picture hull() {
    Picture picture;
    constexpr int kTile = kSize / kPanelsPerSide;
    for (int row = 0; row < kPanelsPerSide; ++row)
        for (int column = 0; column < kPanelsPerSide; ++column)
            panel(picture, column * kTile, row * kTile,
                  100 + static_cast<std::uint64_t>(row * kPanelsPerSide + column));
    return picture;
}

/// Quilt of 16 cm squares set on their corners: dark stitching, tufts at the crossings, crumpled film between.
Picture blanket() {
    Picture picture;
    picture.paint([](int x, int y) {
        constexpr int kQuilt = 64;
        const int a = (x + y) % kQuilt, b = (x - y + kSize) % kQuilt;
        const double seam = std::min({a, kQuilt - a, b, kQuilt - b});
        const double tuft = std::hypot(std::min(a, kQuilt - a), std::min(b, kQuilt - b));
        double value = 0.92 + 0.10 * fractal_noise(x / 32.0, y / 32.0, 7, kSize / 32);
        value *= 1 - 0.10 * std::abs(fractal_noise(x / 16.0, y / 16.0, 21, kSize / 16));
        if (seam < 3) value *= 0.70 + 0.1 * seam;
        if (tuft < 6) value *= 0.6;
        const double stain = fractal_noise(x / 256.0, y / 256.0, 33, kSize / 256);
        value *= 1 - 0.25 * std::max(0.0, stain);
        return value * Vec3{1, 0.985, 0.95};
    });
    return picture;
}

Picture cells() {
    Picture picture;
    picture.paint([](int x, int y) {
        constexpr int kCell = kSize / 8;
        const int column = x / kCell, row = y / kCell, cx = x % kCell, cy = y % kCell;
        const double edge = std::min({cx, cy, kCell - 1 - cx, kCell - 1 - cy});
        const double corner = std::min(cx, kCell - 1 - cx) + std::min(cy, kCell - 1 - cy);
        const double tone = 0.8 + 0.4 * hash01(column, row, 5) + 0.1 * value_noise(x / 20.0, y / 20.0, 6);
        Vec3 colour = tone * Vec3{0.20, 0.23, 0.38};
        if (cx % 42 > 39) colour = {0.40, 0.42, 0.48};             // bus bars
        if (edge < 3 || corner < 18) colour = {0.48, 0.46, 0.44};  // substrate between the cells
        return colour;
    });
    return picture;
}

/// Hatch: machined plate with radial ribs, bolt circle, an hour scale, and lettering around the target.
Picture port() {
    Picture picture;
    picture.paint([](int x, int y) {
        const double dx = x - 511.5, dy = y - 511.5, r = std::hypot(dx, dy), angle = std::atan2(dy, dx);
        double value =
            0.78 + 0.05 * fractal_noise(x / 64.0, y / 64.0, 50) + 0.03 * value_noise(r / 2.0, angle * 4, 51);
        for (const double ring : {190.0, 300.0, 440.0})
            if (std::abs(r - ring) < 4) value *= 0.55;
        const double sector = angle * 12 / kPi, from_mark = std::abs(sector - std::round(sector)) * kPi / 12 * r;
        const bool major = static_cast<int>(std::round(sector) + 24) % 6 == 0;
        if (r > (major ? 390 : 420) && r < 440 && from_mark < (major ? 7 : 3)) value *= 0.2;
        const double spoke = std::abs(std::remainder(angle, kPi / 4)) * r;
        if (r > 200 && r < 300 && spoke < 5) value *= 0.7;
        const double bolt_angle = std::remainder(angle, kPi / 16), bolt = std::hypot(r - 470, bolt_angle * r);
        if (bolt < 11) value *= bolt < 7 ? 0.45 : 0.7;
        value *= 1 - 0.2 * std::max(0.0, fractal_noise(x / 200.0, y / 200.0, 55));
        return value * Vec3{1, 0.99, 0.97};
    });
    Random random(77);
    letters(picture, 330, 250, 5, 5, 0.2, random);
    letters(picture, 560, 250, 4, 5, 0.2, random);
    letters(picture, 340, 740, 9, 4, 0.2, random);
    letters(picture, 230, 540, 3, 4, 0.25, random);
    letters(picture, 735, 440, 3, 4, 0.25, random);
    return picture;
}

/// The ring's face: turned metal, a degree scale on the outer flange, stripes that tell the sectors apart.
Picture ring() {
    Picture picture;
    picture.paint([](int x, int y) {
        const double dx = x - 511.5, dy = y - 511.5, r = std::hypot(dx, dy), angle = std::atan2(dy, dx);
        double value =
            0.80 + 0.05 * value_noise(r / 1.5, angle * 6, 60) + 0.08 * fractal_noise(x / 40.0, y / 40.0, 61);
        value *= 1 - 0.25 * std::max(0.0, fractal_noise(x / 110.0, y / 110.0, 62));
        const double tick = angle * 36 / kPi, from_tick = std::abs(tick - std::round(tick)) * kPi / 36 * r;
        const bool major = static_cast<int>(std::round(tick) + 72) % 6 == 0;
        if (r > (major ? 440 : 462) && r < 480 && from_tick < (major ? 4 : 2)) value *= 0.25;
        const int sector = static_cast<int>(std::floor((angle + kPi) * 12 / kPi));
        if (r > 322 && r < 348 && sector % 8 < 2 && static_cast<int>(std::floor(angle * r / 9 + 900)) % 2 == 0)
            value *= 0.3;
        const double scratch = value_noise(x / 2.0 + y / 17.0, y / 60.0 - x / 300.0, 64);
        if (scratch > 0.82) value *= 0.82;
        return value * Vec3{1, 1, 1};
    });
    Random random(78);
    for (int k = 0; k < 8; ++k) {
        const double angle = 0.35 + k * kPi / 4;
        letters(picture, 500 + static_cast<int>(std::lround(430 * std::cos(angle))),
                505 + static_cast<int>(std::lround(430 * std::sin(angle))), 2, 2, 0.25, random);
    }
    return picture;
}

/// Dust in patches, grains, and here and there a bright stone of a texel or two.
Picture ground() {
    Picture picture;
    picture.paint([](int x, int y) {
        double value = 0.78 + 0.16 * fractal_noise(x / 150.0, y / 150.0, 90) +
                       0.12 * fractal_noise(x / 16.0, y / 16.0, 95) + 0.08 * (hash01(x, y, 99) - 0.5);
        if (hash01(x / 2, y / 2, 100) > 0.996) value += 0.2;
        return value * Vec3{1, 1, 1};
    });
    return picture;
}

}  // namespace

void write_ground_texture(const std::string& directory) {
    ground().write(directory + "/ground.png");
}

void write_textures(const std::string& directory) {
    hull().write(directory + "/hull.png");
    blanket().write(directory + "/blanket.png");
    cells().write(directory + "/cells.png");
    port().write(directory + "/port.png");
    ring().write(directory + "/ring.png");
}

}  // namespace narpa::scenes
