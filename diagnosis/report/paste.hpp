// A camera profile as text to paste: an invocation of `clspeckle render`, and code that sets the simulator up.
#pragma once

#include "measure/camera_profile.hpp"
#include "report/html_page.hpp"

#include <string>

namespace clsp {

// Each makes the camera that the profile's file makes, to the last bit. Light, which is the lab's, is in comments; so
// are effects on dots, which need a pattern that the library draws.
struct PasteTexts {
    std::string command_line, python, c;
};
PasteTexts paste_texts(const CameraProfile &profile);

// The section of the page.
void write_paste(const CameraProfile &profile, HtmlPage &page);

} // namespace clsp
