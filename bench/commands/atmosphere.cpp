// narpa bench atmosphere - error and time of the atmosphere against its numbers of shells, steps, table entries and
// wavelengths.
#include <fmt/format.h>

#include <array>
#include <cmath>

#include "bench/air_error.h"
#include "bench/commands/commands.h"

namespace narpa::cli {
namespace {

struct AirBenchOptions {
    bool skies = false;
    int paths = 20'000;
};

nlohmann::json air_rows(const std::vector<AirErrorRow>& rows, const char* setting) {
    nlohmann::json out = nlohmann::json::array();
    for (const AirErrorRow& r : rows)
        out.push_back({{setting, r.setting},
                       {"error", r.rms},
                       {"error_most", r.most},
                       {"time_s", r.time_s},
                       {"bytes", r.bytes},
                       {"default", r.is_default}});
    return out;
}

void print_rows(const std::vector<AirErrorRow>& rows, const char* setting, const char* time) {
    say(fmt::format("{:>22} {:>10} {:>10} {:>14} {:>10}", setting, "RMS error", "largest", time, "KB"));
    for (const AirErrorRow& r : rows)
        say(fmt::format("{:>22} {:>8.3f} % {:>8.3f} % {:>14.4g} {:>10.0f}{}", r.setting, 100 * r.rms, 100 * r.most,
                        r.time_s * 1e6, 1e-3 * static_cast<double>(r.bytes), r.is_default ? "  default" : ""));
}

/// Root mean squares of the physical sky's difference from the path-traced one, and of the latter's own error, by
/// turbidity and elevation: of the aureole and of the rest of the sky.
void print_differences(const std::vector<SkyComparison>& rows) {
    say("\nphysical over path-traced - 1, RMS (and the path-traced one's error)");
    say(fmt::format("{:>9} {:>9} {:>20} {:>20}", "turbidity", "elevation", "aureole", "elsewhere"));
    struct Sum {
        double off = 0, error = 0;
        int n = 0;
        [[nodiscard]] std::string text() const {
            return fmt::format("{:.1f} % ({:.1f} %)", 100 * std::sqrt(off / n), 100 * std::sqrt(error / n));
        }
    };
    for (auto row = rows.begin(); row != rows.end();) {
        std::array<Sum, 2> sums;
        const SkyComparison& first = *row;
        for (; row != rows.end() && row->turbidity == first.turbidity && row->elevation_deg == first.elevation_deg;
             ++row) {
            Sum& sum = sums[row->aureole ? 0 : 1];
            sum.off += std::pow(row->physical / row->path_traced - 1, 2);
            sum.error += std::pow(row->path_traced_error / row->path_traced, 2);
            ++sum.n;
        }
        say(fmt::format("{:>9g} {:>9g} {:>20} {:>20}", first.turbidity, first.elevation_deg, sums[0].text(),
                        sums[1].text()));
    }
}

Outcome bench_skies(const AirBenchOptions& o) {
    Progress progress("measuring");
    const auto rows =
        compare_skies(static_cast<std::size_t>(o.paths), [&](const std::string& s) { progress.show(s); });
    say("radiance of the green band for an irradiance of 1, 1/sr");
    say(fmt::format("{:>9} {:>9} {:>7} {:>8} {:>10} {:>21} {:>13} {:>8}", "turbidity", "elevation", "zenith",
                    "azimuth", "physical", "path-traced", "Hosek-Wilkie", "HW/phys"));
    nlohmann::json out = nlohmann::json::array();
    for (const SkyComparison& c : rows) {
        say(fmt::format("{:>9g} {:>9g} {:>7g} {:>8g} {:>10.5f} {:>10.5f} +- {:>7.5f} {:>13.5f} {:>8.2f}",
                        c.turbidity, c.elevation_deg, c.zenith_deg, c.azimuth_deg, c.physical, c.path_traced,
                        c.path_traced_error, c.hosek_wilkie, c.hosek_wilkie / c.physical));
        out.push_back({{"turbidity", c.turbidity},
                       {"elevation_deg", c.elevation_deg},
                       {"zenith_deg", c.zenith_deg},
                       {"azimuth_deg", c.azimuth_deg},
                       {"physical", c.physical},
                       {"aureole", c.aureole},
                       {"path_traced", c.path_traced},
                       {"path_traced_error", c.path_traced_error},
                       {"hosek_wilkie", c.hosek_wilkie}});
    }
    print_differences(rows);
    return nlohmann::json{{"passed", true}, {"skies", out}};
}

Outcome bench_atmosphere(const AirBenchOptions& o) {
    if (o.skies) return bench_skies(o);
    AirErrors e;
    {
        Progress progress("measuring");
        e = measure_air_errors([&](const std::string& s) { progress.show(s); });
    }
    say("refraction by shells; arcsec");
    say(fmt::format("{:>22} {:>10} {:>10} {:>14}", "shells", "at 85 deg", "at 89 deg", "us a ray"));
    for (const AirErrorRow& r : e.shells)
        say(fmt::format("{:>22} {:>10.4f} {:>10.4f} {:>14.3g}{}", r.setting, r.rms, r.most, 1e6 * r.time_s,
                        r.is_default ? "  default" : ""));
    say("\nscattered light, of views from ground, air and orbit, against the finest");
    print_rows(e.steps, "steps", "us a ray");
    print_rows(e.tables, "heights of the tables", "CPU us to make");
    print_rows(e.bands, "wavelengths a band", "us a ray");
    say("\n16 tiles of 8 x 8 pixels by interpolation, against each ray by itself");
    print_rows(e.bundles, "tolerance, 1e-4", "us a ray");
    return nlohmann::json{{"passed", true},
                          {"tiles", air_rows(e.bundles, "tolerance_1e4")},
                          {"shells", air_rows(e.shells, "shells")},
                          {"steps", air_rows(e.steps, "steps")},
                          {"tables", air_rows(e.tables, "heights")},
                          {"bands", air_rows(e.bands, "samples_per_band")}};
}

}  // namespace

Command add_bench_atmosphere(Parser bench_command) {
    auto o = std::make_shared<AirBenchOptions>();
    const Parser c = bench_command.subcommand(
        "atmosphere", "Error and time of an atmosphere's shells, steps, tables and wavelengths; or of its skies");
    c.flag(
        "--skies", o->skies,
        "Compare the physical sky with Hosek and Wilkie's and with a path-traced one, by elevation and turbidity");
    c.option("--paths", o->paths, "Paths of each path-traced radiance").range(100, 100'000'000).shows_default();
    return [o] { return bench_atmosphere(*o); };
}

}  // namespace narpa::cli
