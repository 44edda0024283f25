/// plot/plot.h - plots are drawn by narpa-plot (python/narpa/plots, matplotlib) from a JSON document.
///
/// The document's "plot" names its kind, e.g. "loop"; python/narpa/plots lists the kinds and their keys. The
/// document is kept beside the picture, so that a plot can be drawn again, elsewhere or differently.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "base/result.h"

namespace narpa {

/// Writes the document beside `picture`, with the extension .json, and starts narpa-plot to draw it. `picture` is a
/// PNG, SVG or PDF file, or a folder for a document of several charts. Where narpa-plot or matplotlib is missing, a
/// sentence on standard error says so and only the JSON is written: no error. The environment variable NARPA_PLOT
/// names another program; NARPA_PLOT=true draws nothing. Starts a process: not for the loop.
[[nodiscard]] Status write_plot(const std::string& picture, const nlohmann::json& document);

/// An Error if write_plot could not write there: lets commands that measure for minutes fail early.
[[nodiscard]] Status can_write_plot(const std::string& picture);

/// A linear value from 0 to 1 as a display's 8 bits (sRGB, IEC 61966-2-1).
[[nodiscard]] std::uint8_t srgb_byte(double linear);

/// An image within a document: 8 bits a channel, rows from the top; `channels`: 1 (grey) or 3 (RGB).
[[nodiscard]] nlohmann::json plot_image(int width, int height, int channels, std::span<const std::uint8_t> pixels);

}  // namespace narpa
