/// dataset/gather/contact_sheet_document.h - some images of a data set with their labels, as a document of
/// narpa-plot.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/result.h"

namespace narpa::dataset {

/// Up to 24 images, evenly spread, with boxes and keypoints.
class ContactSheetDocument {
public:
    ContactSheetDocument(std::string folder, std::uint32_t images);
    ~ContactSheetDocument();

    /// Reads the image of the label if it is one of those that are shown. Throws nlohmann::json::exception where
    /// the label is none.
    Status add(const nlohmann::json& label);
    /// Document of the plot "contact_sheet".
    [[nodiscard]] nlohmann::json document() const;

private:
    struct Tiles;
    const std::string folder_;
    const std::uint32_t stride_;
    const std::unique_ptr<Tiles> tiles_;
};

}  // namespace narpa::dataset
