#include "capture/stored_sequence.hpp"

namespace clsp {

const std::uint16_t *rows_of(const Capture &capture, std::size_t sequence, std::uint32_t frame, std::uint32_t first_row,
                             std::uint32_t row_count, std::vector<std::uint16_t> &room) {
    const std::size_t width = capture.layout.width;
    if (!capture.is_stored(sequence))
        return capture.codes[sequence].data() + (std::size_t{frame} * capture.layout.height + first_row) * width;
    room.resize(row_count * width);
    capture.stored[sequence]->files->read(frame, first_row, row_count, room.data());
    return room.data();
}

const std::uint16_t *frame_of(const Capture &capture, std::size_t sequence, std::uint32_t frame,
                              std::vector<std::uint16_t> &room) {
    return rows_of(capture, sequence, frame, 0, capture.layout.height, room);
}

} // namespace clsp
