#include <fmt/format.h>

#include "renderer/scene/file_bytes.h"
#include "renderer/scene/obj_file.h"
#include "renderer/scene/text_cursor.h"

namespace narpa {

namespace {

class MtlReader {
public:
    MtlReader(std::string text, const std::string& path, std::map<std::string, MeshMaterial>& materials,
              std::vector<std::string>& warnings)
        : in_(std::move(text), path), path_(path), materials_(materials), warnings_(warnings) {}

    Status read() {
        while (in_.next_line())
            if (!read_line()) return *error_;
        finish();
        tell(transparent_, "transparent (d, Tr), drawn opaque");
        tell(with_options_, "options of map_Kd passed over");
        tell(spectral_, "spectral or xyz colours passed over");
        return Ok{};
    }

private:
    /// The material that is being read; what the file leaves out is absent.
    struct Given {
        std::string name{}, map_kd{};
        std::optional<Rgb> kd{};
        Rgb ks{}, ke{};
        float ns = 0;
        bool transparent = false;
    };

    void tell(int materials, std::string_view what) {
        if (materials > 0)
            warnings_.push_back(
                fmt::format("{}: {} material{}: {}", path_, materials, materials > 1 ? "s" : "", what));
    }

    bool fail(std::string_view token, std::string what) {
        error_ = in_.error(token, std::move(what));
        return false;
    }

    bool read_line() {
        const std::string_view keyword = in_.token();
        if (keyword == "newmtl") {
            finish();
            given_ = Given{.name = std::string(in_.rest())};
            return true;
        }
        if (!given_) return true;
        if (keyword == "Kd") return read_rgb(given_->kd.emplace());
        if (keyword == "Ks") return read_rgb(given_->ks);
        if (keyword == "Ke") return read_rgb(given_->ke);
        if (keyword == "Ns") return read_float(given_->ns);
        if (keyword == "map_Kd") return read_map();
        if (keyword == "d" || keyword == "Tr") return read_opacity(keyword == "Tr");
        return true;
    }

    bool read_float(float& x) {
        const std::string_view token = in_.token();
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
        const std::optional<double> x = number_from(first);
        if (!x) return fail(first, fmt::format("\"{}\" is not a number", first));
        c.x = c.y = c.z = static_cast<float>(*x);
        const std::string_view second = in_.token();
        if (second.empty()) return true;
        const std::optional<double> y = number_from(second);
        if (!y) return fail(second, fmt::format("\"{}\" is not a number", second));
        c.y = static_cast<float>(*y);
        return read_float(c.z);
    }

    bool read_opacity(bool is_transparency) {
        std::string_view token = in_.token();
        if (token == "-halo") token = in_.token();
        const std::optional<double> x = number_from(token);
        if (!x) return fail(token, fmt::format("\"{}\" is not a number", token));
        given_->transparent = is_transparency ? *x > 0 : *x < 1;
        return true;
    }

    /// `map_Kd [-option arguments]... file name`; the name may hold spaces.
    bool read_map() {
        std::string_view name = in_.rest();
        if (name.starts_with('-')) ++with_options_;
        while (name.starts_with('-')) name.remove_prefix(option_length(name));
        given_->map_kd = name;
        return true;
    }

    /// Characters of one option, its arguments and the spaces after them.
    static std::size_t option_length(std::string_view text) {
        const auto word_end = [text](std::size_t from) {
            const std::size_t end = std::min(text.find_first_of(" \t", from), text.size());
            return std::min(text.find_first_not_of(" \t", end), text.size());
        };
        const auto word = [text](std::size_t from) {
            return text.substr(from, std::min(text.find_first_of(" \t", from), text.size()) - from);
        };
        std::size_t at = word_end(0);
        const std::string_view option = word(0);
        const bool up_to_three = option == "-o" || option == "-s" || option == "-t";
        const int most = up_to_three ? 3 : option == "-mm" ? 2 : 1;
        for (int i = 0; i < most && at < text.size(); ++i) {
            if (up_to_three && i > 0 && !number_from(word(at))) break;
            at = word_end(at);
        }
        return at;
    }

    /// Hands on the material that ends here. Without a Kd: 1 under a map, else grey 0.5.
    void finish() {
        if (!given_) return;
        const float otherwise = given_->map_kd.empty() ? 0.5f : 1.0f;
        MeshMaterial m;
        m.material = make_material(given_->name, given_->kd.value_or(Rgb{otherwise, otherwise, otherwise}),
                                   given_->ks, given_->ns, given_->ke);
        if (!given_->map_kd.empty()) m.texture_file = texture_path(path_, given_->map_kd);
        if (given_->transparent) ++transparent_;
        materials_.insert_or_assign(given_->name, std::move(m));
        given_.reset();
    }

    TextCursor in_;
    const std::string& path_;
    std::map<std::string, MeshMaterial>& materials_;
    std::vector<std::string>& warnings_;
    std::optional<Given> given_;
    std::optional<Error> error_;
    int transparent_ = 0, with_options_ = 0, spectral_ = 0;
};

}  // namespace

Status read_mtl(const std::string& path, std::map<std::string, MeshMaterial>& materials,
                std::vector<std::string>& warnings) {
    Result<std::string> text = read_file(path);
    if (!text) return text.error();
    return MtlReader(std::move(*text), path, materials, warnings).read();
}

}  // namespace narpa
