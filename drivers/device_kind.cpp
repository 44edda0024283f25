#include "drivers/device_kind.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

namespace narpa {

bool DeviceKind::named_by(const std::string& text) const {
    return prefix.empty() ? names(text) : text.starts_with(prefix);
}

bool DeviceKind::shown_by(const std::string& text) const {
    return named_by(text) && (evident == nullptr || evident(text));
}

std::string DeviceKind::place_of(const std::string& text) const {
    namespace fs = std::filesystem;
    std::error_code unknown;
    if (destination == Destination::port) return text.substr(0, text.find(','));
    if (destination == Destination::device || destination == Destination::new_file)
        return fs::weakly_canonical(fs::absolute(text, unknown), unknown);
    return {};
}

std::string list_of(const std::vector<std::string_view>& words) {
    std::string text;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (i > 0) text += i + 1 < words.size() ? ", " : words.size() > 2 ? ", or " : " or ";
        text += words[i];
    }
    return text;
}

Status check_writable(const std::string& file) {
    namespace fs = std::filesystem;
    std::error_code unknown;
    fs::path at = fs::absolute(file, unknown);
    while (!fs::exists(at, unknown) && at.has_relative_path()) at = at.parent_path();
    const bool in_a_file = at != fs::absolute(file, unknown) && !fs::is_directory(at, unknown);
    if (!in_a_file && ::access(at.c_str(), W_OK) == 0) return Ok{};
    return Error{"cannot write " + at.string() + ": " + std::strerror(in_a_file ? ENOTDIR : errno), file, 0, 0,
                 ErrorKind::missing};
}

}  // namespace narpa
