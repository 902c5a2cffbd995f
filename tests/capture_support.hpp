// The camera that tests of captures begin with.
#pragma once

#include "capture/capture.hpp"

#include <string>

namespace clsp {

// Ten bits, pixels of 2.9 um, f/5.6 at 940 nm; 64 and 4 DN by its data sheet.
inline CaptureLayout camera_layout(std::uint32_t width, std::uint32_t height) {
    CaptureLayout layout;
    layout.width = width;
    layout.height = height;
    layout.bits = 10;
    layout.pixel_pitch_m = 2.9e-6;
    layout.f_number = 5.6;
    layout.wavelength_m = 940e-9;
    layout.black_level_dn = 64.0;
    layout.read_noise_dn = 4.0;
    layout.principal_point_px = {0.5 * (width - 1.0), 0.5 * (height - 1.0)};
    return layout;
}

inline SequenceLayout &add_sequence(CaptureLayout &layout, const std::string &name, CaptureScene scene, bool moving,
                                    std::uint32_t frames) {
    SequenceLayout sequence;
    sequence.name = name;
    sequence.scene = scene;
    sequence.moving = moving;
    sequence.frame_count = frames;
    sequence.f_number = layout.f_number;
    layout.sequences.push_back(sequence);
    return layout.sequences.back();
}

} // namespace clsp
