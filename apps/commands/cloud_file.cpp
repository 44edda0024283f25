#include "apps/commands/cloud_file.h"

#include <fmt/format.h>

namespace narpa::cli {

void write_cloud(std::ostream& out, bool ply, std::string_view comment, std::span<const std::string_view> fields,
                 std::span<const std::string> lines) {
    if (ply) {
        out << fmt::format("ply\nformat ascii 1.0\ncomment {}\nelement vertex {}\n", comment, lines.size());
        for (const std::string_view field : fields) out << fmt::format("property float {}\n", field);
        out << "end_header\n";
    } else {
        const auto each = [&](std::string_view value) {
            std::string all;
            for (std::size_t i = 0; i < fields.size(); ++i) all += fmt::format(" {}", value);
            return all;
        };
        out << fmt::format(
            "# .PCD v0.7\n# {}\nVERSION 0.7\nFIELDS {}\nSIZE{}\nTYPE{}\nCOUNT{}\nWIDTH {}\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
            comment, fmt::join(fields, " "), each("4"), each("F"), each("1"), lines.size(), lines.size());
    }
    for (const std::string& line : lines) out << line;
}

}  // namespace narpa::cli
