#include "clspeckle/capture.h"

#include "capture/capture_check.hpp"
#include "capture/capture_reader.hpp"
#include "capture/capture_validation.hpp"
#include "capture/capture_writer.hpp"
#include "capture/judged_part.hpp"
#include "capture/stored_sequence.hpp"
#include "capture_handle.hpp"
#include "convert.hpp"
#include "fields.hpp"
#include "io/json_text.hpp"
#include "progress.hpp"
#include "report/emva_report.hpp"
#include "status.hpp"
#include "texts.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(CaptureScene, kDots, CLSP_SCENE_DARK, CLSP_SCENE_FLAT, CLSP_SCENE_BOARD, CLSP_SCENE_DOTS)

} // namespace clsp::capi

namespace {

static_assert(CLSP_MAX_CAPTURE_NAME == kMaxSequenceName + 1, "the engine's limit and the API's must agree");
static_assert(CLSP_MAX_DOTS == kMaxCaptureDots, "the engine's limit and the API's must agree");

constexpr auto kCaptureFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.bits, p.bits);
    field(d.field, p.field, "desc->field");
    field(d.pixel_pitch_m, p.pixel_pitch_m);
    field(d.f_number, p.f_number);
    field(d.wavelength_m, p.wavelength_m);
    field(d.degree_of_polarization, p.degree_of_polarization);
    field(d.black_level_dn, p.black_level_dn);
    field(d.read_noise_dn, p.read_noise_dn);
};

ClspCaptureDesc capture_defaults() {
    ClspCaptureDesc desc{};
    desc.struct_size = sizeof desc;
    desc.bits = 10;
    desc.pixel_pitch_m = 2.9e-6;
    desc.f_number = 5.6;
    desc.wavelength_m = 940e-9;
    desc.degree_of_polarization = 1.0;
    desc.black_level_dn = 64.0;
    desc.read_noise_dn = 4.0;
    return desc;
}

ClspCaptureSequence sequence_defaults() {
    ClspCaptureSequence sequence{};
    sequence.struct_size = sizeof sequence;
    return sequence;
}

CaptureLayout capture_layout(const ClspCaptureDesc *user) {
    const ClspCaptureDesc d = read_struct(user, capture_defaults(), "desc");
    auto layout = from_c<CaptureLayout>(kCaptureFields, d);
    layout.principal_point_px = {(d.width - 1.0) / 2.0, (d.height - 1.0) / 2.0};
    if (checked_flag(d.principal_point_given, "desc->principal_point_given"))
        layout.principal_point_px = {d.principal_point_x_px, d.principal_point_y_px};
    else if (d.principal_point_x_px != 0.0 || d.principal_point_y_px != 0.0) // also NaN
        throw Error(Status::kInvalidArgument,
                    fmt::format("desc->principal_point is ({}, {}), but desc->principal_point_given is 0; set it to 1, "
                                "or leave the point at 0",
                                d.principal_point_x_px, d.principal_point_y_px));
    return layout;
}

const SequenceLayout &sequence_at(const Capture &capture, std::uint32_t index) {
    const auto &sequences = capture.layout.sequences;
    if (index >= sequences.size())
        throw Error(Status::kInvalidArgument,
                    fmt::format("index is {}, there are {} sequences (numbered from 0)", index, sequences.size()));
    return sequences[index];
}

void check_capacity(std::uint64_t capacity, std::uint64_t needed, const char *what) {
    if (capacity < needed)
        throw Error(Status::kBufferTooSmall,
                    fmt::format("capacity is {}, but there are {} {}", capacity, needed, what));
}

// Of a large capture the part that a diagnosis would judge.
Emva1288 emva_of(const Capture &capture) {
    const JudgedPart part = choose_part(capture.layout, {});
    if (part.is_whole())
        return measure_emva1288(capture);
    std::vector<std::size_t> all(capture.layout.sequences.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    Emva1288 result = measure_emva1288(take_part(capture, all, capture.layout.sequences, part));
    result.notes.insert(result.notes.begin(), {"", "measured were " + part_text(part)});
    return result;
}

} // namespace

extern "C" {

CLSP_INIT(CaptureDesc, desc, capture_defaults())

CLSP_INIT(CaptureSequence, sequence, sequence_defaults())

CLSP_API ClspStatus clspCaptureCreate(const ClspCaptureDesc *desc, ClspCapture *capture) {
    return guarded("clspCaptureCreate", [&] {
        required(capture, "capture");
        auto made = std::make_shared<Capture>();
        made->layout = capture_layout(desc);
        validate_camera(made->layout);
        give(capture, std::move(made));
    });
}

CLSP_API ClspStatus clspCaptureOpen(const char *path, ClspCapture *capture) {
    return guarded("clspCaptureOpen", [&] {
        required(capture, "capture");
        give(capture, std::make_shared<Capture>(read_capture(&required(path, "path"))));
    });
}

CLSP_API ClspStatus clspCaptureOpenWithProgress(const char *path, ClspProgressFunction progress, void *progress_data,
                                                ClspCapture *capture) {
    return guarded("clspCaptureOpenWithProgress", [&] {
        required(capture, "capture");
        const ProgressFunction tell = progress_function(progress, progress_data);
        give(capture, std::make_shared<Capture>(read_capture(&required(path, "path"), [&](double part) {
                 if (tell && !tell("reading", part))
                     throw Error(Status::kCancelled, "reading the capture was cancelled by its progress callback");
             })));
    });
}

CLSP_REFERENCES(Capture)

CLSP_API ClspStatus clspCaptureAddSequence(ClspCapture capture, const ClspCaptureSequence *sequence) {
    return guarded("clspCaptureAddSequence", [&] {
        const auto c = object_to_change(capture);
        const ClspCaptureSequence s = read_struct(sequence, sequence_defaults(), "sequence");
        if (c->layout.sequences.size() >= kMaxCaptureSequences)
            throw Error(Status::kInvalidArgument,
                        fmt::format("the capture has {} sequences, it cannot have more", kMaxCaptureSequences));
        if (!s.codes)
            throw Error(Status::kInvalidArgument, "sequence->codes is NULL");
        SequenceLayout added;
        added.name = &required(s.name, "sequence->name");
        added.scene = checked_enum<CaptureScene>(s.scene, "sequence->scene");
        added.moving = checked_flag(s.moving, "sequence->moving");
        added.frame_count = s.frame_count;
        added.f_number = s.f_number == 0.0 ? c->layout.f_number : s.f_number;
        if (s.exposure_ms != 0.0)
            added.exposure_ms = s.exposure_ms;
        const std::size_t pixels = c->layout.pixel_count();
        if (s.mask)
            added.mask.assign(s.mask, s.mask + pixels);
        // Checked at its place behind the others, before the codes take memory.
        std::vector<SequenceLayout> &sequences = c->layout.sequences;
        const std::size_t index = sequences.size();
        c->codes.reserve(index + 1); // nothing may fail once all is checked
        sequences.push_back(std::move(added));
        try {
            validate_sequence(c->layout, index);
            std::vector<std::uint16_t> codes(s.codes, s.codes + s.frame_count * pixels);
            validate_codes(c->layout, index, codes);
            c->codes.push_back(std::move(codes));
        } catch (...) {
            sequences.pop_back();
            throw;
        }
    });
}

CLSP_API ClspStatus clspCaptureSetDots(ClspCapture capture, double sigma_px, uint64_t count,
                                       const double *positions_px) {
    return guarded("clspCaptureSetDots", [&] {
        const auto c = object_to_change(capture);
        if (count > 0 && !positions_px)
            throw Error(Status::kInvalidArgument, fmt::format("positions_px is NULL, but count is {}", count));
        if (count > kMaxCaptureDots)
            throw Error(Status::kInvalidArgument,
                        fmt::format("count is {}, at most {} dots are taken", count, kMaxCaptureDots));
        if (count == 0) {
            c->layout.dots.reset();
            return;
        }
        CaptureDots dots;
        dots.sigma_px = sigma_px;
        for (std::uint64_t i = 0; i < count; ++i)
            dots.positions_px.push_back({positions_px[2 * i], positions_px[2 * i + 1]});
        validate_dots(c->layout, dots);
        c->layout.dots = std::move(dots);
    });
}

CLSP_API ClspStatus clspCaptureValidate(ClspCapture capture) {
    return guarded("clspCaptureValidate", [&] { validate_capture(*object(capture)); });
}

CLSP_API ClspStatus clspCaptureWrite(ClspCapture capture, const char *path, uint32_t overwrite) {
    return guarded("clspCaptureWrite", [&] {
        const auto c = object(capture);
        write_capture(*c, &required(path, "path"), checked_flag(overwrite, "overwrite"));
    });
}

CLSP_API ClspStatus clspCaptureGetDesc(ClspCapture capture, ClspCaptureDesc *desc) {
    return guarded("clspCaptureGetDesc", [&] {
        const auto c = object(capture);
        auto result = to_c<ClspCaptureDesc>(kCaptureFields, c->layout);
        result.principal_point_given = 1;
        result.principal_point_x_px = c->layout.principal_point_px[0];
        result.principal_point_y_px = c->layout.principal_point_px[1];
        write_struct(required(desc, "desc"), result, "desc");
    });
}

CLSP_API ClspStatus clspCaptureGetDots(ClspCapture capture, double *sigma_px, uint64_t capacity, double *positions_px,
                                       uint64_t *count) {
    return guarded("clspCaptureGetDots", [&] {
        const auto c = object(capture);
        if (capacity > 0 && !positions_px)
            throw Error(Status::kInvalidArgument, "positions_px is NULL although capacity is not 0");
        const std::optional<CaptureDots> &dots = c->layout.dots;
        const std::uint64_t there = dots ? dots->positions_px.size() : 0;
        if (capacity > 0)
            check_capacity(capacity, there, "dots");
        for (std::uint64_t i = 0; capacity > 0 && i < there; ++i)
            std::copy_n(dots->positions_px[i].data(), 2, positions_px + 2 * i);
        if (sigma_px)
            *sigma_px = dots ? dots->sigma_px : 0.0;
        if (count)
            *count = there;
    });
}

CLSP_API ClspStatus clspCaptureGetSequenceCount(ClspCapture capture, uint32_t *count) {
    return guarded("clspCaptureGetSequenceCount", [&] {
        const auto c = object(capture);
        required(count, "count") = static_cast<std::uint32_t>(c->layout.sequences.size());
    });
}

CLSP_API ClspStatus clspCaptureGetSequence(ClspCapture capture, uint32_t index, ClspCaptureSequenceInfo *info) {
    return guarded("clspCaptureGetSequence", [&] {
        const auto c = object(capture);
        const SequenceLayout &s = sequence_at(*c, index);
        ClspCaptureSequenceInfo result{};
        result.scene = static_cast<std::uint32_t>(s.scene);
        result.moving = s.moving ? 1 : 0;
        result.frame_count = s.frame_count;
        result.has_mask = s.mask.empty() ? 0 : 1;
        result.f_number = s.f_number;
        result.exposure_ms = s.exposure_ms.value_or(0.0);
        copy_text(result.name, s.name);
        write_struct(required(info, "info"), result, "info");
    });
}

CLSP_API ClspStatus clspCaptureGetCodes(ClspCapture capture, uint32_t index, uint64_t capacity, uint16_t *codes) {
    return guarded("clspCaptureGetCodes", [&] {
        const auto c = object(capture);
        sequence_at(*c, index);
        required(codes, "codes");
        const std::uint64_t pixels = c->layout.pixel_count(), frames = c->layout.sequences[index].frame_count;
        check_capacity(capacity, frames * pixels, "codes");
        std::vector<std::uint16_t> room;
        for (std::uint32_t frame = 0; frame < frames; ++frame)
            std::copy_n(frame_of(*c, index, frame, room), pixels, codes + frame * pixels);
    });
}

CLSP_API ClspStatus clspCaptureGetMask(ClspCapture capture, uint32_t index, uint64_t capacity, uint8_t *mask) {
    return guarded("clspCaptureGetMask", [&] {
        const auto c = object(capture);
        const SequenceLayout &s = sequence_at(*c, index);
        required(mask, "mask");
        check_capacity(capacity, c->layout.pixel_count(), "pixels");
        if (s.mask.empty())
            std::fill_n(mask, c->layout.pixel_count(), std::uint8_t{255});
        else
            std::copy(s.mask.begin(), s.mask.end(), mask);
    });
}

CLSP_API ClspStatus clspCaptureGetSummaryJson(ClspCapture capture, uint64_t capacity, char *text, uint64_t *length) {
    return guarded("clspCaptureGetSummaryJson", [&] {
        const auto c = object(capture);
        give_text(capture_summary_json(*c), capacity, text, length, "text");
    });
}

CLSP_API ClspStatus clspCaptureGetEmva1288Json(ClspCapture capture, uint64_t capacity, char *text, uint64_t *length) {
    return guarded("clspCaptureGetEmva1288Json", [&] {
        const auto c = object(capture);
        validate_capture(*c);
        give_text(emva_json(emva_of(*c)).text(1), capacity, text, length, "text");
    });
}

CLSP_API ClspStatus clspCaptureGetEmva1288Xml(ClspCapture capture, uint64_t capacity, char *text, uint64_t *length) {
    return guarded("clspCaptureGetEmva1288Xml", [&] {
        const auto c = object(capture);
        validate_capture(*c);
        give_text(emva_xml(emva_of(*c)), capacity, text, length, "text");
    });
}

} // extern "C"
