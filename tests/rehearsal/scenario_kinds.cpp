// The documents name the kinds of faults, gates and orbit models that the tables have, with their texts.
#include <gtest/gtest.h>

#include <map>
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
    std::map<std::string, std::string> documented;  // text by key; each table of keys has its gates last
    for (std::size_t at = 0; (at = document().find("| `[gates]` |", at)) != std::string::npos; ++at) {
        std::istringstream rows(document().substr(at));
        for (std::string row; std::getline(rows, row) && row.starts_with('|');) {
            const std::size_t key = row.find("| `", 2) + 3, value = row.find("` | ", key),
                              text = row.find(" | ", value + 4);
            documented[row.substr(key, value - key)] = row.substr(text + 3, row.size() - text - 5);
        }
    }
    std::map<std::string, std::string> kinds;
    for (const GateKind& kind : Judge::gate_kinds())
        if (!kind.key.empty()) kinds[std::string(kind.key)] = kind.text;
    EXPECT_EQ(kinds, documented);
}

TEST(GateKinds, AreTheKeysOfGates) {
    const TableKeys& gates = *kScenarioFileKeys.find("gates")->value.keys;
    std::set<std::string_view> keys, kinds;
    for (const TableKey* key : gates.all_rows()) keys.insert(key->name);
    for (const GateKind& kind : Judge::gate_kinds())
        if (!kind.key.empty()) kinds.insert(kind.key);
    EXPECT_EQ(keys, kinds);
    for (const LandingLimit& limit : landing_limits())
        EXPECT_TRUE(gates.find("landing")->value.keys->find(limit.key)) << limit.key;
}

}  // namespace
}  // namespace narpa::rehearsal
