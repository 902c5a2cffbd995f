#include "capture/capture_validation.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>

namespace clsp {
namespace {

[[noreturn]] void refuse(const CaptureOrigin &origin, const std::string &field, const std::string &what) {
    throw Error(Status::kInvalidArgument, fmt::format("{}: {} {}", origin.description, field, what));
}

void check_real(const CaptureOrigin &origin, const char *field, double value, bool in_range, const char *expected) {
    if (!std::isfinite(value) || !in_range)
        refuse(origin, field, fmt::format("is {}; expected {}", value, expected));
}

std::string sequence_field(std::size_t sequence, const char *member) {
    return fmt::format("/sequences/{}/{}", sequence, member);
}

// Names become names of files, on any system.
bool is_file_name_safe(const std::string &name) {
    if (name.empty() || name.size() > kMaxSequenceName || name[0] == '.' || name[0] == '-')
        return false;
    return std::all_of(name.begin(), name.end(), [](unsigned char c) {
        return (c < 128 && std::isalnum(c) != 0) || c == '_' || c == '-' || c == '.';
    });
}

// Dark.npy and dark.npy are one file on some systems.
std::string lower(std::string name) {
    for (char &c : name)
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return name;
}

// A name that may hold anything, for a message of one line.
std::string printable(const std::string &name) {
    std::string text;
    for (const char c : name.substr(0, 80))
        text += static_cast<unsigned char>(c) < 32 || c == 127 ? '?' : c;
    return text;
}

bool is_inside(const CaptureLayout &layout, const std::array<double, 2> &p) {
    return p[0] >= -0.5 && p[0] < layout.width - 0.5 && p[1] >= -0.5 && p[1] < layout.height - 0.5;
}

} // namespace

void validate_camera(const CaptureLayout &layout, const CaptureOrigin &origin) {
    for (const auto &[field, side] : {std::pair{"/camera/width", layout.width}, {"/camera/height", layout.height}})
        if (side < kMinCaptureSide || side > kMaxCaptureSide)
            refuse(origin, field,
                   fmt::format("is {}; expected {} to {} pixels", side, kMinCaptureSide, kMaxCaptureSide));
    if (layout.bits < kMinCaptureBits || layout.bits > kMaxCaptureBits)
        refuse(origin, "/camera/bits",
               fmt::format("is {}; expected {} to {} bits of a code", layout.bits, kMinCaptureBits, kMaxCaptureBits));
    const double um = layout.pixel_pitch_m * 1e6;
    check_real(origin, "/camera/pixel_pitch_um", um, um >= 0.01 && um <= 1000.0,
               "0.01 to 1000 um, the distance between pixel centres");
    check_real(origin, "/camera/f_number", layout.f_number, layout.f_number >= 0.1 && layout.f_number <= 1000.0,
               "0.1 to 1000");
    check_real(origin, "/camera/black_level_dn", layout.black_level_dn,
               layout.black_level_dn >= 0.0 && layout.black_level_dn < layout.maximum_code(),
               fmt::format("0 to below the top code, {} DN, as the data sheet says", layout.maximum_code()).c_str());
    check_real(origin, "/camera/read_noise_dn", layout.read_noise_dn,
               layout.read_noise_dn >= 0.0 && layout.read_noise_dn < layout.maximum_code(),
               "0 DN or more, the standard deviation that the data sheet says");
    for (const double value : layout.principal_point_px)
        check_real(origin, "/camera/principal_point_px", value, std::abs(value) <= 1e6,
                   "x and y in pixels, -1e6 to 1e6");
    const double nm = layout.wavelength_m * 1e9;
    check_real(origin, "/laser/wavelength_nm", nm, nm >= 100.0 && nm <= 20000.0, "100 to 20000 nm");
    check_real(origin, "/laser/degree_of_polarization", layout.degree_of_polarization,
               layout.degree_of_polarization >= 0.0 && layout.degree_of_polarization <= 1.0, "0 to 1");
}

void validate_dots(const CaptureLayout &layout, const CaptureDots &dots, const CaptureOrigin &origin) {
    check_real(origin, "/dots/sigma_px", dots.sigma_px, dots.sigma_px >= 0.01 && dots.sigma_px <= kMaxCaptureSide,
               "0.01 to 16384 pixels, the width exp(-1/2) of a dot");
    if (dots.positions_px.empty())
        refuse(origin, "/dots/positions_px", "has no dots; give at least one [x, y], or leave \"dots\" out");
    if (dots.positions_px.size() > kMaxCaptureDots)
        refuse(origin, "/dots/positions_px",
               fmt::format("has {} dots; at most {} are taken", dots.positions_px.size(), kMaxCaptureDots));
    bool any_inside = false;
    for (std::size_t i = 0; i < dots.positions_px.size(); ++i) {
        for (const double value : dots.positions_px[i])
            check_real(origin, fmt::format("/dots/positions_px/{}", i).c_str(), value, std::abs(value) <= 1e6,
                       "x and y in pixels, -1e6 to 1e6");
        any_inside |= is_inside(layout, dots.positions_px[i]);
    }
    if (!any_inside)
        refuse(origin, "/dots/positions_px",
               fmt::format("has {} dots, all of them outside of the image of {} x {} pixels (the first at {}, {}); "
                           "positions are [x, y] in pixels from the centre of the top left pixel",
                           dots.positions_px.size(), layout.width, layout.height, dots.positions_px[0][0],
                           dots.positions_px[0][1]));
}

void validate_sequence(const CaptureLayout &layout, std::size_t sequence, const CaptureOrigin &origin) {
    const SequenceLayout &s = layout.sequences.at(sequence);
    if (!is_file_name_safe(s.name))
        refuse(origin, sequence_field(sequence, "name"),
               fmt::format("is \"{}\"; expected 1 to {} letters, digits, '_', '-' and '.', the first no '.' or '-', as "
                           "it names a file",
                           printable(s.name), kMaxSequenceName));
    for (std::size_t i = 0; i < sequence; ++i)
        if (lower(layout.sequences[i].name) == lower(s.name))
            refuse(origin, sequence_field(sequence, "name"),
                   fmt::format("\"{}\" is the name of sequence {} too{}; give each sequence a name of its own", s.name,
                               i, layout.sequences[i].name == s.name ? "" : " but for capital letters"));
    if (s.frame_count == 0 || s.frame_count > kMaxCaptureFrames)
        refuse(origin, sequence_field(sequence, "frame_count"),
               fmt::format("of \"{}\" is {}; a sequence has 1 to {} frames", s.name, s.frame_count, kMaxCaptureFrames));
    check_real(origin, sequence_field(sequence, "f_number").c_str(), s.f_number,
               s.f_number >= 0.1 && s.f_number <= 1000.0, "0.1 to 1000");
    if (s.exposure_ms)
        check_real(origin, sequence_field(sequence, "exposure_ms").c_str(), *s.exposure_ms,
                   *s.exposure_ms > 0.0 && *s.exposure_ms <= 1e9, "a time above 0 ms, at most 1e9");
    if (!s.mask.empty() && s.mask.size() != layout.pixel_count())
        refuse(origin, sequence_field(sequence, "mask"),
               fmt::format("of \"{}\" has {} pixels; the image has {} x {} = {}: give a mask of that size, or none",
                           s.name, s.mask.size(), layout.width, layout.height, layout.pixel_count()));
    if (!s.mask.empty() && std::all_of(s.mask.begin(), s.mask.end(), [](std::uint8_t m) { return m == 0; }))
        refuse(origin, sequence_field(sequence, "mask"),
               fmt::format("of \"{}\" is 0 everywhere, so that no pixel counts; pixels that count are not 0", s.name));
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i <= sequence; ++i)
        bytes += std::uint64_t{layout.sequences[i].frame_count} * layout.pixel_count() * sizeof(std::uint16_t);
    if (bytes > kMaxCaptureBytes)
        refuse(
            origin, "/sequences",
            fmt::format("hold {:.1f} GiB of codes up to \"{}\"; at most {} GiB are taken: use fewer frames, or a part "
                        "of the image",
                        static_cast<double>(bytes) / 0x1p30, s.name, kMaxCaptureBytes >> 30));
}

void validate_layout(const CaptureLayout &layout, const CaptureOrigin &origin) {
    validate_camera(layout, origin);
    if (layout.dots)
        validate_dots(layout, *layout.dots, origin);
    if (layout.sequences.empty())
        refuse(origin, "/sequences", "is empty; list at least one sequence");
    if (layout.sequences.size() > kMaxCaptureSequences)
        refuse(origin, "/sequences",
               fmt::format("has {} entries; at most {} are taken", layout.sequences.size(), kMaxCaptureSequences));
    for (std::size_t i = 0; i < layout.sequences.size(); ++i) {
        validate_sequence(layout, i, origin);
        if (layout.sequences[i].scene == CaptureScene::kDots && !layout.dots)
            refuse(origin, sequence_field(i, "scene"),
                   fmt::format(
                       "of \"{}\" is dots, but there is no \"dots\" with the ideal dots' sigma_px and positions_px; "
                       "add it (the design of the pattern, or centroids of the mean image)",
                       layout.sequences[i].name));
    }
}

void validate_codes(const CaptureLayout &layout, std::size_t sequence, const std::vector<std::uint16_t> &codes,
                    const CaptureOrigin &origin) {
    const SequenceLayout &s = layout.sequences.at(sequence);
    const std::string where = sequence < origin.files.size() && !origin.files[sequence].empty()
                                  ? origin.files[sequence]
                                  : fmt::format("{}: sequence \"{}\"", origin.description, s.name);
    const std::uint64_t expected = std::uint64_t{s.frame_count} * layout.pixel_count();
    if (codes.size() != expected)
        throw Error(Status::kInvalidData,
                    fmt::format("{}: there are {} codes; {} frames of {} x {} pixels have {}", where, codes.size(),
                                s.frame_count, layout.width, layout.height, expected));
    const auto maximum = static_cast<std::uint32_t>(layout.maximum_code());
    const auto bad = std::find_if(codes.begin(), codes.end(), [&](std::uint16_t code) { return code > maximum; });
    if (bad == codes.end())
        return;
    const auto index = static_cast<std::size_t>(bad - codes.begin());
    const auto count = std::count_if(bad, codes.end(), [&](std::uint16_t code) { return code > maximum; });
    const std::uint16_t top = *std::max_element(codes.begin(), codes.end());
    std::uint32_t bits = layout.bits;
    while (bits < 16 && top >> bits != 0)
        ++bits;
    throw Error(
        Status::kInvalidData,
        fmt::format(
            "{}: frame {}, pixel ({}, {}): the code is {}, but /camera/bits is {}, so that {} is the top code; {} "
            "codes are above it, the largest is {}. Set bits to {}, or shift the codes down if the camera "
            "stores them in the upper bits",
            where, index / layout.pixel_count(), index % layout.width, index % layout.pixel_count() / layout.width,
            *bad, layout.bits, maximum, count, top, bits));
}

void validate_capture(const Capture &capture, const CaptureOrigin &origin) {
    validate_layout(capture.layout, origin);
    if (capture.codes.size() != capture.layout.sequences.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("{}: there are codes of {} sequences, but {} sequences", origin.description,
                                capture.codes.size(), capture.layout.sequences.size()));
    for (std::size_t i = 0; i < capture.codes.size(); ++i)
        if (!capture.is_stored(i)) // else they were read
            validate_codes(capture.layout, i, capture.codes[i], origin);
}

} // namespace clsp
