// Whether OpenCL source reads other files.
#pragma once

#include <string>

namespace clsp {

// The first word of the source that reads a file, or may: a directive such as #include, a question whether a file is
// there, an assembler, a pragma but OPENCL, STDC and unroll, ## (it makes such words of parts). Empty where there is
// none. Words in comments, strings and characters are none.
std::string word_that_reads_files(const std::string &source);

} // namespace clsp
