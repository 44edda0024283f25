#include <fmt/format.h>

#include <array>
#include <cmath>
#include <set>

#include "base/file_bytes.h"
#include "base/text/text_cursor.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

namespace {

/// First words of lines; what follows a backslash at the end of a name is not one.
constexpr std::array<std::string_view, 13> kMtlKeywords{"newmtl", "Ka", "Kd", "Ks",     "Ke",     "Ns",   "Ni",
                                                        "d",      "Tr", "Tf", "map_Kd", "map_Ke", "illum"};

class MtlReader {
public:
    MtlReader(std::string text, const std::string& path, std::map<std::string, MeshMaterial>& materials,
              std::vector<std::string>& warnings)
        : in_(std::move(text), path, kMtlKeywords), path_(path), materials_(materials), warnings_(warnings) {}

    Status read() {
        while (in_.next_line())
            if (!read_line()) return *error_;
        finish();
        warn(transparent_, "transparent (d, Tr), drawn opaque");
        warn(with_options_, "options of maps passed over, all but -clamp and -bm");
        warn_of_unused(unused_maps_, "maps");
        warn_of_unused(unused_, "statements");
        return Ok{};
    }

private:
    void warn(int materials, std::string_view what) {
        if (materials > 0)
            warnings_.push_back(
                fmt::format("{}: {} material{}: {}", path_, materials, materials > 1 ? "s" : "", what));
    }

    void warn_of_unused(const std::set<std::string>& keywords, std::string_view kind) {
        std::string all;
        for (const std::string& keyword : keywords) all += (all.empty() ? "" : ", ") + keyword;
        if (!all.empty()) warnings_.push_back(fmt::format("{}: {} that are not used: {}", path_, kind, all));
    }

    bool fail(std::string_view token, std::string what) {
        error_ = in_.error(token, std::move(what));
        return false;
    }

    bool read_line() {
        const std::string_view keyword = in_.token();
        if (keyword == "newmtl") {
            finish();
            given_ = MtlMaterial{.name = material_name(in_.rest())};
            return true;
        }
        return !given_ || read_statement(keyword, *given_);
    }

    bool read_statement(std::string_view keyword, MtlMaterial& m) {
        if (keyword == "Kd") return read_rgb(m.kd.emplace());
        if (keyword == "Ks") return read_rgb(m.ks);
        if (keyword == "Ke") return read_rgb(m.ke.emplace());
        if (keyword == "Ns") return read_float(m.ns);
        if (keyword == "Ni") return read_float(m.ni.emplace());
        if (keyword == "Pr") return read_float(m.pr.emplace());
        if (keyword == "Pm") return read_float(m.pm.emplace());
        if (keyword == "d") return read_opacity(m.d.emplace());
        if (keyword == "Tr") return read_opacity(m.tr.emplace());
        if (keyword == "illum") return read_illumination(m.illum);
        if (keyword == "map_Kd") return read_map(m.map_kd);
        if (keyword == "map_Ke") return read_map(m.map_ke);
        if (keyword == "norm") return read_map(m.norm);
        if (keyword == "bump" || keyword == "map_bump" || keyword == "map_Bump") return read_map(m.bump);
        if (keyword.starts_with("map_") || keyword == "disp" || keyword == "decal" || keyword == "refl")
            unused_maps_.emplace(keyword);
        else if (!keyword.empty() && keyword != "Ka" && keyword != "Tf" && keyword != "sharpness" &&
                 number_from(in_.token()) != 0.0)
            unused_.emplace(keyword.substr(0, 20));
        return true;
    }

    bool read_illumination(int& illum) {
        float number = 0;
        if (!read_float(number)) return false;
        illum = number >= 0 && number <= 10 ? static_cast<int>(number) : 2;
        return true;
    }

    bool read_float(float& x) { return read_float(x, in_.token()); }
    bool read_float(float& x, std::string_view token) {
        const std::optional<double> number = number_from(token);
        if (!number) return fail(token, fmt::format("\"{}\" is not a number", token));
        x = static_cast<float>(*number);
        return true;
    }

    /// Three numbers, or one for all bands. `spectral` and `xyz` forms are passed over.
    bool read_rgb(Rgb& c) {
        const std::string_view first = in_.token();
        if (first == "spectral" || first == "xyz") {
            warnings_.push_back(
                fmt::format("{}: material \"{}\": {} colour passed over", path_, given_->name, first));
            return true;
        }
        if (!read_float(c.x, first)) return false;
        c.y = c.z = c.x;
        const std::string_view second = in_.token();
        return second.empty() || (read_float(c.y, second) && read_float(c.z));
    }

    bool read_opacity(float& x) {
        std::string_view token = in_.token();
        if (token == "-halo") token = in_.token();
        return read_float(x, token);
    }

    /// `map_Kd [-option arguments]... file name`; the name may hold spaces.
    bool read_map(MeshTexture& map) {
        std::string_view left = in_.rest();
        bool with_others = false;
        while (left.starts_with('-')) {
            const std::string_view option = take_word(left);
            if (option == "-clamp") {
                map.wrap = take_word(left) == "on" ? Texture::Wrap::clamp : Texture::Wrap::repeat;
            } else if (option == "-bm") {
                const std::string_view word = take_word(left);
                const std::optional<double> number = number_from(word);
                if (!number || !std::isfinite(*number))
                    return fail(word, fmt::format("\"{}\" is not a finite number", word));
                given_->bump_multiplier = static_cast<float>(*number);
            } else {
                take_arguments(option, left);
                with_others = true;
            }
        }
        with_options_ += with_others;
        if (!left.empty()) map.file = texture_path(path_, std::string(left));
        return true;
    }

    /// The first word, and `text` without it and the spaces after it.
    static std::string_view take_word(std::string_view& text) {
        const std::string_view word = text.substr(0, text.find_first_of(" \t"));
        text.remove_prefix(word.size());
        text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
        return word;
    }

    static void take_arguments(std::string_view option, std::string_view& text) {
        const bool up_to_three = option == "-o" || option == "-s" || option == "-t";
        const int most = up_to_three ? 3 : option == "-mm" ? 2 : 1;
        for (int i = 0; i < most; ++i) {
            std::string_view after = text;
            const std::string_view word = take_word(after);
            if (up_to_three && i > 0 && !number_from(word)) return;
            text = after;
        }
    }

    /// Stores the finished material.
    void finish() {
        if (!given_) return;
        MeshMaterial m = from_mtl(*given_);
        if (given_->transparent() && m.material.kind != &kinds::dielectric) ++transparent_;
        materials_.insert_or_assign(given_->name, std::move(m));
        given_.reset();
    }

    TextCursor in_;
    const std::string& path_;
    std::map<std::string, MeshMaterial>& materials_;
    std::vector<std::string>& warnings_;
    std::optional<MtlMaterial> given_;
    std::optional<Error> error_;
    int transparent_ = 0, with_options_ = 0;
    std::set<std::string> unused_maps_, unused_;
};

}  // namespace

std::string material_name(std::string_view rest_of_line) {
    while (rest_of_line.ends_with('\\') || rest_of_line.ends_with(' ')) rest_of_line.remove_suffix(1);
    return std::string(rest_of_line);
}

Status read_mtl(const std::string& path, std::map<std::string, MeshMaterial>& materials,
                std::vector<std::string>& warnings) {
    Result<std::string> text = read_file(path);
    if (!text) return text.error();
    return MtlReader(std::move(*text), path, materials, warnings).read();
}

}  // namespace narpa
