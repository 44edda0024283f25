/// renderer/keys/toml_file.h - TOML files, which may hold only their differences from another.
#pragma once

#include <map>
#include <memory>
#include <set>
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
    /// Parses a file and, where its table `head` has a key `based_on`, the file that this names: keys that the
    /// first file leaves out are taken from there, table by table; arrays (of tables, too) as a whole. Values keep
    /// their places. Errors: files that cannot be read or parsed or nest too deep, a chain of more than eight
    /// files, a `based_on` outside of `head`.
    static Result<TomlFile> read(const std::string& path, const std::string& head);

    /// `name` as in "unknown key "x" in NAME". The file outlives the reader.
    [[nodiscard]] TableReader root(std::string name, Problems& problems, const TableKeys* keys = nullptr) const {
        return TableReader(*table_, std::move(name), problems, keys);
    }
    /// What the files say together, as one file without `based_on`.
    [[nodiscard]] std::string text() const;
    /// The same for each table and array of tables at the top, by its name.
    [[nodiscard]] std::map<std::string, std::string> tables() const;
    /// The files that hold the values.
    [[nodiscard]] std::set<std::string> files() const;
    /// Every text among the values.
    [[nodiscard]] std::vector<std::string> texts() const;

private:
    explicit TomlFile(std::shared_ptr<const toml::table> table) : table_(std::move(table)) {}

    std::shared_ptr<const toml::table> table_;
};

}  // namespace narpa
