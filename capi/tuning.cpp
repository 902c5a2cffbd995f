#include "clspeckle/tuning.h"

#include "fft/engine_choices.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "progress.hpp"
#include "stages/field_grid.hpp"
#include "status.hpp"
#include "structs.hpp"
#include "texts.hpp"
#include "tuning/tuning.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_HANDLE(ClspTuning, const Tuning, "tuning", kAnyThread)

} // namespace clsp::capi

namespace {

static_assert(kMostTunedSizes == CLSP_MAX_TUNING_SIZES && kMostTunedFrames == CLSP_MAX_TUNING_FRAMES,
              "the engine's limits are those of tuning.h");

constexpr auto kTuningFields = [](auto field, auto &d, auto &p) {
    field(d.frames, p.frames);
    field(d.relative_diameter, p.relative_diameter);
    field(d.keep, p.keep, "desc->keep");
};

ClspTuningDesc tuning_defaults() {
    return to_c<ClspTuningDesc>(kTuningFields, TuneParameters());
}

TuneParameters tuning_parameters(const ClspTuningDesc *user) {
    const ClspTuningDesc d = user ? read_struct(user, tuning_defaults(), "desc") : tuning_defaults();
    auto p = from_c<TuneParameters>(kTuningFields, d);
    if (d.path && !*d.path)
        throw Error(Status::kInvalidArgument, "desc->path is empty; name a file, or give NULL for the default one");
    if (d.path && !p.keep)
        throw Error(Status::kInvalidArgument, "desc->path names a file, but desc->keep is 0: nothing would be written");
    p.path = d.path ? d.path : "";
    if ((d.size_count == 0) != (d.sizes == nullptr))
        throw Error(Status::kInvalidArgument,
                    fmt::format("desc->size_count is {} but desc->sizes is {}; give both or neither", d.size_count,
                                d.sizes ? "not NULL" : "NULL"));
    if (d.size_count > kMostTunedSizes)
        throw Error(Status::kInvalidArgument,
                    fmt::format("desc->size_count is {}, at most {} are taken", d.size_count, kMostTunedSizes));
    for (std::uint32_t i = 0; i < d.size_count; ++i)
        p.sizes.push_back({d.sizes[i].width, d.sizes[i].height});
    p.progress = progress_function(d.progress, d.progress_data);
    return p;
}

} // namespace

extern "C" {

CLSP_INIT(TuningDesc, desc, tuning_defaults())

CLSP_API ClspStatus clspTuningRun(ClspContext context, const ClspTuningDesc *desc, ClspTuning *tuning) {
    return guarded("clspTuningRun", [&] {
        const auto c = object(context);
        required(tuning, "tuning");
        give(tuning, std::make_shared<const Tuning>(tune(c, tuning_parameters(desc))));
    });
}

CLSP_REFERENCES(Tuning)

CLSP_API ClspStatus clspTuningGetJson(ClspTuning tuning, uint64_t capacity, char *text, uint64_t *length) {
    return guarded("clspTuningGetJson", [&] {
        const auto t = object(tuning);
        give_text(tuning_json({{t->measured}}), capacity, text, length, "text");
    });
}

CLSP_API ClspStatus clspTuningGetPath(ClspTuning tuning, uint64_t capacity, char *path, uint64_t *length) {
    return guarded("clspTuningGetPath", [&] { give_text(object(tuning)->path, capacity, path, length, "path"); });
}

CLSP_API ClspStatus clspTuningExplain(ClspContext context, uint32_t width, uint32_t height, uint64_t capacity,
                                      char *text, uint64_t *length) {
    return guarded("clspTuningExplain", [&] {
        const auto c = object(context);
        const FieldGrid grid = make_field_grid(width, height, 1, 0);
        const EngineChoice choice = engine_choices(*c, grid.grid_width, grid.grid_height).front();
        give_text(fmt::format("{}: {}", describe(choice.spec), choice.source), capacity, text, length, "text");
    });
}

CLSP_API ClspStatus clspTuningGetRecordPath(ClspContext context, uint64_t capacity, char *path, uint64_t *length) {
    return guarded("clspTuningGetRecordPath",
                   [&] { give_text(tuning_path(*object(context)), capacity, path, length, "path"); });
}

} // extern "C"
