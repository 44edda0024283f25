// The documents name the kinds of faults, gates and orbit models that the tables have, with their texts.
#include <gtest/gtest.h>

#include <set>
#include <sstream>

#include "rehearsal/judge/judge.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"

namespace narpa::rehearsal {
namespace {

const std::string& document() {
    static const std::string text = test::read_text(test::source_path("docs/rehearsal.md"));
    return text;
}

TEST(FaultKinds, AreThoseOfTheDocument) {
    std::size_t rows = 0;
    for (std::size_t at = 0; (at = document().find("`kind = \"", at)) != std::string::npos; ++at) ++rows;
    EXPECT_EQ(rows, fault_kinds().size());
    for (const FaultKind& kind : fault_kinds()) {
        const std::string name(kind.name),
            row = "| `kind = \"" + name + "\"` | | " + std::string(kind.text) + " |\n";
        EXPECT_NE(document().find(row), std::string::npos) << row;
        EXPECT_EQ(fault_kind(name), &kind);
    }
    EXPECT_EQ(fault_kind("thruster_of"), nullptr);
}

TEST(OrbitModels, AreThoseOfTheDocument) {
    for (const OrbitModel& model : orbit_models()) {
        EXPECT_NE(document().find("\"" + std::string(model.name) + "\""), std::string::npos) << model.name;
        EXPECT_EQ(orbit_model(model.name), &model);
    }
}

TEST(GateKinds, AreThoseOfTheDocument) {
    std::set<std::string> keys, documented;
    for (const GateKind& kind : Judge::gate_kinds()) {
        if (kind.key.empty()) continue;
        keys.emplace(kind.key);
        const std::size_t at =
            document().find("| `" + std::string(kind.key) + "` | ", document().find("| `[gates]` |"));
        ASSERT_NE(at, std::string::npos) << kind.key;
        const std::string row = document().substr(at, document().find('\n', at) - at);
        EXPECT_TRUE(row.ends_with("| " + std::string(kind.text) + " |")) << row;
    }
    // Each table of keys has its gates last.
    for (std::size_t at = 0; (at = document().find("| `[gates]` |", at)) != std::string::npos; ++at) {
        std::istringstream rows(document().substr(at));
        for (std::string row; std::getline(rows, row) && row.starts_with('|');) {
            const std::size_t begin = row.find("| `", 2) + 3;
            documented.insert(row.substr(begin, row.find('`', begin) - begin));
        }
    }
    EXPECT_EQ(keys, documented);
}

}  // namespace
}  // namespace narpa::rehearsal
