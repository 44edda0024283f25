#include "rehearsal/runner/report_charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "rehearsal/judge/statistics.h"
#include "rehearsal/runner/chart.h"

namespace narpa::rehearsal {
namespace {

using nlohmann::json;

constexpr double kDeg = 180 / std::numbers::pi;
constexpr const char* kPhaseColours[] = {kSky, kGreen, kOrange, kPurple, kVermilion, kGrey};

Points path_of(const auto& samples, int along, int across, auto position) {
    Points points;
    for (const auto& s : samples) points.emplace_back(position(s)[along], position(s)[across]);
    return points;
}

void draw_approach(const Report& report, Chart& chart, int along, int across, double from, double to) {
    const Gates& g = report.scenario.gates;
    if (along == 0 && g.corridor) {
        const double far = std::min(g.corridor->from_m, to), near = std::max(0.0, from);
        const double slope = std::tan(g.corridor->half_angle_deg / kDeg), r = g.corridor->radius_m;
        chart.area(
            {{near, r + near * slope}, {far, r + far * slope}, {far, -r - far * slope}, {near, -r - near * slope}},
            kGreen, "corridor");
    }
    if (along == 1 && g.corridor) chart.circle(0, 0, g.corridor->radius_m, kGreen, "corridor at the port");
    if (g.keep_out_m) chart.circle(0, 0, *g.keep_out_m, kVermilion, "keep-out sphere");
    if (g.distance_m) {
        chart.circle(0, 0, g.distance_m->first, kVermilion, "distance allowed");
        chart.circle(0, 0, g.distance_m->second, kVermilion);
    }
    const auto truth = path_of(report.bus.truth, along, across, [](const TruthState& s) { return s.position_m(); });
    const auto estimated =
        path_of(report.bus.estimates, along, across, [](const JudgedEstimate& e) { return e.port_position_m; });
    chart.line(truth, kBlue, 1.8, "true");
    chart.dots(estimated, kOrange, 1.1, "estimated");
    Points holds;
    for (const Leg& leg : report.scenario.legs)
        if (!leg.arc_deg && !leg.contact) holds.emplace_back(leg.to_m[along], leg.to_m[across]);
    chart.dots(holds, "#1d232b", 3, "hold points");
}

/// Half the width that shows a path across, and little else.
double half_width(const Report& report, int axis) {
    double most = 0.15;
    for (const TruthState& s : report.bus.truth) most = std::max(most, std::abs(s.position_m()[axis]));
    for (const Leg& leg : report.scenario.legs)
        if (!leg.arc_deg) most = std::max(most, std::abs(leg.to_m[axis]));
    return most * 1.3;
}

void shade_phases(const Report& report, Chart& chart) {
    const auto& commands = report.bus.commands;
    for (std::size_t i = 0; i < commands.size();) {
        std::size_t j = i;
        while (j < commands.size() && commands[j].phase == commands[i].phase && commands[j].leg == commands[i].leg)
            ++j;
        const double to = report.bus.seconds(j < commands.size() ? commands[j].t_ns : commands[j - 1].t_ns);
        const auto phase = static_cast<std::size_t>(commands[i].phase);
        chart.shade(report.bus.seconds(commands[i].t_ns), to, kPhaseColours[phase],
                    fmt::format("{} {}", kGuidancePhases[phase], commands[i].leg + 1));
        i = j;
    }
}

bool captured(const Report& report) {
    return report.verdict.contact && report.verdict.contact->captured;
}

}  // namespace

std::string approach_charts(const Report& report) {
    double low = 0, high = 1;
    for (const TruthState& s : report.bus.truth)
        low = std::min(low, s.position_m().x), high = std::max(high, s.position_m().x);
    const double more = 0.04 * (high - low);
    const bool round = report.scenario.gates.distance_m.has_value();  // about the port, not along its axis
    std::string out = "<div class=\"charts\">";
    const auto view = [&](const char* title, const char* x, const char* y, int along, int across, double width) {
        Chart chart(title, x, y, width, 330);
        double from = low - more, to = high + more;
        if (along == 1) from = -half_width(report, 1), to = -from;
        chart.range_x(from, to);
        chart.range_y(-half_width(report, across), half_width(report, across));
        if (round || along == 1) chart.equal_scales();
        draw_approach(report, chart, along, across, from, to);
        out += chart.svg();
    };
    view("From above", "x [m]", "y [m]", 0, 1, 560);
    view("From the side", "x [m]", "z [m]", 0, 2, 560);
    view("From the front", "y [m]", "z [m]", 1, 2, 560);
    // The last metres, where the limits of contact can be seen.
    if (report.scenario.gates.contact) {
        Chart chart("The last three metres, from the front", "y [m]", "z [m]", 560, 330);
        Points end;
        for (const TruthState& s : report.bus.truth)
            if (s.position_m().x < 3) end.emplace_back(s.position_m().y, s.position_m().z);
        const double r = report.scenario.gates.contact->lateral_m;
        chart.range_x(-2 * r, 2 * r);
        chart.range_y(-2 * r, 2 * r);
        chart.equal_scales();
        chart.line(end, kBlue, 1.8, "true");
        chart.circle(0, 0, r, kGreen, "lateral misalignment at contact");
        if (report.verdict.contact)
            chart.dots(
                {{report.verdict.contact->state.position_m().y, report.verdict.contact->state.position_m().z}},
                kVermilion, 4, "contact");
        out += chart.svg();
    }
    return out + "</div>\n";
}

std::string motion_charts(const Report& report) {
    Points range, closing, lateral;
    for (const TruthState& s : report.bus.truth) {
        const double t = report.bus.seconds(s.t_ns);
        range.emplace_back(t, s.range_m());
        closing.emplace_back(t, s.closing_m_s());
        lateral.emplace_back(t, s.lateral_m_s());
    }
    Chart far("Range", "t [s]", "between the ports [m]", 1130, 240), rate("Rates", "t [s]", "[m/s]", 1130, 240);
    shade_phases(report, far);
    shade_phases(report, rate);
    far.line(range, kBlue, 1.8);
    rate.line(closing, kBlue, 1.8, "closing");
    rate.line(lateral, kVermilion, 1.4, "lateral");
    if (report.scenario.gates.contact) {
        const double t0 = 0, t1 = report.verdict.t_end_s;
        const CaptureEnvelope& c = *report.scenario.gates.contact;
        rate.line({{t0, c.closing_max_m_s}, {t1, c.closing_max_m_s}}, kGreen, 1, "closing rate asked at contact",
                  true);
        rate.line({{t0, c.closing_min_m_s}, {t1, c.closing_min_m_s}}, kGreen, 1, "", true);
    }
    return "<div class=\"charts\">" + far.svg() + rate.svg() + "</div>\n";
}

std::string error_charts(const Report& report) {
    const auto& estimates = report.bus.estimates;
    std::string out = "<div class=\"charts\">";
    std::vector<double> frames, sweeps;
    for (const JudgedEstimate& e : estimates) {
        if (e.frames > 0) frames.push_back(report.bus.seconds(e.t_ns));
        if (e.sweeps > 0) sweeps.push_back(report.bus.seconds(e.t_ns));
    }
    for (int quantity = 0; quantity < 2; ++quantity)
        for (int axis = 0; axis < 3; ++axis) {
            const double unit = quantity == 0 ? 100 : kDeg;
            Points error, low, high;
            std::vector<double> bound;
            double most = 0;
            for (const JudgedEstimate& e : estimates) {
                const double t = report.bus.seconds(e.t_ns);
                if (captured(report) && t > report.verdict.contact->t_s) break;  // one body: nothing more to know
                const double value = (quantity == 0 ? e.position_error_m : e.rotation_error_rad)[axis] * unit;
                const double sigma = (quantity == 0 ? e.sigma_position_m : e.sigma_rotation_rad)[axis] * unit;
                error.emplace_back(t, value);
                low.emplace_back(t, -3 * sigma);
                high.emplace_back(t, 3 * sigma);
                bound.push_back(3 * sigma);
                if (t > 0.03 * report.verdict.t_end_s) most = std::max(most, std::abs(value));
            }
            Chart chart(fmt::format("{} {}", quantity == 0 ? "Position" : "Attitude about", "xyz"[axis]), "t [s]",
                        quantity == 0 ? "[cm]" : "[deg]", 365, 210);
            // The start's uncertainty would hide all the rest.
            const double span = std::max({1.25 * most, 1.2 * distribution(bound).p50, 1e-6});
            chart.range_y(-span, span);
            chart.band(low, high, kSky, "3 sigma");
            chart.line(error, kBlue, 1.3, "error");
            chart.ticks(frames, kVermilion, frames.empty() ? "" : "frames");
            chart.ticks(sweeps, kGreen, sweeps.empty() ? "" : "sweeps");
            out += chart.svg();
        }
    return out + "</div>\n";
}

std::string latency_chart(const Report& report) {
    Points latency;
    for (const FrameLedger& f : report.bus.ledgers)
        if (f.t_hand_over_ns != 0)
            latency.emplace_back(report.bus.seconds(f.t_exposure_mid_ns),
                                 static_cast<double>(f.t_hand_over_ns - f.t_pose_ns) * 1e-6);
    Chart chart("Pose command to hand-over", "t [s]", "[ms]", 1130, 220);
    chart.dots(latency, kBlue, 1.3);
    return chart.svg();
}

std::string contact_bars(const ContactConditions& conditions) {
    std::string out;
    constexpr double kWidth = 900, kRow = 34, kLeft = 190, kBar = 430;
    double y = 8;
    for (const ContactCondition& c : conditions) {
        // Full scale is a third beyond the limit, or what there is.
        const double scale = kBar / std::max(c.max * 1.33, c.value * 1.05);
        const char* colour = c.within() ? kBlue : kVermilion;
        out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\" style=\"font-size:13px\">{}</text>",
                           kLeft - 12, y + 15, escape(c.title));
        out += fmt::format(
            "<rect x=\"{}\" y=\"{}\" width=\"{:.1f}\" height=\"18\" fill=\"{}\" fill-opacity=\"0.16\"/>",
            kLeft + c.min * scale, y + 1, (c.max - c.min) * scale, kGreen);
        out += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{:.1f}\" height=\"8\" fill=\"{}\"/>", kLeft, y + 6,
                           std::max(1.5, c.value * scale), colour);
        for (const double limit : {c.min, c.max})
            if (limit > 0)
                out += fmt::format("<path d=\"M{:.1f},{}v22\" stroke=\"#1d232b\" stroke-width=\"1.5\"/>",
                                   kLeft + limit * scale, y - 1);
        const std::string asked =
            c.min > 0 ? fmt::format("{:g} to {:g}", c.min, c.max) : fmt::format("at most {:g}", c.max);
        out += fmt::format(
            "<text x=\"{}\" y=\"{}\" style=\"font-size:13px\"><tspan font-weight=\"650\" "
            "fill=\"{}\">{:.4g} {}</tspan><tspan dx=\"10\">{} {}</tspan></text>",
            kLeft + kBar + 16, y + 15, c.within() ? "#1d232b" : kVermilion, c.value, escape(c.unit), asked,
            c.within() ? "" : "- beyond");
        y += kRow;
    }
    return fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" role=\"img\" aria-label=\"contact conditions\">{2}"
        "</svg>\n",
        kWidth, y, out);
}

std::string campaign_contact_charts(const std::vector<json>& contacts) {
    Points where[2], rates[2], angles[2];  // within, beyond
    double lateral = 0.1, closing_min = 0.05, closing_max = 0.1, lateral_rate = 0.04, pitch = 4, roll = 4;
    for (const json& c : contacts) {
        const auto value = [&](std::size_t i) { return c["conditions"][i]["value"].get<double>(); };
        const auto limit = [&](std::size_t i) { return c["conditions"][i]["max"].get<double>(); };
        bool within = true;
        for (const json& k : c["conditions"]) within &= k["within"].get<bool>();
        const int i = within ? 0 : 1;
        where[i].emplace_back(c["position_m"][1].get<double>() * 100, c["position_m"][2].get<double>() * 100);
        rates[i].emplace_back(value(0) * 100, value(1) * 100);
        angles[i].emplace_back(value(3), value(4));
        closing_min = c["conditions"][0]["min"], closing_max = limit(0), lateral_rate = limit(1),
        lateral = limit(2);
        pitch = limit(3), roll = limit(4);
    }
    Chart a("Where the ports met", "y [cm]", "z [cm]", 360, 350),
        b("Rates", "closing [cm/s]", "lateral [cm/s]", 360, 350),
        c("Angles", "pitch and yaw [deg]", "roll [deg]", 360, 350);
    a.equal_scales();
    a.range_x(-130 * lateral, 130 * lateral);
    a.range_y(-130 * lateral, 130 * lateral);
    a.circle(0, 0, lateral * 100, kGreen, "asked");
    b.range_x(0, closing_max * 140);
    b.range_y(0, lateral_rate * 140);
    b.area({{closing_min * 100, 0},
            {closing_max * 100, 0},
            {closing_max * 100, lateral_rate * 100},
            {closing_min * 100, lateral_rate * 100}},
           kGreen, "asked");
    c.range_x(0, pitch * 1.3);
    c.range_y(0, roll * 1.3);
    c.area({{0, 0}, {pitch, 0}, {pitch, roll}, {0, roll}}, kGreen, "asked");
    const auto put = [](Chart& chart, const Points(&points)[2]) {
        chart.dots(points[0], kBlue, 2.4, "within");
        if (!points[1].empty()) chart.dots(points[1], kVermilion, 2.8, "beyond");
    };
    put(a, where);
    put(b, rates);
    put(c, angles);
    return "<div class=\"charts\">" + a.svg() + b.svg() + c.svg() + "</div>\n";
}

}  // namespace narpa::rehearsal
