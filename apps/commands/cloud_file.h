/// apps/commands/cloud_file.h - point clouds as ASCII PLY or PCD.
#pragma once

#include <ostream>
#include <span>
#include <string>
#include <string_view>

namespace narpa::cli {

/// `ply`: PLY, else PCD; both state the number of points first. `fields`: names, each a float. `lines`: the values
/// of a point each, separated by blanks, with a line feed.
void write_cloud(std::ostream& out, bool ply, std::string_view comment, std::span<const std::string_view> fields,
                 std::span<const std::string> lines);

}  // namespace narpa::cli
