// Where in the kernel files a compiler's messages belong.
#pragma once

#include <string>

namespace clsp {

// A compiler that ignores #line directives, as NVIDIA's does, counts the lines of the whole program: a message begins
// with "<kernel>:525:19:". Here it gets the file and line that the directives of the program's text say:
// "stages/sensor.cl:12:19:". Everything else stays as it is, so that a log with files and lines is the same afterwards.
std::string with_files_and_lines(const std::string &build_log, const std::string &program_text);

// Whether it speaks of an error in the source. A log that does not is of a failure of the driver's own: PoCL's, where
// several processes fill a cold cache of its at once.
bool names_an_error(const std::string &build_log);

} // namespace clsp
