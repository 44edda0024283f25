// The documents name the kinds of faults and orbit models that the tables have, with their texts.
#include <gtest/gtest.h>

#include "rehearsal/scenario/scenario.h"
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

}  // namespace
}  // namespace narpa::rehearsal
