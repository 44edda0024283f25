/// renderer/mesh_reader/gltf_file.h - a glTF 2.0 document (Khronos, glTF 2.0 specification, 2021) and its
/// accessors. Functions throw std::runtime_error, which names the object of the file that is at fault.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace narpa {

[[noreturn]] inline void gltf_fail(const std::string& what) {
    throw std::runtime_error(what);
}

/// A member of a JSON object; null if it is absent.
[[nodiscard]] const nlohmann::json* member(const nlohmann::json& object, const char* name);
/// A number of a JSON object. Throws if it is there and no number.
[[nodiscard]] double number_or(const nlohmann::json& object, const char* name, double otherwise);
/// A whole number of a JSON object that is not negative.
[[nodiscard]] std::size_t count_or(const nlohmann::json& object, const char* name, std::size_t otherwise);
/// A text of a JSON object.
[[nodiscard]] std::string text_or(const nlohmann::json& object, const char* name, const char* otherwise);
/// An index of a JSON object; -1 if it is absent.
[[nodiscard]] std::int64_t index_or_none(const nlohmann::json& object, const char* name);
/// An extension of a JSON object; null if it is absent.
[[nodiscard]] const nlohmann::json* extension_of_object(const nlohmann::json& object, const char* name);
/// Fills `out` from the array `name`, if there is one.
void numbers_into(const nlohmann::json& object, const char* name, std::span<double> out);

/// Values of an accessor, converted to floating point: normalised integers as fractions of their largest value.
struct GltfValues {
    std::size_t components = 1;
    std::vector<double> values{};
    bool is_float = false, is_normalised = false;

    [[nodiscard]] std::size_t size() const { return values.size() / components; }
    [[nodiscard]] const double* operator[](std::size_t i) const { return &values[i * components]; }
};

/// Numbers of an element of an accessor of this type.
[[nodiscard]] std::size_t gltf_components(std::string_view type);

class GltfFile {
public:
    /// A .gltf or .glb file; other files that it names are read when they are needed.
    explicit GltfFile(std::string path);

    [[nodiscard]] const nlohmann::json& root() const { return root_; }
    [[nodiscard]] const std::string& path() const { return path_; }
    /// Whether the version is 1: a different format.
    [[nodiscard]] bool is_version_1() const;
    /// Refuses extensions that the file requires and that are not read, and warns about those that are ignored.
    void check_extensions();

    /// An element of one of the document's arrays, such as "meshes".
    [[nodiscard]] const nlohmann::json& item(const char* array, std::int64_t index) const;
    /// Throws where there is no such element.
    void check_item(const char* array, std::int64_t index) const { static_cast<void>(item(array, index)); }
    /// `type` is "SCALAR", "VEC3" ...; `also`, if not empty, is another type that is accepted.
    [[nodiscard]] GltfValues accessor(std::int64_t index, std::string_view type, std::string_view also = {});
    /// The bytes of a buffer view.
    [[nodiscard]] std::string_view view(std::int64_t index);
    /// The bytes of a URI with data inside; false if it names a file.
    static bool data_of_uri(const std::string& uri, std::string& bytes);
    /// The path of a file that a URI names.
    [[nodiscard]] std::string path_of_uri(const std::string& uri) const;

    /// Once a file, however many objects it applies to.
    void warn(std::string_view what);
    std::vector<std::string> warnings{};

private:
    void read_binary(std::string bytes);
    [[nodiscard]] const std::string& buffer(std::int64_t index);
    void decode(const nlohmann::json& from, std::int64_t component_type, bool is_normalised, std::size_t count,
                std::size_t components, const char* view_key, std::vector<double>& out);
    void apply_sparse(const nlohmann::json& sparse, std::int64_t component_type, GltfValues& out);

    std::string path_;
    nlohmann::json root_;
    std::string binary_chunk_;
    std::map<std::int64_t, std::string> buffers_;
};

}  // namespace narpa
