// Build logs whose line numbers count the whole program: they get the files and lines that its #line directives say.
#include "runtime/build_log.hpp"

#include <gtest/gtest.h>

#include <string>

namespace {

using clsp::with_files_and_lines;

constexpr const char *kProgram = "#line 1 \"frame.cl\"\n"  // 1
                                 "// A frame.\n"           // 2: frame.cl:1
                                 "#line 1 \"common/pixel.h\"\n"   // 3
                                 "float pixel(void);\n"    // 4: common/pixel.h:1
                                 "\n"                      // 5: common/pixel.h:2
                                 "#line 3 \"frame.cl\"\n"  // 6
                                 "float a;\n"              // 7: frame.cl:3
                                 "#line 1 \"of a user\"\n" // 8
                                 "float b;\n"              // 9: of a user:1
                                 "#line 40\n"              // 10: the file is the same
                                 "float c;\n";             // 11: of a user:40

TEST(BuildLog, LinesOfTheWholeProgramBecomeFilesAndLines) {
    for (const auto &[whole, place] : {std::pair{"<kernel>:2", "frame.cl:1"},
                                       {"<kernel>:4", "common/pixel.h:1"},
                                       {"<kernel>:5", "common/pixel.h:2"},
                                       {"<kernel>:7", "frame.cl:3"},
                                       {"<kernel>:9", "of a user:1"},
                                       {"<kernel>:11", "of a user:40"},
                                       {"<kernel>:12", "of a user:41"}})
        EXPECT_EQ(std::string(place) + ":19: error: what",
                  with_files_and_lines(std::string(whole) + ":19: error: what", kProgram));
    EXPECT_EQ(
        "frame.cl:3:7: error: unknown type\nfloat a;\n      ^\ncommon/pixel.h:1:7: note: here\n1 error generated.\n",
        with_files_and_lines("<kernel>:7:7: error: unknown type\nfloat a;\n      ^\n"
                             "<kernel>:4:7: note: here\n1 error generated.\n",
                             kProgram));
}

TEST(BuildLog, WhatHasFilesAndLinesOrNoneStaysAsItIs) {
    for (const char *log :
         {"", "frame.cl:3:7: error: unknown type\n", "error: frame.cl:3:7: unknown type", "<kernel>",
          "<kernel>:", "<kernel>: error: too large", "<kernel>: 7 errors", "<kernel>:-7", "<kernel>:0:1: error",
          "<kernel>:13:1: error", "<kernel>:99999999999999999999999:1: error", "(the driver gave no build log)"})
        EXPECT_EQ(log, with_files_and_lines(log, kProgram));
    EXPECT_EQ("<kernel>:1:1: error", with_files_and_lines("<kernel>:1:1: error", "float a;\n"));
    EXPECT_EQ("<kernel>:1:1: error", with_files_and_lines("<kernel>:1:1: error", ""));
}

TEST(BuildLog, NamesAnErrorOrIsOfTheDriversOwnFailure) {
    for (const char *log : {"frame.cl:3:7: error: unknown type\n", "1 Error generated", "frame.cl(3): ERROR: syntax"})
        EXPECT_TRUE(clsp::names_an_error(log)) << log;
    for (const char *log :
         {"", "(the driver gave no build log)", "Device pthread-skylake failed to build the program\n",
          "frame.cl:3:7: warning: unused variable\n"})
        EXPECT_FALSE(clsp::names_an_error(log)) << log;
}

} // namespace
