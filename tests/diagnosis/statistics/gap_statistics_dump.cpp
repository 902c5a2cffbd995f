// Prints the statistics of a capture set as lines of sequence,stage,name,region,unit,value.
//   gap_statistics_dump FOLDER [--frames FIRST COUNT] [--calibration BLACK READ] [--threads N] [--time REPEATS]
//   [--device]
// Black level and read noise come from the dark sequence, or from the data sheet if there is none. --device: the
// device takes the sums over pixels.
#include "capture/capture_reader.hpp"
#include "runtime/error.hpp"
#include "statistics/device_sums.hpp"
#include "statistics/sequence_level.hpp"
#include "statistics/sequence_statistics.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

namespace {

struct Options {
    std::string folder;
    std::size_t first = 0, count = 0, repeats = 0;
    double black = NAN, read = NAN;
    unsigned threads = 1;
    bool on_device = false;
};

Options parse(const std::vector<std::string> &words) {
    Options options;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (words[i] == "--frames" && i + 2 < words.size()) {
            options.first = std::stoul(words[++i]);
            options.count = std::stoul(words[++i]);
        } else if (words[i] == "--calibration" && i + 2 < words.size()) {
            options.black = std::stod(words[++i]);
            options.read = std::stod(words[++i]);
        } else if (words[i] == "--threads" && i + 1 < words.size()) {
            options.threads = unsigned(std::stoul(words[++i]));
        } else if (words[i] == "--time" && i + 1 < words.size()) {
            options.repeats = std::stoul(words[++i]);
        } else if (words[i] == "--device") {
            options.on_device = true;
        } else {
            options.folder = words[i];
        }
    }
    return options;
}

int run(const Options &options) {
    const clsp::Capture capture = clsp::read_capture(options.folder);
    const clsp::CaptureLayout &layout = capture.layout;
    clsp::Calibration calibration{layout.black_level_dn, layout.read_noise_dn};
    const auto part = [&](std::size_t sequence) {
        const std::size_t all = layout.sequences[sequence].frame_count, first = std::min(options.first, all - 1);
        return std::array<std::size_t, 2>{first, options.count ? std::min(options.count, all - first) : all - first};
    };
    for (std::size_t s = 0; s < layout.sequences.size(); ++s)
        if (layout.sequences[s].scene == clsp::CaptureScene::kDark) {
            const auto [first, count] = part(s);
            const clsp::SequenceLevel level = clsp::sequence_level(
                layout, s, capture.codes[s].data() + first * layout.pixel_count(), std::uint32_t(count));
            calibration = {level.mean_dn,
                           std::sqrt(std::max(level.temporal_noise_dn * level.temporal_noise_dn - 1.0 / 12.0, 0.0))};
            break;
        }
    if (std::isfinite(options.black))
        calibration = {options.black, options.read};
    std::unique_ptr<clsp::statistics::DeviceSums> device;
    if (options.on_device)
        device = std::make_unique<clsp::statistics::DeviceSums>(clsp::Context::create({}));
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        const auto [first, count] = part(s);
        const clsp::SequenceStatistics statistics(layout, s, std::uint32_t(count));
        std::vector<double> values(statistics.list().size());
        const std::uint16_t *codes = capture.codes[s].data() + first * layout.pixel_count();
        statistics.compute(codes, calibration, values.data(), options.threads, device.get());
        for (std::size_t k = 0; k < values.size(); ++k) {
            const clsp::StatisticInfo &info = statistics.list()[k];
            std::printf("%s,%s,%s,%s,%s,%.12g\n", info.sequence.c_str(), info.stage.c_str(), info.name.c_str(),
                        info.region.c_str(), info.unit.c_str(), values[k]);
        }
        double best = 1e9;
        for (std::size_t k = 0; k < options.repeats; ++k) {
            const auto start = std::chrono::steady_clock::now();
            statistics.compute(codes, calibration, values.data(), options.threads, device.get());
            best = std::min(
                best, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
        }
        if (options.repeats)
            std::fprintf(stderr, "%-14s %4zu statistics %8.2f ms\n", layout.sequences[s].name.c_str(), values.size(),
                         best);
    }
    return 0;
}

} // namespace

int main(int argc, char **argv) {
    try {
        return run(parse({argv + 1, argv + argc}));
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
