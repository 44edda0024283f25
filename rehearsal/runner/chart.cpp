#include "rehearsal/runner/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {
namespace {

constexpr double kLeft = 58, kRight = 14, kTop = 30, kBottom = 40, kLegend = 18;

/// 1, 2 or 5 times a power of ten, so that about `wanted` of them make up the range.
double round_step(double range, int wanted) {
    const double raw = range / wanted, power = std::pow(10, std::floor(std::log10(raw)));
    for (const double m : {1.0, 2.0, 5.0})
        if (m * power >= raw) return m * power;
    return 10 * power;
}

}  // namespace

struct Chart::Frame {
    double x0, x1, y0, y1, left, right, top, bottom;
    static int next_id() {
        static int id = 0;
        return ++id;
    }
    [[nodiscard]] double px(double x) const { return left + (x - x0) / (x1 - x0) * (right - left); }
    [[nodiscard]] double py(double y) const { return bottom - (y - y0) / (y1 - y0) * (bottom - top); }
    /// Far outside is as good as anywhere outside, and keeps the numbers short.
    [[nodiscard]] std::string at(double x, double y) const {
        return fmt::format("{:.1f},{:.1f}", std::clamp(px(x), -1e4, 1e4), std::clamp(py(y), -1e4, 1e4));
    }
};

Chart::Chart(std::string title, std::string x_label, std::string y_label, double width, double height)
    : title_(std::move(title)),
      x_label_(std::move(x_label)),
      y_label_(std::move(y_label)),
      width_(width),
      height_(height) {}

void Chart::range_x(double low, double high) {
    x_[0] = low, x_[1] = high, fixed_x_ = true;
}
void Chart::range_y(double low, double high) {
    y_[0] = low, y_[1] = high, fixed_y_ = true;
}

void Chart::legend_entry(const std::string& label, const std::string& colour, Shape::Kind kind, bool dashed) {
    if (!label.empty()) legend_.push_back({label, colour, kind, dashed});
}

void Chart::line(const Points& points, const std::string& colour, double width, const std::string& label,
                 bool dashed) {
    shapes_.push_back({Shape::Kind::line, points, colour, "", width, dashed});
    legend_entry(label, colour, Shape::Kind::line, dashed);
}
void Chart::dots(const Points& points, const std::string& colour, double radius, const std::string& label) {
    shapes_.push_back({Shape::Kind::dots, points, colour, "", radius});
    legend_entry(label, colour, Shape::Kind::dots, false);
}
void Chart::area(const Points& corners, const std::string& colour, const std::string& label) {
    shapes_.push_back({Shape::Kind::area, corners, colour, ""});
    legend_entry(label, colour, Shape::Kind::area, false);
}
void Chart::band(const Points& low, const Points& high, const std::string& colour, const std::string& label) {
    Points corners = low;
    corners.insert(corners.end(), high.rbegin(), high.rend());
    area(corners, colour, label);
}
void Chart::circle(double x, double y, double radius, const std::string& colour, const std::string& label) {
    Points around;
    for (int i = 0; i <= 96; ++i) {
        const double angle = i * 2 * 3.14159265358979323846 / 96;
        around.emplace_back(x + radius * std::cos(angle), y + radius * std::sin(angle));
    }
    line(around, colour, 1.2, label, true);
}
void Chart::text(double x, double y, const std::string& words) {
    shapes_.push_back({Shape::Kind::text, {{x, y}}, "", words});
}
void Chart::shade(double from, double to, const std::string& colour, const std::string& words) {
    shapes_.push_back({Shape::Kind::shade, {{from, 0}, {to, 0}}, colour, words});
}
void Chart::ticks(const std::vector<double>& x, const std::string& colour, const std::string& label) {
    Points points;
    for (const double v : x) points.emplace_back(v, 0);
    shapes_.push_back({Shape::Kind::ticks, points, colour, ""});
    legend_entry(label, colour, Shape::Kind::line, false);
}

Chart::Frame Chart::frame() const {
    Frame f{x_[0],
            x_[1],
            y_[0],
            y_[1],
            kLeft,
            width_ - kRight,
            kTop + (legend_.empty() ? 0 : kLegend),
            height_ - kBottom};
    for (const Shape& s : shapes_)
        for (const auto& [x, y] : s.points) {
            if (!fixed_x_) f.x0 = std::min(f.x0, x), f.x1 = std::max(f.x1, x);
            const bool has_y = s.kind != Shape::Kind::shade && s.kind != Shape::Kind::ticks;
            if (!fixed_y_ && has_y) f.y0 = std::min(f.y0, y), f.y1 = std::max(f.y1, y);
        }
    if (f.x0 > f.x1) f.x0 = 0, f.x1 = 1;
    if (f.y0 > f.y1) f.y0 = 0, f.y1 = 1;
    const auto widen = [](double& low, double& high, double by) {
        const double more = by * std::max(high - low, 1e-9 + 1e-3 * std::abs(high));
        low -= more, high += more;
    };
    if (!fixed_x_ && equal_) widen(f.x0, f.x1, 0.05);
    if (!fixed_y_) widen(f.y0, f.y1, 0.06);
    if (f.x1 - f.x0 < 1e-12) widen(f.x0, f.x1, 1);
    if (equal_) {
        const double sx = (f.x1 - f.x0) / (f.right - f.left), sy = (f.y1 - f.y0) / (f.bottom - f.top);
        const double dx = 0.5 * (std::max(sx, sy) / sx - 1) * (f.x1 - f.x0);
        const double dy = 0.5 * (std::max(sx, sy) / sy - 1) * (f.y1 - f.y0);
        f.x0 -= dx, f.x1 += dx, f.y0 -= dy, f.y1 += dy;
    }
    return f;
}

std::string Chart::drawn(const Shape& s, const Frame& f) const {
    std::string out, path;
    switch (s.kind) {
        case Shape::Kind::line:
        case Shape::Kind::area: {
            double last_x = -1e9, last_y = -1e9;
            for (std::size_t i = 0; i < s.points.size(); ++i) {
                const auto [x, y] = s.points[i];
                if (!std::isfinite(x) || !std::isfinite(y)) continue;
                const bool near = std::abs(f.px(x) - last_x) + std::abs(f.py(y) - last_y) < 0.4;
                if (near && i + 1 < s.points.size()) continue;
                last_x = f.px(x), last_y = f.py(y);
                path += (path.empty() ? "M" : " ") + f.at(x, y);
            }
            if (s.kind == Shape::Kind::area)
                return fmt::format("<path d=\"{}Z\" fill=\"{}\" fill-opacity=\"0.18\"/>", path, s.colour);
            return fmt::format(
                "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{}/>",
                path, s.colour, s.size, s.dashed ? " stroke-dasharray=\"5 4\"" : "");
        }
        case Shape::Kind::dots:
            for (const auto& [x, y] : s.points) path += fmt::format("M{}h0", f.at(x, y));
            return fmt::format(
                "<path d=\"{}\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\" "
                "stroke-opacity=\"0.8\"/>",
                path, s.colour, 2 * s.size);
        case Shape::Kind::text:
            return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"note\">{}</text>",
                               f.px(s.points[0].first) + 4, f.py(s.points[0].second) - 5, escape(s.words));
        case Shape::Kind::shade: {
            const double x0 = std::max(f.px(s.points[0].first), f.left),
                         x1 = std::min(f.px(s.points[1].first), f.right);
            if (x1 <= x0) return "";
            out = fmt::format(
                "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
                "fill-opacity=\"0.13\"/>",
                x0, f.top, x1 - x0, f.bottom - f.top, s.colour);
            if (x1 - x0 > 6.5 * static_cast<double>(s.words.size()))
                out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"note\">{}</text>", x0 + 3, f.top + 12,
                                   escape(s.words));
            return out;
        }
        case Shape::Kind::ticks:
            for (const auto& [x, unused] : s.points) path += fmt::format("M{:.1f},{:.1f}v-5", f.px(x), f.bottom);
            return fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"0.8\"/>", path, s.colour);
    }
    return out;
}

std::string Chart::axes(const Frame& f) const {
    std::string out;
    const double step_x = round_step(f.x1 - f.x0, width_ > 400 ? 8 : 5),
                 step_y = round_step(f.y1 - f.y0, height_ > 200 ? 6 : 4);
    const auto number = [](double v, double step) {
        return fmt::format("{:g}", std::abs(v) < 1e-9 * step ? 0 : std::round(v / step * 1e6) * step / 1e6);
    };
    for (double x = std::ceil(f.x0 / step_x) * step_x; x <= f.x1 + 1e-9 * step_x; x += step_x)
        out += fmt::format(
            "<path d=\"M{0:.1f},{1:.1f}V{2:.1f}\" class=\"grid\"/><text x=\"{0:.1f}\" y=\"{3:.1f}\" "
            "text-anchor=\"middle\">{4}</text>",
            f.px(x), f.top, f.bottom, f.bottom + 14, number(x, step_x));
    for (double y = std::ceil(f.y0 / step_y) * step_y; y <= f.y1 + 1e-9 * step_y; y += step_y)
        out += fmt::format(
            "<path d=\"M{0:.1f},{1:.1f}H{2:.1f}\" class=\"grid\"/><text x=\"{3:.1f}\" y=\"{4:.1f}\" "
            "text-anchor=\"end\">{5}</text>",
            f.left, f.py(y), f.right, f.left - 6, f.py(y) + 4, number(y, step_y));
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>", (f.left + f.right) / 2,
                       height_ - 8, escape(x_label_));
    out += fmt::format("<text transform=\"translate(13 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
                       (f.top + f.bottom) / 2, escape(y_label_));
    return out;
}

std::string Chart::legend(const Frame& f) const {
    std::string out;
    double x = f.left;
    for (const Entry& e : legend_) {
        const double y = kTop + 4;
        if (e.kind == Shape::Kind::area)
            out += fmt::format(
                "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"16\" height=\"9\" fill=\"{}\" "
                "fill-opacity=\"0.25\"/>",
                x, y - 5, e.colour);
        else if (e.kind == Shape::Kind::dots)
            out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\" fill=\"{}\"/>", x + 8, y, e.colour);
        else
            out += fmt::format("<path d=\"M{:.1f},{:.1f}h16\" stroke=\"{}\" stroke-width=\"1.8\"{}/>", x, y,
                               e.colour, e.dashed ? " stroke-dasharray=\"4 3\"" : "");
        out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", x + 20, y + 4, escape(e.label));
        x += 32 + 6.1 * static_cast<double>(e.label.size());
    }
    return out;
}

std::string Chart::svg() const {
    const Frame f = frame();
    const int id = Frame::next_id();
    std::string out = fmt::format(
        "<svg viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" role=\"img\" aria-label=\"{2}\"><text x=\"{3:g}\" "
        "y=\"17\" class=\"title\">{2}</text><clipPath id=\"c{4}\"><rect x=\"{5:.1f}\" y=\"{6:.1f}\" "
        "width=\"{7:.1f}\" "
        "height=\"{8:.1f}\"/></clipPath>",
        width_, height_, escape(title_), kLeft, id, f.left, f.top, f.right - f.left, f.bottom - f.top);
    out += axes(f) + fmt::format("<g clip-path=\"url(#c{})\">", id);
    for (const bool behind : {true, false})
        for (const Shape& s : shapes_)
            if ((s.kind == Shape::Kind::shade) == behind) out += drawn(s, f) + "\n";
    return out + "</g>" + legend(f) + "</svg>\n";
}

}  // namespace narpa::rehearsal
