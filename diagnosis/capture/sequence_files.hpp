// The files of one sequence: a stack, or frames, in formats that hold codes (io/formats.hpp).
#pragma once

#include "capture/stored_sequence.hpp"
#include "io/formats.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace clsp {

// What is odd about some files.
struct FileOddity {
    std::string text;
    std::vector<std::string> files;
    std::string kind = "files"; // of a warning
};

// Files of a sequence, found and looked at but not read yet, so that sizes can be checked before memory is taken.
class SequenceFiles final : public CodeFiles {
  public:
    // folder: of capture.json; file: what it says for the sequence, a path that stays in the folder. Throws kIo if
    // nothing is there. field: for messages. msb_aligned: codes stand in the upper bits of 16-bit words. raw: how raw
    // frames lie in the files.
    SequenceFiles(const std::string &folder, const std::string &file, const std::string &description,
                  const std::string &field, bool msb_aligned = false,
                  const std::optional<image_io::RawLayout> &raw = {});

    // What messages call it: the file itself, or the folder or pattern.
    const std::string &name() const { return name_; }
    // Checks size and type against the camera; throws kInvalidData naming the file. Gives the number of frames.
    std::uint64_t check(const CaptureLayout &layout);
    // After check(): what is odd about the files, for example bytes behind an array.
    std::vector<FileOddity> oddities() const;
    void read(std::uint32_t frame, std::uint32_t first_row, std::uint32_t row_count, std::uint16_t *to) const override;

  private:
    struct Part {
        std::string path;
        image_io::Info info;
        std::uintmax_t size_bytes = 0;
        std::filesystem::file_time_type changed;
        std::uint64_t first_frame = 0; // in the sequence
        float turned_at = 0;           // above 0: the code is this minus what the reader gives
    };
    void settle_white(Part &part) const;
    Part part_of(const std::string &path) const;
    image_io::Reader &reader_of(std::size_t part) const;

    std::string file_; // as capture.json has it
    std::string name_;
    bool msb_aligned_;
    image_io::ReadRequest request_;
    bool single_ = true; // one file that was named itself
    std::vector<Part> parts_;
    std::uint32_t width_ = 0, bits_ = 0; // of check()
    mutable std::mutex reading_;
    mutable std::unique_ptr<image_io::Reader> reader_; // of the part that was read last
    mutable std::size_t open_part_ = 0;
};

// height * width values of an 8-bit image; throws kIo or kInvalidData naming the file. description, field: where
// capture.json names it, for messages. oddities: what is odd about it is appended.
std::vector<std::uint8_t> read_mask(const std::string &path, const CaptureLayout &layout,
                                    const std::string &description, const std::string &field,
                                    std::vector<FileOddity> &oddities);

} // namespace clsp
