#include "renderer/mesh_reader/gltf_material.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace narpa {

namespace {

using nlohmann::json;

Rgb colour_or(const json& object, const char* name, const Rgb& otherwise) {
    std::array<double, 3> c{otherwise.x, otherwise.y, otherwise.z};
    const json* value = member(object, name);
    if (value != nullptr && value->is_array() && value->size() == 4) {
        std::array<double, 4> with_alpha{};
        numbers_into(object, name, with_alpha);
        std::copy_n(with_alpha.begin(), 3, c.begin());
    } else {
        numbers_into(object, name, c);
    }
    return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
}

float float_or(const json& object, const char* name, double otherwise) {
    return static_cast<float>(number_or(object, name, otherwise));
}

/// KHR_materials_pbrSpecularGlossiness as metallic-roughness: the metallic part m and the base colour b that have
/// the given diffuse albedo d = b (1 - m) 0.96 and reflectance at normal incidence s = 0.04 (1 - m) + b m, in the
/// mean of the bands. Below 0.04, where no m has it, the refractive index does.
void set_specular_glossiness(const json& given, PlainMaterial::Numbers& out) {
    constexpr double f = 0.04;
    const Rgb diffuse = colour_or(given, "diffuseFactor", {1, 1, 1}),
              specular = colour_or(given, "specularFactor", {1, 1, 1});
    const double left = 1 - std::clamp<double>(std::max({specular.x, specular.y, specular.z}), 0, 1);
    const double s = std::clamp<double>(mean_band(specular), 0, 1), d = mean_band(diffuse) * left / (1 - f);
    out.roughness = 1 - float_or(given, "glossinessFactor", 1);
    out.metallic = 0;
    out.diffuse = diffuse * static_cast<float>(left / (1 - f));
    if (s <= f) {
        out.ior = static_cast<float>((1 + std::sqrt(s)) / (1 - std::sqrt(s)));
        return;
    }
    const double b = d + s - 2 * f, m = std::clamp((-b + std::sqrt(b * b + 4 * f * (s - f))) / (2 * f), 0.0, 1.0);
    out.metallic = static_cast<float>(m);
    const float insulator = static_cast<float>(f * (1 - m)), part = static_cast<float>(m * m);
    const Rgb from_diffuse = out.diffuse / static_cast<float>(std::max(1 - m, 1e-6)),
              from_specular =
                  (specular - Rgb{insulator, insulator, insulator}) / static_cast<float>(std::max(m, 1e-6));
    out.diffuse = (1 - part) * from_diffuse + part * from_specular;
}

class MaterialReader {
public:
    MaterialReader(GltfFile& file, const json& m) : file_(file), m_(m) {}

    GltfMaterial read() {
        PlainMaterial::Numbers& n = out_.plain.numbers;
        n.kind = PlainMaterial::Kind::metallic_roughness;
        if (const json* name = member(m_, "name"); name != nullptr && name->is_string()) out_.plain.name = *name;
        n.emission = colour_or(m_, "emissiveFactor", {});
        if (const json* strong = extension_of_object(m_, "KHR_materials_emissive_strength"))
            n.emission *= float_or(*strong, "emissiveStrength", 1);
        if (const json* ior = extension_of_object(m_, "KHR_materials_ior")) n.ior = float_or(*ior, "ior", 1.5);
        static const json kNone = json::object();
        const json* pbr = member(m_, "pbrMetallicRoughness");
        read_colours(pbr != nullptr ? *pbr : kNone);
        if (lost_image_) n.diffuse *= 0.5f;
        read_transparency();
        out_.plain.emission = texture(m_, "emissiveTexture");
        if (lost_image_) n.emission = {};
        out_.plain.normal = texture(m_, "normalTexture");
        if (const json* normal = member(m_, "normalTexture")) n.normal_scale = float_or(*normal, "scale", 1);
        if (member(m_, "occlusionTexture") != nullptr) file_.warn("occlusion textures are not used");
        return std::move(out_);
    }

private:
    void read_colours(const json& pbr) {
        PlainMaterial::Numbers& n = out_.plain.numbers;
        if (const json* glossy = extension_of_object(m_, "KHR_materials_pbrSpecularGlossiness")) {
            set_specular_glossiness(*glossy, n);
            out_.plain.colour = texture(*glossy, "diffuseTexture");
            if (member(*glossy, "specularGlossinessTexture") != nullptr)
                file_.warn("specular-glossiness textures are not used, their factors are");
            return;
        }
        n.diffuse = colour_or(pbr, "baseColorFactor", {1, 1, 1});
        n.metallic = float_or(pbr, "metallicFactor", 1);
        n.roughness = float_or(pbr, "roughnessFactor", 1);
        out_.plain.colour = texture(pbr, "baseColorTexture");
        if (member(pbr, "metallicRoughnessTexture") != nullptr)
            file_.warn("metallic-roughness textures are not used, their factors are");
    }

    void read_transparency() {
        constexpr double kGlass = 0.5;  // of the light that goes through
        const json* transmission = extension_of_object(m_, "KHR_materials_transmission");
        const double factor = transmission != nullptr ? number_or(*transmission, "transmissionFactor", 0) : 0;
        if (transmission != nullptr && member(*transmission, "transmissionTexture") != nullptr)
            file_.warn("transmission textures are not used, their factors are");
        const json* mode = member(m_, "alphaMode");
        const bool is_blended = mode != nullptr && *mode != "OPAQUE";
        if (factor >= kGlass)
            out_.plain.numbers.kind = PlainMaterial::Kind::glass;
        else if (factor > 0 || is_blended)
            file_.warn("transparent materials are drawn opaque");
    }

    static GltfUvUse uv_use_of(const json& info) {
        GltfUvUse use{.set = std::max<std::int64_t>(0, index_or_none(info, "texCoord"))};
        if (const json* transform = extension_of_object(info, "KHR_texture_transform")) {
            numbers_into(*transform, "offset", use.offset);
            numbers_into(*transform, "scale", use.scale);
            use.rotation_rad = number_or(*transform, "rotation", 0);
            if (const std::int64_t set = index_or_none(*transform, "texCoord"); set >= 0) use.set = set;
        }
        return use;
    }

    /// The image that `info` names; empty where there is none that can be used.
    MeshTexture texture(const json& owner, const char* name) {
        lost_image_ = false;
        const json* info = member(owner, name);
        if (info == nullptr) return {};
        const GltfUvUse use = uv_use_of(*info);
        if (uv_use_ && !(*uv_use_ == use)) {
            file_.warn(use.set != uv_use_->set
                           ? "a texture that lies by second texture coordinates is not used"
                           : "textures with another KHR_texture_transform than the material's colour are not used");
            return {};
        }
        const json& texture = file_.item("textures", index_or_none(*info, "index"));
        const std::int64_t image = image_of(texture);
        if (image < 0) return lost_image_ = true, MeshTexture{};
        uv_use_ = out_.uv_use = use;
        return with_wrap(image_file(image), texture);
    }

    std::int64_t image_of(const json& texture) {
        const json* webp = extension_of_object(texture, "EXT_texture_webp");
        if (webp != nullptr) return index_or_none(*webp, "source");
        if (const std::int64_t source = index_or_none(texture, "source"); source >= 0) return source;
        std::string names;
        if (const json* extensions = member(texture, "extensions"))
            for (const auto& extension : extensions->items())
                names += (names.empty() ? " (" : ", ") + extension.key();
        file_.warn(
            fmt::format("its textures{}{} cannot be read and are not used", names, names.empty() ? "" : ")"));
        return -1;
    }

    MeshTexture image_file(std::int64_t index) {
        const json& image = file_.item("images", index);
        const json* uri = member(image, "uri");
        MeshTexture out;
        std::string bytes;
        if (uri == nullptr) {
            const std::string_view view = file_.view(index_or_none(image, "bufferView"));
            bytes.assign(view);
        } else if (const auto text = uri->get<std::string>(); !GltfFile::data_of_uri(text, bytes)) {
            out.file = file_.path_of_uri(text);
            return out;
        }
        out.file = fmt::format("{}*{}", file_.path(), index);
        out.bytes.assign(bytes.begin(), bytes.end());
        return out;
    }

    MeshTexture with_wrap(MeshTexture image, const json& texture) {
        constexpr double kClamp = 33071, kRepeat = 10497;
        const std::int64_t index = index_or_none(texture, "sampler");
        if (index < 0) return image;
        const json& sampler = file_.item("samplers", index);
        const double u = number_or(sampler, "wrapS", kRepeat), v = number_or(sampler, "wrapT", kRepeat);
        if (u == kClamp && v == kClamp)
            image.wrap = Texture::Wrap::clamp;
        else if (u != kRepeat || v != kRepeat)
            file_.warn("textures that are mirrored, or clamped along one axis only, repeat");
        return image;
    }

    GltfFile& file_;
    const json& m_;
    GltfMaterial out_;
    std::optional<GltfUvUse> uv_use_;
    bool lost_image_ = false;  ///< of the newest texture
};

}  // namespace

std::array<float, 2> GltfUvUse::apply(double u, double v) const {
    const double c = std::cos(rotation_rad), s = std::sin(rotation_rad), x = scale[0] * u, y = scale[1] * v;
    return {static_cast<float>(offset[0] + c * x + s * y), static_cast<float>(1 - (offset[1] - s * x + c * y))};
}

GltfMaterial gltf_material(GltfFile& file, std::int64_t index) {
    static const json kDefault = json::object();
    return MaterialReader(file, index < 0 ? kDefault : file.item("materials", index)).read();
}

}  // namespace narpa
