// Text files as programs of all systems write them: lines, numbers, and cells of spreadsheets.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <random>
#include <sstream>

#include "base/text/csv.h"
#include "base/text/text_cursor.h"

namespace narpa {
namespace {

std::vector<std::string> lines_of(std::string text) {
    TextLines lines(std::move(text));
    std::vector<std::string> out;
    for (std::string_view line; lines.next(line);) out.emplace_back(line);
    EXPECT_EQ(lines.number(), static_cast<int>(out.size()));
    return out;
}

/// As UTF-16 with its byte order mark.
std::string utf16(const std::u16string& text, bool is_big_endian) {
    std::string out;
    for (const char16_t c : u"\ufeff" + text) {
        const char low = static_cast<char>(c & 0xff), high = static_cast<char>(c >> 8);
        out += is_big_endian ? std::string{high, low} : std::string{low, high};
    }
    return out;
}

TEST(TextLines, LineEndsOfAllSystemsAreTheSame) {
    const std::vector<std::string> expected{"a", "", "b c", "d"};
    for (const std::string& end : {std::string("\n"), std::string("\r\n"), std::string("\r")})
        for (const std::string& mark : {std::string(), std::string("\xef\xbb\xbf")})
            for (const bool has_last : {false, true})
                EXPECT_EQ(lines_of(mark + "a" + end + end + "b c" + end + "d" + (has_last ? end : "")), expected);
    EXPECT_EQ(lines_of("a\r\n\rb c\nd\r"), expected) << "mixed";
    EXPECT_EQ(lines_of(""), std::vector<std::string>{});
    std::istringstream in("a\r\n\r\nb c\r\nd");
    TextLines lines(in);
    std::string_view line;
    ASSERT_TRUE(lines.next(line));
    EXPECT_EQ(line, "a");
}

TEST(TextLines, Utf16IsConverted) {
    for (const bool is_big_endian : {false, true})
        EXPECT_EQ(lines_of(utf16(u"v \u00e9\r\n\u20ac \U0001f680", is_big_endian)),
                  (std::vector<std::string>{"v \xc3\xa9", "\xe2\x82\xac \xf0\x9f\x9a\x80"}));
    EXPECT_EQ(lines_of(utf16(std::u16string{0xd83d, u'a'}, false)), std::vector<std::string>{"\xef\xbf\xbd"
                                                                                             "a"});
}

TEST(TextNumber, FormsOfOtherLanguages) {
    struct Case {
        const char* text;
        double value;
    };
    for (const auto& [text, value] :
         {Case{"1.5D+00", 1.5}, Case{"-1.5d3", -1500}, Case{"+2D-1", 0.2}, Case{"1.5-101", 1.5e-101},
          Case{"-1.5+101", -1.5e101}, Case{"1.#INF", INFINITY}, Case{"-1.#INF00", -INFINITY},
          Case{"1e999", INFINITY}, Case{"1e-999", 0}, Case{"+.5", 0.5}, Case{"0D0", 0}}) {
        const auto x = number_from(text);
        ASSERT_TRUE(x) << text;
        EXPECT_EQ(*x, value) << text;
    }
    for (const char* text : {"-1.#IND", "1.#QNAN", "1.#SNAN0", "nan", "-nan"}) {
        ASSERT_TRUE(number_from(text)) << text;
        EXPECT_TRUE(std::isnan(*number_from(text))) << text;
    }
    for (const char* text :
         {"", "D", "D5", "1.5DD0", "1.#", "1.#FOO", "1.5-10", "15-101", "1-2", "++1", "+-1", "1,5", "0x1"})
        EXPECT_FALSE(number_from(text)) << text;
}

TEST(TextCursor, ALineGoesOnBehindABackslashUnlessACommentEndsIt) {
    constexpr std::array<std::string_view, 2> keywords{"f", "g"};
    TextCursor in("f 1 2\\\n 3\r\n# C:\\\nf 4 # C:\\\ng name\\\nf 5\\\r\n6\n", "t", keywords);
    std::vector<std::string> lines;
    while (in.next_line()) {
        std::string& line = lines.emplace_back();
        for (std::string_view token = in.token(); !token.empty(); token = in.token())
            line += std::string(token) + "|";
    }
    EXPECT_EQ(lines, (std::vector<std::string>{"f|1|2|3|", "", "f|4|", "g|name\\|", "f|5|6|", ""}));
}

/// The rows of a CSV file, cells joined by '|'; or the error.
std::string rows_of(const std::string& text, std::string_view header = "t,name,x") {
    const std::string path = testing::TempDir() + "narpa_csv_" + std::to_string(::getpid()) + ".csv";
    std::ofstream(path, std::ios::binary) << text;
    std::string out;
    const Status read = read_csv_rows(path, header, "a table", "row", [&](const CsvRow& row) -> Status {
        out += std::to_string(row.number) + ":";
        for (const std::string_view cell : row.cells) {
            const auto number = row.number_in(cell);
            out += (number ? std::to_string(*number) : std::string(cell)) + "|";
        }
        return Ok{};
    });
    std::remove(path.c_str());
    return read ? out : read.error().text().substr(path.size());
}

TEST(Csv, SpreadsheetsOfAllCountriesAreRead) {
    const std::string rows = "2:1.500000|a|2.000000|3:2.000000|b|-0.250000|";
    EXPECT_EQ(rows_of("t,name,x\n1.5,a,2\n2,b,-0.25\n"), rows);
    EXPECT_EQ(rows_of("\xef\xbb\xbft,name,x\r\n1.5,a,2\r\n2,b,-0.25\r\n"), rows);
    EXPECT_EQ(rows_of("t;name;x\r1,5;a;2\r2;b;-2,5E-1"), rows);
    EXPECT_EQ(rows_of("t\tname\tx\n1.5\ta\t2\n2\tb\t-0.25\n"), rows);
    EXPECT_EQ(rows_of("\"t\",\"name\",\"x\"\n\"1.5\",\"a\",\"2\"\n2, \"b\" ,-0.25\n"), rows);
    EXPECT_EQ(rows_of("t,name,x,,\n1.5,a,2,,\n2,b,-0.25,,\n,,,,\n"), rows);
    EXPECT_EQ(rows_of("sep=;\nt;name;x\n1,5;a;2\n2;b;-0,25\n"), "3:1.500000|a|2.000000|4:2.000000|b|-0.250000|");
    EXPECT_EQ(rows_of("# note\nt,name,x\n\n\"# note, too\"\n1,\"a, \"\"b\"\"\",2\n"),
              "5:1.000000|a, \"b\"|2.000000|");
    EXPECT_EQ(rows_of("t,name,x\n1,a,2,3\n"), "2:1.000000|a|2.000000|3.000000|") << "the caller counts the cells";
}

TEST(Csv, WhatCannotBeReadIsNamed) {
    EXPECT_EQ(rows_of("t,name\n1,a\n"), ":1:1: expected the header line \"t,name,x\"");
    EXPECT_EQ(rows_of("t,name,x\n1,\"a,2\n"),
              ":2:4: expected a quote at the end of the cell, and a separator behind it");
    EXPECT_EQ(rows_of("t,name,x\n1,\"a\"b,2\n"),
              ":2:4: expected a quote at the end of the cell, and a separator behind it");
    EXPECT_EQ(rows_of("t,name,x\n,,\n"), ": no rows, expected a header line and at least one row");
    EXPECT_EQ(rows_of("t,name,x\n1,5,a,2\n"), "2:1.000000|5.000000|a|2.000000|") << "a comma separates";
}

}  // namespace
}  // namespace narpa
