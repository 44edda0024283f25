// tests/support/oracle.h - reference numbers from exact and 60-digit arithmetic, in a sibling folder of the
// project.
#pragma once

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/paths.h"

namespace narpa::test {

inline nlohmann::json oracle(const std::string& name) {
    std::ifstream file(test::source_path("../shared/oracles/") + name + ".json");
    return file ? nlohmann::json::parse(file) : nlohmann::json();
}

}  // namespace narpa::test

#define NEED_ORACLE(variable, name)                              \
    const nlohmann::json variable = ::narpa::test::oracle(name); \
    if (variable.is_null())                                      \
    GTEST_SKIP() << "no reference numbers beside the project: ../shared/oracles/" name ".json"
