#include "capture/capture_reader.hpp"

#include "capture/capture_json.hpp"
#include "capture/capture_validation.hpp"
#include "capture/sequence_files.hpp"
#include "capture/sequence_scan.hpp"
#include "capture/stored_sequence.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>

namespace clsp {

namespace fs = std::filesystem;

namespace {

// What is odd about files of several sequences is told once.
class Oddities {
  public:
    void add(const std::string &sequence, const FileOddity &oddity) {
        const auto same = std::find_if(all_.begin(), all_.end(), [&](const One &one) {
            return one.oddity.kind == oddity.kind && one.oddity.text == oddity.text;
        });
        if (same == all_.end()) {
            all_.push_back({sequence, oddity});
            return;
        }
        if (same->sequence != sequence)
            same->sequence.clear(); // of more than one
        for (const std::string &file : oddity.files)
            if (std::find(same->oddity.files.begin(), same->oddity.files.end(), file) == same->oddity.files.end())
                same->oddity.files.push_back(file);
    }
    std::vector<CaptureWarning> warnings() const {
        std::vector<CaptureWarning> result;
        for (const One &one : all_) {
            const std::size_t more = one.oddity.files.size() - 1;
            const std::string others =
                more == 0 ? "" : fmt::format(" and {} more{}", more, one.sequence.empty() ? "" : " of the sequence");
            result.push_back({one.sequence, fmt::format("{}{}: {}", one.oddity.files.front(), others, one.oddity.text),
                              one.oddity.kind});
        }
        return result;
    }

  private:
    struct One {
        std::string sequence;
        FileOddity oddity;
    };
    std::vector<One> all_;
};

} // namespace

Capture read_capture(const std::string &folder, const CaptureProgress &progress, std::uint64_t most_bytes_in_memory) {
    if (folder.empty())
        throw Error(Status::kInvalidArgument, "the path of the capture set is empty; name its folder");
    std::error_code code;
    fs::path root = folder;
    fs::path description = root / "capture.json";
    if (fs::is_regular_file(root, code) && root.extension() == ".json") {
        description = root;
        root = root.parent_path().empty() ? fs::path(".") : root.parent_path();
    } else if (!fs::is_directory(root, code)) {
        throw Error(Status::kIo, fmt::format("{}: {}; expected the folder of a capture set, with a capture.json",
                                             folder, fs::exists(root, code) ? "is not a folder" : "does not exist"));
    } else if (!fs::exists(description, code)) {
        throw Error(
            Status::kIo,
            fmt::format("{0}: the folder holds no capture.json, which describes a capture set; `clspeckle capture "
                        "init {0}` writes a first one from frames",
                        folder));
    }

    CaptureDescription described = read_capture_json(description.string());
    CaptureOrigin origin{description.string(), {}};
    // Sizes first: nothing is read before all of it is known to fit.
    std::vector<std::unique_ptr<SequenceFiles>> files;
    Capture capture;
    capture.name = fs::absolute(root, code).lexically_normal().filename().string();
    if (capture.name.empty()) // a slash at the end
        capture.name = fs::absolute(root, code).lexically_normal().parent_path().filename().string();
    capture.layout = std::move(described.layout);
    capture.warnings = std::move(described.warnings);
    std::uint64_t total = 0;
    Oddities oddities;
    {
        // What the files are checked against must itself be in order.
        CaptureLayout camera = capture.layout;
        for (SequenceLayout &sequence : camera.sequences)
            sequence.frame_count = 1;
        validate_layout(camera, origin);
    }
    for (std::size_t i = 0; i < described.files.size(); ++i) {
        files.push_back(std::make_unique<SequenceFiles>(root.string(), described.files[i], origin.description,
                                                        fmt::format("/sequences/{}/file", i), described.msb_aligned,
                                                        described.raws[i]));
        const std::uint64_t frames = files.back()->check(capture.layout);
        capture.layout.sequences[i].frame_count = static_cast<std::uint32_t>(frames);
        origin.files.push_back(files.back()->name());
        for (const FileOddity &oddity : files.back()->oddities())
            oddities.add(capture.layout.sequences[i].name, oddity);
        total += frames;
        if (!described.masks[i].empty()) {
            std::vector<FileOddity> of_mask;
            capture.layout.sequences[i].mask =
                read_mask((root / described.masks[i]).string(), capture.layout, origin.description,
                          fmt::format("/sequences/{}/mask", i), of_mask);
            for (const FileOddity &oddity : of_mask)
                oddities.add(capture.layout.sequences[i].name, oddity);
        }
    }
    for (CaptureWarning &warning : oddities.warnings())
        capture.warnings.push_back(std::move(warning));
    validate_layout(capture.layout, origin);

    const std::uint64_t bytes = total * capture.layout.pixel_count() * sizeof(std::uint16_t);
    double done = 0.0; // frames
    for (std::size_t i = 0; i < files.size(); ++i) {
        const std::uint32_t frames = capture.layout.sequences[i].frame_count;
        const auto tell = [&](double part) {
            if (progress)
                progress((done + part * frames) / double(total));
        };
        if (bytes > most_bytes_in_memory) {
            const auto stored = std::make_shared<StoredSequence>();
            stored->files = std::move(files[i]);
            capture.codes.emplace_back();
            capture.stored.push_back(stored);
            stored->scan = std::make_shared<const SequenceScan>(scan_sequence(capture, i, tell));
        } else {
            const std::size_t pixels = capture.layout.pixel_count();
            std::vector<std::uint16_t> codes(frames * pixels);
            for (std::uint32_t frame = 0; frame < frames; ++frame) {
                files[i]->read(frame, 0, capture.layout.height, codes.data() + frame * pixels);
                tell((frame + 1.0) / frames);
            }
            capture.codes.push_back(std::move(codes));
        }
        done += frames;
    }
    return capture;
}

} // namespace clsp
