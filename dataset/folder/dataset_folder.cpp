#include "dataset/folder/dataset_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <unordered_set>

#include "base/file_bytes.h"
#include "base/write_file.h"

namespace narpa::dataset {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kManifest = "dataset.json";
constexpr std::string_view kTemporary = ".part-";  // a temporary name: .part-HOST-PID-NAME

std::string host_name() {
    std::array<char, 256> name{};
    if (::gethostname(name.data(), name.size() - 1) != 0) return "host";
    std::string host = name.data();
    std::ranges::replace(host, '/', '_');
    return host;
}

std::string manifest_text(const Manifest& m) {
    nlohmann::json outputs = nlohmann::json::array();
    for (std::size_t k = 0; k < kOutputKinds.size(); ++k)
        if (m.outputs[k] && !kOutputKinds[k].name.empty()) outputs.push_back(kOutputKinds[k].name);
    return nlohmann::json{{"format", "narpa dataset 1"},
                          {"images", m.images},
                          {"outputs", outputs},
                          {"recipe", m.recipe},
                          {"scene_fingerprint", m.scene_fingerprint}}
               .dump(1) +
           "\n";
}

/// The image that a file name "000012.png" belongs to.
std::optional<std::uint32_t> image_of(std::string_view name) {
    const std::size_t digits = std::min(name.find('.'), name.size());
    std::uint32_t image = 0;
    const auto [end, error] = std::from_chars(name.data(), name.data() + digits, image);
    if (digits == 0 || error != std::errc{} || end != name.data() + digits) return std::nullopt;
    return image;
}

Status make_folder(const fs::path& folder) {
    std::error_code failed;
    fs::create_directories(folder, failed);
    if (failed) return Error{"cannot be made: " + failed.message(), folder.string(), 0, 0, ErrorKind::missing};
    return Ok{};
}

}  // namespace

Result<Manifest> read_manifest(const std::string& folder) {
    const std::string path = (fs::path(folder) / kManifest).string();
    const auto text = read_file(path);
    if (!text) {
        Error error = text.error();
        error.what += ", expected the folder of a data set: `narpa dataset RECIPE -n N -o DIR` makes one";
        return error;
    }
    const auto document = nlohmann::json::parse(*text, nullptr, false);
    try {
        Manifest m;
        m.images = document.at("images").get<std::uint32_t>();
        m.recipe = document.at("recipe").get<std::string>();
        m.scene_fingerprint = document.at("scene_fingerprint").get<std::string>();
        for (std::size_t k = 0; k < kOutputKinds.size(); ++k) m.outputs[k] = kOutputKinds[k].name.empty();
        for (const auto& name : document.at("outputs")) {
            const auto kind = std::ranges::find(kOutputKinds, name.get<std::string>(), &OutputKind::name);
            if (kind == kOutputKinds.end()) return Error{"has an unknown output, expected those of a recipe", path};
            m.outputs[static_cast<std::size_t>(kind - kOutputKinds.begin())] = true;
        }
        return m;
    } catch (const nlohmann::json::exception& e) {
        return Error{fmt::format("is not the manifest of a data set: {}", e.what()), path};
    }
}

Status open_dataset(const std::string& folder, const Manifest& manifest) {
    for (std::size_t k = 0; k < kOutputKinds.size(); ++k)
        if (manifest.outputs[k])
            if (auto made = make_folder(fs::path(folder) / kOutputKinds[k].folder); !made) return made;
    const std::string path = (fs::path(folder) / kManifest).string();
    std::error_code unknown;
    if (fs::exists(path, unknown)) {
        const auto there = read_manifest(folder);
        if (!there) return there.error();
        if (there->recipe != manifest.recipe)
            return Error{"is of another recipe, expected the same one or another folder", path};
        if (there->scene_fingerprint != manifest.scene_fingerprint)
            return Error{"is of another version of the scene's files, expected the same or another folder", path};
        if (there->images > manifest.images)
            return Error{fmt::format("is of {} images, expected -n {} or more", there->images, there->images),
                         path};
        if (there->images == manifest.images) return Ok{};
    }
    return write_whole_text(path, manifest_text(manifest));
}

Result<Plan> plan_shard(const std::string& folder, const Shard& shard) {
    const auto manifest = read_manifest(folder);
    if (!manifest) return manifest.error();
    Plan plan;
    std::vector<std::uint8_t> files(manifest->images, 0);
    std::uint8_t wanted = 0;
    for (std::size_t k = 0; k < kOutputKinds.size(); ++k) {
        if (!manifest->outputs[k]) continue;
        ++wanted;
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator(fs::path(folder) / kOutputKinds[k].folder, gone)) {
            const std::string name = entry.path().filename().string();
            const auto image = image_of(name);
            if (image && *image < files.size() && name.ends_with(kOutputKinds[k].extension)) ++files[*image];
        }
    }
    for (std::uint32_t image = 0; image < manifest->images; ++image) {
        if (!shard.has(image)) continue;
        ++plan.images;
        if (files[image] < wanted) plan.missing.push_back(image);
    }
    return plan;
}

std::string image_file(std::size_t output, std::uint32_t image) {
    return fmt::format("{}/{:06d}{}", kOutputKinds[output].folder, image, kOutputKinds[output].extension);
}

Status write_whole(const std::string& path, const std::function<Status(const std::string&)>& write) {
    static const std::string kOwner = fmt::format("{}{}-{}-", kTemporary, host_name(), ::getpid());
    const fs::path whole(path), part = whole.parent_path() / (kOwner + whole.filename().string());
    std::error_code failed;
    if (auto written = write(part.string()); !written) {
        fs::remove(part, failed);
        return written;
    }
    fs::rename(part, whole, failed);
    if (failed) return Error{"cannot be written: " + failed.message(), path, 0, 0, ErrorKind::failed};
    return Ok{};
}

Status write_whole_text(const std::string& path, const std::string& text) {
    return write_whole(path, [&](const std::string& part) { return write_file(part, text); });
}

void remove_leftovers(const std::string& folder, const Shard& shard) {
    for (const OutputKind& kind : kOutputKinds) {
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator(fs::path(folder) / kind.folder, gone)) {
            const std::string name = entry.path().filename().string();
            if (!name.starts_with(kTemporary)) continue;
            const auto image = image_of(std::string_view(name).substr(name.rfind('-') + 1));
            std::error_code failed;
            if (image && shard.has(*image)) fs::remove(entry.path(), failed);
        }
    }
}

}  // namespace narpa::dataset
