/// renderer/keys/toml_file.h - TOML files, which may hold only their differences from another.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {

/// The path of a file that `file` names relative to its own folder.
[[nodiscard]] std::string beside(const std::string& file, const std::string& named);

/// A parsed file, with those that it is based on.
class TomlFile {
public:
    /// Parses a file and, where its table `head` has a key `based_on`, the file that this names, or the shipped one
    /// of this name: keys that the first file leaves out are taken from there, table by table. Lists of tables with
    /// names are merged by name, in the order of the file below, new ones last, unless `replaces` in `head` names
    /// the list; other arrays, and the legs of a scenario, are taken as a whole. Names of files in it stay relative
    /// to its own folder. Then `overrides` (toml_override.h) are applied. Values keep their places. Errors: files
    /// that cannot be read or parsed or nest too deep, a chain of more than eight files, a `based_on` or `replaces`
    /// outside of `head`. `keys`: of the file.
    static Result<TomlFile> read(const std::string& path, const std::string& head, const TableKeys& keys,
                                 std::span<const std::string> overrides = {});
    /// The same of a file's text. `path`: the file's name for errors; names of files in the text are relative to
    /// its folder.
    static Result<TomlFile> parse(const std::string& text, const std::string& path, const std::string& head,
                                  const TableKeys& keys, std::span<const std::string> overrides = {});

    /// `name` as in "unknown key "x" in NAME". The file outlives the reader.
    [[nodiscard]] TableReader root(std::string name, Problems& problems, const TableKeys* keys = nullptr) const {
        return TableReader(*table_, std::move(name), problems, keys);
    }
    /// What the files say together, as one file without `based_on`.
    [[nodiscard]] std::string text() const;
    /// The same for each table and array of tables at the top, by its name.
    [[nodiscard]] std::map<std::string, std::string> tables() const;
    /// The files that hold the values; not the options that do.
    [[nodiscard]] std::set<std::string> files() const;
    /// Every text among the values.
    [[nodiscard]] std::vector<std::string> texts() const;

private:
    static Result<TomlFile> parse(const Result<std::string>& text, const std::string& path, const std::string& head,
                                  const TableKeys& keys, std::span<const std::string> overrides);
    explicit TomlFile(std::shared_ptr<const toml::table> table) : table_(std::move(table)) {}

    std::shared_ptr<const toml::table> table_;
};

}  // namespace narpa
