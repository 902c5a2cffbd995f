// Whether OpenCL source reads other files.
#pragma once

#include <string>

namespace clsp {

// True if the tokens that a compiler sees hold a directive that reads a file, or a question whether one is there. It
// errs on the safe side: in a comment or a string such tokens count, too.
bool includes_files(const std::string &source);

} // namespace clsp
