/// rehearsal/runner/chart.h - a chart as SVG text, to stand in a page.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace narpa::rehearsal {

/// Colours that eyes of all kinds tell apart (M. Okabe, K. Ito, 2008).
inline constexpr const char *kBlue = "#0072B2", *kVermilion = "#D55E00", *kGreen = "#009E73", *kOrange = "#E69F00",
                            *kSky = "#56B4E9", *kPurple = "#CC79A7", *kGrey = "#8a8f98";

using Points = std::vector<std::pair<double, double>>;

/// Axes with ticks at round numbers, in the units of the data; what lies outside of the axes is cut.
class Chart {
public:
    Chart(std::string title, std::string x_label, std::string y_label, double width = 560, double height = 260);

    void range_x(double low, double high);
    void range_y(double low, double high);
    /// One unit is as long on both axes; the shorter range is made longer.
    void equal_scales() { equal_ = true; }

    /// What has a label stands in the legend.
    void line(const Points& points, const std::string& colour, double width = 1.6, const std::string& label = "",
              bool dashed = false);
    void dots(const Points& points, const std::string& colour, double radius = 1.6, const std::string& label = "");
    /// Between two lines over the same x.
    void band(const Points& low, const Points& high, const std::string& colour, const std::string& label = "");
    void area(const Points& corners, const std::string& colour, const std::string& label = "");
    void circle(double x, double y, double radius, const std::string& colour, const std::string& label = "");
    void text(double x, double y, const std::string& words);
    /// The whole height, behind everything.
    void shade(double from, double to, const std::string& colour, const std::string& words);
    /// Short strokes on the lower edge.
    void ticks(const std::vector<double>& x, const std::string& colour, const std::string& label = "");

    [[nodiscard]] std::string svg() const;

private:
    struct Shape {
        enum class Kind { line, dots, area, text, shade, ticks } kind;
        Points points;
        std::string colour, words;
        double size = 1;
        bool dashed = false;
    };
    struct Frame;
    void legend_entry(const std::string& label, const std::string& colour, Shape::Kind kind, bool dashed);
    [[nodiscard]] Frame frame() const;
    [[nodiscard]] std::string drawn(const Shape& shape, const Frame& f) const;
    [[nodiscard]] std::string axes(const Frame& f) const;
    [[nodiscard]] std::string legend(const Frame& f) const;

    std::string title_, x_label_, y_label_;
    double width_, height_;
    std::vector<Shape> shapes_;
    struct Entry {
        std::string label, colour;
        Shape::Kind kind;
        bool dashed;
    };
    std::vector<Entry> legend_;
    double x_[2] = {1e300, -1e300}, y_[2] = {1e300, -1e300};
    bool fixed_x_ = false, fixed_y_ = false, equal_ = false;
};

}  // namespace narpa::rehearsal
