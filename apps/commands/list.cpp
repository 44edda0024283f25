// narpa list - the scenarios, scenes and recipes of data sets that come with narpa.
#include <fmt/format.h>

#include "apps/cli.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

Outcome list() {
    nlohmann::json document;
    for (const FileKind kind : {FileKind::scenario, FileKind::scene, FileKind::dataset}) {
        const std::string word = std::string(kFileKindWords[static_cast<std::size_t>(kind)]);
        say(kind == FileKind::scenario ? "scenarios, for `narpa rehearse NAME`:"
            : kind == FileKind::scene  ? "scenes, for `narpa check`, `run`, `render` and `scan`:"
                                       : "recipes of data sets, for `narpa dataset NAME`:");
        nlohmann::json files = nlohmann::json::array();
        for (const ShippedFile& s : shipped_files(kind)) {
            say(fmt::format("  {:<26} {}", s.name, s.about));
            files.push_back({{"name", s.name}, {"file", s.file}, {"about", s.about}});
        }
        document[word + "s"] = files;
    }
    const std::filesystem::path folder = shipped_folder();
    if (folder.empty())
        return Error{"no scenes lie beside the program, expected them in ../scenes or ../share/narpa/scenes"};
    document["folder"] = folder.string();
    say("files: " + folder.string());
    return document;
}

}  // namespace

Command add_list(Parser app) {
    const Parser c =
        app.subcommand("list", "Name the scenarios, scenes and recipes of data sets that come with narpa");
    c.group("Start here");
    return [] { return list(); };
}

}  // namespace narpa::cli
