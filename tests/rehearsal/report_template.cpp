// The language of the templates.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "rehearsal/report/template.h"

namespace narpa::rehearsal {
namespace {

using nlohmann::json;

TEST(Template, ValuesAreEscapedAndNumbersHaveTheirFormat) {
    EXPECT_EQ(filled("<{{a}}> {{b:.2f}} {{b}} {{none}}{{none:.2f}}{{n:g}}|",
                     {{"a", "x<\"&'"}, {"b", 0.125}, {"n", nullptr}}),
              "<x&lt;&quot;&amp;&#39;> 0.12 0.125 |");
}

TEST(Template, ASectionIsRepeatedForEachElementAndHiddenWithoutAny) {
    const json data{{"rows", {{{"n", 1}}, {{"n", 2}}}}, {"words", {"a", "b"}}, {"zero", 0},      {"no", false},
                    {"empty", json::array()},           {"text", ""},          {"null", nullptr}};
    EXPECT_EQ(filled("{{#rows}}<{{n}}>{{/rows}}{{#words}}{{.}}{{/words}}", data), "<1><2>ab");
    EXPECT_EQ(filled("{{#zero}}{{.}}{{/zero}}", data), "0") << "a value, not false";
    for (const char* hidden : {"no", "empty", "text", "null", "missing"}) {
        const std::string name = hidden, end = "{{/" + name + "}}";
        EXPECT_EQ(
            filled("[{{#" + name + "}}{{#rows}}shown{{/rows}}" + end + "{{^" + name + "}}not" + end + "]", data),
            "[not]")
            << name;
    }
    EXPECT_EQ(filled("{{^rows}}not{{/rows}}", data), "");
}

TEST(Template, NamesAreSearchedOutwardsAndDotsLeadInwards) {
    const json data{{"title", "outer"},
                    {"a", {{"b", {{"c", 3}}}, {"p99.9", 4}}},
                    {"rows", {{{"title", nullptr}}, json::object()}}};
    EXPECT_EQ(filled("{{a.b.c}}{{#a}}{{p99.9:.1f}}{{title}}{{/a}}{{a.title}}", data), "34.0outer");
    EXPECT_EQ(filled("{{#rows}}[{{title}}]{{/rows}}", data), "[][outer]") << "null hides the outer one";
}

}  // namespace
}  // namespace narpa::rehearsal
