// Which engines a context's apertures try: the environment variable CLSPECKLE_FFT, tuning records, the device's
// default. Both variables are read as they were when the context was made, records once.
#pragma once

#include "fft/engine_spec.hpp"
#include "fft/plan/tuning_record.hpp"
#include "runtime/context.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

// What CLSPECKLE_FFT forces; none: "auto". Throws kInvalidArgument for other words.
std::optional<EngineKind> forced_engine(const Context &context);

// The device as tuning records know it, and where the user's record lies: CLSPECKLE_TUNING, else tuning.json in the
// cache folder; "" if records are off or there is no such folder.
TunedDevice tuned_device(const Context &context);
const std::string &tuning_path(const Context &context);

// The engines that an aperture with that grid is to try, best first: what CLSPECKLE_FFT forces, else by the user's
// record, by a shipped one, by default; the last is clFFT, which takes every grid.
std::vector<EngineChoice> engine_choices(const Context &context, std::uint32_t width, std::uint32_t height);

} // namespace clsp
