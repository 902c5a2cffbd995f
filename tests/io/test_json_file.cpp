// The one reader of JSON files: what it takes as it stands, its bounds, and what becomes of it where memory runs out.
#include "io/json_file.hpp"
#include "io/json_text.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <new>
#include <string>

namespace {

// Allocations from now on until one fails, and whether all behind it do; below 0: none fails.
thread_local long allocations_left = -1;
thread_local bool fails_for_good = false;

void *allocated(std::size_t bytes) {
    if (allocations_left == 0) {
        if (!fails_for_good)
            allocations_left = -1;
        throw std::bad_alloc();
    }
    if (allocations_left > 0)
        --allocations_left;
    if (void *memory = std::malloc(bytes ? bytes : 1))
        return memory;
    throw std::bad_alloc();
}

} // namespace

void *operator new(std::size_t bytes) {
    return allocated(bytes);
}
void *operator new[](std::size_t bytes) {
    return allocated(bytes);
}
void operator delete(void *memory) noexcept {
    std::free(memory);
}
void operator delete[](void *memory) noexcept {
    std::free(memory);
}
void operator delete(void *memory, std::size_t) noexcept {
    std::free(memory);
}
void operator delete[](void *memory, std::size_t) noexcept {
    std::free(memory);
}

namespace {

using image_io::Json;
using image_io::JsonDocument;
using image_io::JsonText;
using image_io::parse_json;

std::string times(std::size_t count, const std::string &text) {
    std::string result;
    result.reserve(count * text.size());
    for (std::size_t i = 0; i < count; ++i)
        result += text;
    return result;
}

// The message of a text that must be refused.
std::string refused(const std::string &text) {
    try {
        parse_json(text, "it.json");
    } catch (const image_io::JsonError &error) {
        const std::string message = error.what();
        EXPECT_EQ(message.rfind("it.json: ", 0), 0u) << message;
        EXPECT_LT(message.size(), 800u);
        for (const char c : message)
            EXPECT_TRUE(c >= ' ' && c <= '~') << int(c);
        return message;
    }
    ADD_FAILURE() << "taken: " << text.substr(0, 80);
    return "";
}

::testing::AssertionResult says(const std::string &message, const std::string &words) {
    if (message.find(words) != std::string::npos)
        return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "\"" << message << "\" does not say \"" << words << "\"";
}

double seconds_of_work(const std::string &text) {
    const std::clock_t before = std::clock();
    try {
        parse_json(text, "it.json");
    } catch (const image_io::JsonError &) {
    }
    return double(std::clock() - before) / CLOCKS_PER_SEC;
}

TEST(JsonFile, IsReadAsTheLibraryReadsIt) {
    for (const char *text :
         {"{}", "[]", "1", "-7", "18446744073709551615", "1e-400", "0.1", "true", "null", "\"\"", "\"\\u00e9\\n\"",
          R"({"b": [1, {"c": {}}, [], [[2.5]]], "a": {"x": null, "y": [{"x": 1}, {"x": 2}]}, "": "z"})",
          " [ { } , [ ] ] \n"}) {
        const JsonDocument read = parse_json(text, "it.json");
        EXPECT_EQ(read.root(), Json::parse(text)) << text;
        EXPECT_EQ(read.root().dump(), Json::parse(text).dump()) << text; // in the file's order
    }
}

TEST(JsonFile, MayBeginWithAByteOrderMarkOfUtf8) {
    EXPECT_EQ(parse_json("\xef\xbb\xbf[1]", "it.json").root(), Json::parse("[1]"));
    EXPECT_TRUE(says(refused(std::string("\xff\xfe[\0]\0", 6)), "save it in that encoding"));
    EXPECT_TRUE(says(refused(std::string("\xfe\xff\0[\0]", 6)), "save it in that encoding"));
    EXPECT_TRUE(says(refused(std::string("[\0]\0", 4)), "save it in that encoding"));
}

TEST(JsonFile, IsRefusedWithWhatIsWrong) {
    EXPECT_TRUE(says(refused(std::string("{}\0{}", 5)), "byte 2 is 0; the file is no text in UTF-8"));
    EXPECT_TRUE(says(refused("[\"\xff\"]"), "save it in that encoding"));
    EXPECT_TRUE(says(refused("{\"a\": [1, 2"), "ends before it is complete"));
    EXPECT_TRUE(says(refused("{\"a\": \"b"), "ends before it is complete"));
    EXPECT_TRUE(says(refused(""), "is not valid JSON"));
    EXPECT_TRUE(says(refused("[1] [2]"), "is not valid JSON"));
    EXPECT_TRUE(says(refused("[NaN]"), "neither NaN nor Infinity"));
    EXPECT_TRUE(says(refused("{\"a\": 1, // one\n}"), "there are no comments"));
    EXPECT_TRUE(says(refused("[1e999]"), "expected a number below 1.8e308"));
    EXPECT_TRUE(says(refused("[" + times(100000, "9") + "]"), "expected a number below 1.8e308"));
    EXPECT_TRUE(says(refused("[" + times(100000, "x") + "]"), "is not valid JSON"));
    EXPECT_TRUE(says(refused("[\x1b[31m]"), "is not valid JSON"));
}

TEST(JsonFile, GivesAKeyOnce) {
    EXPECT_TRUE(says(refused(R"({"a": 1, "a": 1})"), "the key \"a\" is given twice; keep one of them"));
    EXPECT_TRUE(says(refused(R"({"a": {"b": 1, "c": [], "b": 2}})"), "the key \"a.b\" is given twice"));
    EXPECT_TRUE(
        says(refused(R"({"a": [{"x": 1}, {"b": {"c": 1, "\u0063": 2}}]})"), "the key \"a.b.c\" is given twice"));
    EXPECT_EQ(parse_json(R"([{"a": 1}, {"a": {"a": 2}}])", "it.json").root().size(), 2u);
}

TEST(JsonFile, HasBounds) {
    const std::size_t levels = image_io::most_json_levels;
    EXPECT_EQ(parse_json(times(levels, "[") + times(levels, "]"), "it.json").root().size(), 1u);
    for (const char *open : {"[", "{\"a\":"})
        for (const std::size_t deep : {levels + 1, std::size_t{80000}, std::size_t{5000000}})
            EXPECT_TRUE(says(refused(times(deep, open)), "is nested more than 100 levels deep"));
    const std::string key(image_io::most_json_key_bytes, 'k');
    EXPECT_EQ(parse_json("{\"" + key + "\": 1}", "it.json").root().size(), 1u);
    EXPECT_TRUE(says(refused("{\"" + key + "k\": 1}"), "has a key of 1025 bytes"));
    const std::size_t values = image_io::most_json_values;
    EXPECT_EQ(parse_json("[0" + times(values - 2, ",0") + "]", "it.json").root().size(), values - 1);
    EXPECT_TRUE(says(refused("[0" + times(values - 1, ",0") + "]"), "holds more than 4194304 values"));
    EXPECT_TRUE(says(refused("[[]" + times(values, ",{}") + "]"), "holds more than 4194304 values"));

    const std::string path = ::testing::TempDir() + "large.json";
    std::ofstream(path) << "[1]";
    std::filesystem::resize_file(path, image_io::most_json_bytes + 1); // a hole
    try {
        image_io::read_json(path);
        ADD_FAILURE() << "taken";
    } catch (const image_io::JsonError &error) {
        EXPECT_TRUE(says(error.what(), "has 67108865 bytes; a JSON file may have 67108864"));
    }
    std::filesystem::remove(path);
}

// Four times the text is four times the work; a quadratic reader takes sixteen times, and hours of the large ones.
TEST(JsonFile, TakesTimeThatIsLinear) {
    const auto members = [](std::size_t count) {
        std::string text = "{";
        for (std::size_t i = 0; i < count; ++i)
            text += fmt::format("{}\"{}\":{{}}", i ? "," : "", i);
        return text + "}";
    };
    for (const auto &[small, large] :
         {std::pair("[0" + times(100000, ",{}") + "]", "[0" + times(400000, ",{}") + "]"),
          std::pair("[0" + times(50000, ",[1,2]") + "]", "[0" + times(200000, ",[1,2]") + "]"),
          std::pair(members(50000), members(200000))})
        EXPECT_LT(seconds_of_work(large), 10 * seconds_of_work(small) + 0.05) << large.substr(0, 30);
}

// How many allocations of work() fail, each in a run of its own.
template <typename Work> long failed_allocations(bool for_good, Work work) {
    long failed = 0;
    for (long n = 0; failed == n; ++n) {
        try {
            fails_for_good = for_good;
            allocations_left = n;
            work();
        } catch (const std::bad_alloc &) {
            ++failed;
        } catch (const image_io::JsonError &) {
            // What a whole run says of it, too.
        }
        allocations_left = -1;
    }
    return failed;
}

// Json's own destructor allocates, and must not throw.
TEST(JsonFile, SurvivesEveryAllocationThatFails) {
    std::string text =
        R"({"a": [1, {"b": "a text that is longer than sixteen bytes", "c": [[], {}, [[2]]]}, [3, 4]], "d": {}, )";
    text += R"("e": {"f": {"g": [{"h": 1}, {"h": 2}, {"a key that is longer than sixteen bytes": [true]}]}}})";
    const std::string twice = text.substr(0, text.size() - 1) + ", \"d\": 1}", cut = text.substr(0, text.size() - 2);
    for (const std::string &json : {text, twice, cut})
        for (const bool for_good : {false, true}) {
            const long failed = failed_allocations(for_good, [&] {
                const JsonDocument read = parse_json(json, "it.json");
                if (allocations_left > 0)
                    allocations_left = 0; // nor has the destructor any
                fails_for_good = true;
            });
            EXPECT_GT(failed, 20) << json;
        }
}

JsonText written() {
    JsonText entries = JsonText::array();
    for (const double value : {0.0, -0.0, 1.0, -2.5, 0.1, 1e-5, 1e-4, 123456789012.0, 1e16, 1e300, 5e-324, 1.0 / 3.0})
        entries.push_back({{"a key that is longer than sixteen bytes", value}, {"pair", {value, 1.0f}}});
    JsonText root = {{"text", "\"quoted\" \\ \b\f\n\r\t \x01 \x7f \u00e9"},
                     {"whole", {0, -7, 18446744073709551615u, std::numeric_limits<std::int64_t>::min()}},
                     {"names", std::vector<std::string>{"one that is longer than sixteen", "two"}},
                     {"none", nullptr},
                     {"flags", {true, false}},
                     {"empty", {{"list", JsonText::array()}, {"object", JsonText::object()}}}};
    root["entries"] = entries;
    root["copy"]["of"] = entries.back();
    root["text"] = "another, longer than sixteen bytes";
    return root;
}

// Another writer's bytes, and what its reader makes of them.
TEST(JsonText, IsWhatTheLibraryWrites) {
    for (const int indent : {-1, 0, 1, 4}) {
        const std::string text = written().text(indent);
        const Json read = Json::parse(text);
        EXPECT_EQ(read.dump(indent), text);
    }
    const Json root = Json::parse(written().text());
    EXPECT_EQ(root["entries"].size(), 12u);
    EXPECT_EQ(root["entries"][11]["pair"], Json::parse("[0.3333333333333333, 1.0]"));
    EXPECT_EQ(root["whole"][2].get<std::uint64_t>(), 18446744073709551615u);
    EXPECT_TRUE(root["entries"][2]["pair"][0].is_number_float()); // 1.0 is no 1
    EXPECT_TRUE(std::signbit(root["entries"][1]["pair"][0].get<double>()));
    EXPECT_EQ(root["copy"]["of"], root["entries"][11]);
}

TEST(JsonText, HasWhatJsonCannotHold) {
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_EQ(JsonText({infinity, -infinity, std::nan("")}).text(), "[null,null,null]");
    EXPECT_EQ(JsonText("\xff\x80z").text(), "\"\xEF\xBF\xBD\xEF\xBF\xBDz\"");
}

TEST(JsonText, SurvivesEveryAllocationThatFails) {
    const std::string expected = written().text(1);
    for (const bool for_good : {false, true}) {
        std::string text;
        EXPECT_GT(failed_allocations(for_good, [&] { text = written().text(1); }), 300);
        EXPECT_EQ(text, expected);
    }
}

TEST(JsonFile, ShowsAValueShortly) {
    EXPECT_EQ(image_io::shown(Json::parse(R"({"a": [1, "b"]})")), R"({"a":[1,"b"]})");
    EXPECT_EQ(image_io::shown(std::string(100, 'x')).size(), 60u);
    EXPECT_EQ(image_io::shown(std::vector<int>(100000)), "a list of 100000 entries");
    EXPECT_EQ(image_io::shown("\x1b]0;x\x07\xc2\x9b"), R"("\u001b]0;x\u0007\u009b")");
}

} // namespace
