#include "protocols/video/gige_description.h"

#include <array>
#include <charconv>

namespace narpa {
namespace {

struct GigeFormatRow {
    std::string_view ours;
    GigePixelFormat theirs;
};
constexpr auto kGigeFormats = std::to_array<GigeFormatRow>({
    {"GREY", {"Mono8", 0x01080001}},
    {"Y10", {"Mono10", 0x01100003}},
    {"Y12", {"Mono12", 0x01100005}},
    {"Y14", {"Mono14", 0x01100025}},
    {"Y16", {"Mono16", 0x01100007}},
    {"RGB24", {"RGB8", 0x02180014}},
    {"YUYV", {"YUV422_8", 0x02100032}},
    {"GRBG8", {"BayerGR8", 0x01080008}},
    {"RGGB8", {"BayerRG8", 0x01080009}},
    {"GBRG8", {"BayerGB8", 0x0108000A}},
    {"BGGR8", {"BayerBG8", 0x0108000B}},
    {"GRBG10", {"BayerGR10", 0x0110000C}},
    {"RGGB10", {"BayerRG10", 0x0110000D}},
    {"GBRG10", {"BayerGB10", 0x0110000E}},
    {"BGGR10", {"BayerBG10", 0x0110000F}},
    {"GRBG12", {"BayerGR12", 0x01100010}},
    {"RGGB12", {"BayerRG12", 0x01100011}},
    {"GBRG12", {"BayerGB12", 0x01100012}},
    {"BGGR12", {"BayerBG12", 0x01100013}},
    {"GRBG16", {"BayerGR16", 0x0110002E}},
    {"RGGB16", {"BayerRG16", 0x0110002F}},
    {"GBRG16", {"BayerGB16", 0x01100030}},
    {"BGGR16", {"BayerBG16", 0x01100031}},
    {"Mono10p", {"Mono10p", 0x010A0046}},
    {"Mono12p", {"Mono12p", 0x010C0047}},
    {"BayerBG10p", {"BayerBG10p", 0x010A0052}},
    {"BayerBG12p", {"BayerBG12p", 0x010C0053}},
    {"BayerGB10p", {"BayerGB10p", 0x010A0054}},
    {"BayerGB12p", {"BayerGB12p", 0x010C0055}},
    {"BayerGR10p", {"BayerGR10p", 0x010A0056}},
    {"BayerGR12p", {"BayerGR12p", 0x010C0057}},
    {"BayerRG10p", {"BayerRG10p", 0x010A0058}},
    {"BayerRG12p", {"BayerRG12p", 0x010C0059}},
});

std::string element(std::string_view name, const std::string& content) {
    return "<" + std::string(name) + ">" + content + "</" + std::string(name) + ">";
}
std::string node(std::string_view kind, std::string_view name, const std::string& content) {
    return "<" + std::string(kind) + " Name=\"" + std::string(name) + "\" NameSpace=\"Standard\">" + content +
           "</" + std::string(kind) + ">\n";
}
std::string category(std::string_view name, std::initializer_list<std::string_view> features) {
    std::string content;
    for (const std::string_view feature : features) content += element("pFeature", std::string(feature));
    return node("Category", name, content);
}
std::string at_address(std::uint32_t address, int bytes, std::string_view access) {
    return element("Address", std::to_string(address)) + element("Length", std::to_string(bytes)) +
           element("AccessMode", std::string(access)) + element("pPort", "Device");
}
std::string integer(std::string_view name, std::uint32_t address, std::string_view access) {
    return node("IntReg", name,
                at_address(address, 4, access) + element("Sign", "Unsigned") + element("Endianess", "BigEndian"));
}
std::string text(std::string_view name, std::uint32_t address, int bytes) {
    return node("StringReg", name, at_address(address, bytes, "RO"));
}
std::string constant(std::string_view name, std::int64_t value) {
    return node("Integer", name, element("Value", std::to_string(value)));
}
std::string enumeration(std::string_view name, std::string_view entry, std::uint32_t value,
                        const std::string& content) {
    return node("Enumeration", name, node("EnumEntry", entry, element("Value", std::to_string(value))) + content);
}

}  // namespace

Result<GigePixelFormat> gige_pixel_format(const VideoFormat& format) {
    const std::string name = link_text(format.pixel, format.link);
    for (const GigeFormatRow& row : kGigeFormats)
        if (row.ours == name) return row.theirs;
    std::string carried;
    for (const GigeFormatRow& row : kGigeFormats)
        if (!row.theirs.name.starts_with("Bayer")) carried.append(carried.empty() ? "" : ", ").append(row.ours);
    return Error{"GigE Vision has no pixel format " + name + "; it carries " + carried +
                 ", and mosaics of 8, 10, 12 and 16 bits, packed as BayerRG10p or not"};
}

std::string gige_description(const VideoFormat& format, const GigePixelFormat& pixels, const GigeRegisters& at) {
    std::array<char, 32> rate{};
    const auto [end, _] =
        std::to_chars(rate.data(), rate.data() + rate.size(), 1e9 / static_cast<double>(format.period_ns));
    // GigE Vision's own registers: maker, model, version, serial number.
    constexpr std::uint32_t kMaker = 0x48, kModel = 0x68, kDeviceVersion = 0x88, kSerial = 0xD8;
    return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
           "<RegisterDescription ModelName=\"camera\" VendorName=\"narpa\" StandardNameSpace=\"GEV\" "
           "SchemaMajorVersion=\"1\" SchemaMinorVersion=\"0\" SchemaSubMinorVersion=\"1\" MajorVersion=\"1\" "
           "MinorVersion=\"0\" SubMinorVersion=\"0\" ProductGuid=\"0\" VersionGuid=\"0\" "
           "xmlns=\"http://www.genicam.org/GenApi/Version_1_0\">\n" +
           category("Root",
                    {"DeviceControl", "ImageFormatControl", "AcquisitionControl", "TransportLayerControl"}) +
           category("DeviceControl", {"DeviceVendorName", "DeviceModelName", "DeviceVersion", "DeviceID"}) +
           text("DeviceVendorName", kMaker, 32) + text("DeviceModelName", kModel, 32) +
           text("DeviceVersion", kDeviceVersion, 32) + text("DeviceID", kSerial, 16) +
           category("ImageFormatControl",
                    {"SensorWidth", "SensorHeight", "OffsetX", "OffsetY", "Width", "Height", "PixelFormat"}) +
           integer("SensorWidth", at.sensor_width, "RO") + integer("SensorHeight", at.sensor_height, "RO") +
           constant("OffsetX", 0) + constant("OffsetY", 0) + integer("Width", at.width, "RO") +
           integer("Height", at.height, "RO") +
           enumeration("PixelFormat", pixels.name, pixels.code, element("pValue", "PixelFormatRegister")) +
           integer("PixelFormatRegister", at.pixel_format, "RO") +
           category("AcquisitionControl",
                    {"AcquisitionMode", "AcquisitionStart", "AcquisitionStop", "AcquisitionFrameRate"}) +
           enumeration("AcquisitionMode", "Continuous", 1, element("Value", "1")) +
           node("Command", "AcquisitionStart",
                element("pValue", "AcquisitionRegister") + element("CommandValue", "1")) +
           node("Command", "AcquisitionStop",
                element("pValue", "AcquisitionRegister") + element("CommandValue", "0")) +
           integer("AcquisitionRegister", at.acquisition, "RW") +
           node("Float", "AcquisitionFrameRate",
                element("Value", std::string(rate.data(), end)) + element("Unit", "Hz")) +
           category("TransportLayerControl", {"PayloadSize", "TLParamsLocked"}) +
           constant("PayloadSize", static_cast<std::int64_t>(link_bytes(format))) +
           node("Integer", "TLParamsLocked", element("Value", "0") + element("Min", "0") + element("Max", "1")) +
           node("Port", "Device", "") + "</RegisterDescription>\n";
}

}  // namespace narpa
