#include "renderer/dem_reader/height_declaration.h"

#include <cpl_minixml.h>
#include <cpl_string.h>
#include <fmt/format.h>
#include <ogr_srs_api.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>

namespace narpa {
namespace {

using Json = nlohmann::json;

struct UnitName {
    const char* name;
    double metres;
};
constexpr double kFoot = 0.3048, kUsSurveyFoot = 1200.0 / 3937;
/// In lower case, without blanks, '_', '-', '.' and a final 's'.
constexpr UnitName kUnitNames[]{
    {"m", 1},
    {"metre", 1},
    {"meter", 1},
    {"mt", 1},
    {"mm", 1e-3},
    {"millimetre", 1e-3},
    {"millimeter", 1e-3},
    {"cm", 1e-2},
    {"centimetre", 1e-2},
    {"centimeter", 1e-2},
    {"dm", 0.1},
    {"decimetre", 0.1},
    {"decimeter", 0.1},
    {"km", 1e3},
    {"kilometre", 1e3},
    {"kilometer", 1e3},
    {"ft", kFoot},
    {"foot", kFoot},
    {"feet", kFoot},
    {"internationalfoot", kFoot},
    {"internationalfeet", kFoot},
    {"ftu", kUsSurveyFoot},
    {"usft", kUsSurveyFoot},
    {"sft", kUsSurveyFoot},
    {"ussurveyfoot", kUsSurveyFoot},
    {"ussurveyfeet", kUsSurveyFoot},
    {"usfoot", kUsSurveyFoot},
    {"usfeet", kUsSurveyFoot},
    {"footu", kUsSurveyFoot},
    {"surveyfoot", kUsSurveyFoot},
    {"surveyfeet", kUsSurveyFoot},
    {"foot(us)", kUsSurveyFoot},
    {"yd", 0.9144},
    {"yard", 0.9144},
    {"fathom", 1.8288},
    {"mi", 1609.344},
    {"mile", 1609.344},
    {"in", 0.0254},
    {"inch", 0.0254},
    {"nauticalmile", 1852},
};

Status check_band(GDALDatasetH file) {
    if (GDALGetRasterCount(file) < 1) return Error{"it has no raster band"};
    if (GDALGetRasterCount(file) > 1)
        return Error{fmt::format("it has {} bands, expected one, of heights", GDALGetRasterCount(file))};
    if (GDALDataTypeIsComplex(GDALGetRasterDataType(GDALGetRasterBand(file, 1))) != 0)
        return Error{"its numbers are complex, expected heights"};
    return Ok{};
}

/// The greys of a colour table; empty where the band has none. Numbers that are indices of colours are no heights.
Result<std::vector<double>> palette_of(GDALRasterBandH band) {
    std::vector<double> greys;
    const GDALColorTableH table = GDALGetRasterColorTable(band);
    for (int i = 0, count = table == nullptr ? 0 : GDALGetColorEntryCount(table); i < count; ++i) {
        const GDALColorEntry& c = *GDALGetColorEntry(table, i);
        const bool is_grey = GDALGetPaletteInterpretation(table) == GPI_Gray || (c.c1 == c.c2 && c.c2 == c.c3);
        if (!is_grey)
            return Error{
                fmt::format("its numbers are indices of a palette (colour table) with colours, {} being "
                            "({}, {}, {}), expected heights, or a palette of greys",
                            i, c.c1, c.c2, c.c3)};
        greys.push_back(c.c4 == 0 ? kNoHeight : c.c1);  // the fourth is opacity
    }
    return greys;
}

/// A label that GDAL gives as JSON; null where the file has none.
Json label_of(GDALDatasetH file, const char* domain) {
    char** text = GDALGetMetadata(file, domain);
    return text == nullptr || *text == nullptr ? Json() : Json::parse(*text, nullptr, false);
}

/// The first object of this name in a label, at any depth; null if there is none.
const Json* find_object(const Json& label, const std::string& name) {
    if (!label.is_object()) return nullptr;
    if (const auto it = label.find(name); it != label.end() && it->is_object()) return &*it;
    for (const Json& part : label)
        if (const Json* found = find_object(part, name)) return found;
    return nullptr;
}

/// A number of a label: also with a unit ({"value": x}) and as the bits of a float (16#FF7FFFFB#).
double number_of(const Json& value, GDALDataType type) {
    if (value.is_number()) return value.get<double>();
    if (value.is_object() && value.contains("value")) return number_of(value["value"], type);
    if (!value.is_string()) return kNoHeight;
    const auto text = value.get<std::string>();
    char* end = nullptr;
    if (text.starts_with("16#")) {
        const auto bits = std::strtoull(text.c_str() + 3, &end, 16);
        return type == GDT_Float32   ? static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)))
               : type == GDT_Float64 ? std::bit_cast<double>(static_cast<std::uint64_t>(bits))
               : type == GDT_Int16   ? static_cast<std::int16_t>(bits)
                                     : static_cast<double>(bits);
    }
    const double x = std::strtod(text.c_str(), &end);
    return end == text.c_str() ? kNoHeight : x;
}

std::string lower(std::string text) {
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

/// Takes what a key of a label says about missing data; false if the key says something else.
bool take_missing(const std::string& key, double number, HeightDeclaration& d) {
    const std::string k = lower(key);
    if (k == "valid_minimum")
        d.lowest = number;
    else if (k == "valid_maximum")
        d.highest = number;
    else if (k.ends_with("_constant") || k.ends_with("_saturation") || k.ends_with("_sat") || k == "null" ||
             k == "core_null")
        d.no_data.push_back(number);
    else
        return false;
    return true;
}

/// PDS3: keys of the object IMAGE. GDAL reads its scale and offset.
std::string read_pds3(GDALDatasetH file, GDALDataType type, HeightDeclaration& d) {
    const Json label = label_of(file, "json:PDS");
    const Json* image = find_object(label, "IMAGE");
    if (image == nullptr) return "";
    std::string unit;
    for (const auto& [key, value] : image->items()) {
        if (key == "UNIT" && value.is_string()) unit = value.get<std::string>();
        if (const double number = number_of(value, type); number == number) take_missing(key, number, d);
    }
    return unit;
}

/// ISIS: the lowest and the highest numbers of integers are special pixels (saturated, missing).
std::string read_isis(GDALDatasetH file, GDALDataType type, HeightDeclaration& d) {
    const Json label = label_of(file, "json:ISIS3");
    if (!label.is_object()) return "";
    if (type == GDT_Int16) d.lowest = -32752;
    if (type == GDT_UInt16) d.lowest = 3, d.highest = 65522;
    if (type == GDT_Byte) d.lowest = 1, d.highest = 254;
    const Json* band = find_object(label, "BandBin");
    for (const char* key : {"Unit", "Units"})
        if (band != nullptr && band->contains(key) && (*band)[key].is_string())
            return (*band)[key].get<std::string>();
    return "";
}

/// PDS4: the special constants of the array. GDAL reads unit, scale and offset.
void read_pds4(GDALDatasetH file, HeightDeclaration& d) {
    char** text = GDALGetMetadata(file, "xml:PDS4");
    if (text == nullptr || *text == nullptr) return;
    const std::unique_ptr<CPLXMLNode, decltype(&CPLDestroyXMLNode)> root(CPLParseXMLString(*text),
                                                                         CPLDestroyXMLNode);
    if (!root) return;
    CPLStripXMLNamespace(root.get(), nullptr, TRUE);
    const CPLXMLNode* constants = CPLSearchXMLNode(root.get(), "Special_Constants");
    for (const CPLXMLNode* n = constants == nullptr ? nullptr : constants->psChild; n != nullptr; n = n->psNext) {
        const std::string value = CPLGetXMLValue(n, nullptr, "");
        char* end = nullptr;
        const double number = std::strtod(value.c_str(), &end);
        if (end != value.c_str()) take_missing(n->pszValue, number, d);
    }
}

/// Metres and direction of the vertical axis of the file's coordinate system.
struct VerticalAxis {
    double metres = 0;  ///< of its unit; 0: there is none
    bool down = false;
    std::string unit{}, name{};
};

VerticalAxis vertical_axis(GDALDatasetH file) {
    VerticalAxis axis;
    const OGRSpatialReferenceH srs = GDALGetSpatialRef(file);
    if (srs == nullptr || OSRGetAttrValue(srs, "VERT_CS", 0) == nullptr) return axis;
    axis.name = OSRGetAttrValue(srs, "VERT_CS", 0);
    char* unit = nullptr;
    axis.metres = OSRGetTargetLinearUnits(srs, "VERT_CS", &unit);
    if (unit != nullptr) axis.unit = unit;
    OGRAxisOrientation to = OAO_Other;
    OSRGetAxis(srs, "VERT_CS", 0, &to);
    axis.down = to == OAO_Down;
    return axis;
}

/// Metres of the unit of scaled numbers, negative where they are depths.
Result<double> unit_metres(GDALDatasetH file, const std::string& label_unit, const DemRequest& r,
                           HeightDeclaration& d) {
    const VerticalAxis axis = vertical_axis(file);
    const double sign = axis.down ? -1 : 1;
    if (r.on != DemRequest::On::plane && !axis.name.empty())
        d.warnings.push_back(fmt::format(
            "its vertical coordinate system is \"{}\"; heights are taken as above the ellipsoid", axis.name));
    if (std::isfinite(r.scale)) return 1;
    const std::string band_unit = GDALGetRasterUnitType(GDALGetRasterBand(file, 1));
    const std::string& unit = band_unit.empty() ? label_unit : band_unit;
    if (unit.empty()) return sign * (axis.metres > 0 ? axis.metres : 1);
    const double metres = metres_of_unit(unit);
    if (metres == 0)
        return Error{
            fmt::format("its heights have the unit \"{}\", which is no length known here, expected \"metre\", "
                        "\"km\", \"ft\" ..., or the key scale with the metres of a number",
                        unit)};
    if (axis.metres > 0 && std::abs(axis.metres / metres - 1) > 1e-9)
        d.warnings.push_back(
            fmt::format("the unit of its band is \"{}\", and that of its vertical axis \"{}\"; the "
                        "band's is used",
                        unit, axis.unit));
    return sign * metres;
}

}  // namespace

double metres_of_unit(std::string name) {
    name = lower(std::move(name));
    std::erase_if(name, [](char c) { return c == ' ' || c == '_' || c == '-' || c == '.'; });
    if (name.size() > 1 && name.ends_with('s')) name.pop_back();
    for (const UnitName& u : kUnitNames)
        if (u.name == name) return u.metres;
    return 0;
}

Result<HeightDeclaration> read_height_declaration(GDALDatasetH file, const DemRequest& r) {
    if (const Status good = check_band(file); !good) return good.error();
    const GDALRasterBandH band = GDALGetRasterBand(file, 1);
    const GDALDataType type = GDALGetRasterDataType(band);
    HeightDeclaration d;
    auto palette = palette_of(band);
    if (!palette) return palette.error();
    d.palette = std::move(*palette);
    std::string label_unit = read_pds3(file, type, d);
    if (label_unit.empty()) label_unit = read_isis(file, type, d);
    read_pds4(file, d);
    if (std::isfinite(r.no_data)) d.no_data.push_back(r.no_data);
    const Result<double> metres = unit_metres(file, label_unit, r, d);
    if (!metres) return metres.error();
    int known = 0;
    d.metres_per_number = std::isfinite(r.scale) ? r.scale : *metres * GDALGetRasterScale(band, &known);
    d.offset_m = std::isfinite(r.offset_m) ? r.offset_m : *metres * GDALGetRasterOffset(band, &known);
    if (CSLConstList others = GDALGetMetadata(file, "SUBDATASETS"); CSLCount(others) > 2)
        d.warnings.push_back(fmt::format("it holds {} images; the first is read", CSLCount(others) / 2));
    return d;
}

}  // namespace narpa
