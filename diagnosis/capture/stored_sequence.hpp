// Codes that stay in their files, as they would take too much memory, and codes wherever they are.
#pragma once

#include "capture/capture.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

class CodeFiles {
  public:
    virtual ~CodeFiles() = default;
    // Rows [first_row, first_row + row_count) of a frame. From any thread. Throws kIo for files that cannot be read or
    // are not as they were, kInvalidData for values that are no codes.
    virtual void read(std::uint32_t frame, std::uint32_t first_row, std::uint32_t row_count,
                      std::uint16_t *to) const = 0;
};

struct SequenceScan; // sequence_scan.hpp

struct StoredSequence {
    std::unique_ptr<const CodeFiles> files;
    std::shared_ptr<const SequenceScan> scan; // of all codes, which were valid
};

// Rows of a frame; valid until `room`, where they are read to, is changed.
const std::uint16_t *rows_of(const Capture &capture, std::size_t sequence, std::uint32_t frame, std::uint32_t first_row,
                             std::uint32_t row_count, std::vector<std::uint16_t> &room);
// A whole frame.
const std::uint16_t *frame_of(const Capture &capture, std::size_t sequence, std::uint32_t frame,
                              std::vector<std::uint16_t> &room);

} // namespace clsp
