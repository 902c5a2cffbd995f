#include "capture/sequence_files.hpp"

#include "capture/capture_validation.hpp"
#include "io/byte_order.hpp"
#include "io/codes.hpp"
#include "io/series.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <set>

namespace clsp {
namespace {

namespace fs = std::filesystem;

// What image_io says, as an error of the library. advice: what it cannot know, where the file is named and what is
// needed there.
template <typename Body> auto reading(Body &&body, const std::string &advice = {}) -> decltype(body()) {
    try {
        return body();
    } catch (const image_io::ReadError &error) {
        throw Error(Status::kIo, error.what() + advice);
    }
}

// file: what capture.json says for the folder.
std::vector<std::string> frames_of_folder(const std::string &folder, std::string file) {
    while (file.size() > 1 && file.back() == '/')
        file.pop_back();
    const std::string advised = fmt::format("\"file\": \"{}/", image_io::literal_pattern(file));
    std::vector<std::string> files;
    std::set<const image_io::Format *> kinds;
    std::error_code code;
    std::string others; // why another file is no frame
    for (const fs::directory_entry &entry : fs::directory_iterator(folder, code)) {
        const image_io::Format *kind = image_io::format_of_extension(entry.path().string());
        const std::string name = entry.path().filename().string();
        std::error_code ignored;
        if (name[0] == '.' || !entry.is_regular_file(ignored))
            continue;
        if (!kind || kind->codes != image_io::Codes::frames) {
            if (others.empty())
                if (const std::string why = image_io::why_no_frame(entry.path().string()); !why.empty())
                    others = fmt::format(". {} {}", name, why);
            continue;
        }
        kinds.insert(kind);
        files.push_back(entry.path().string());
    }
    if (code)
        throw Error(Status::kIo, fmt::format("{}: cannot be read: {}", folder, code.message()));
    if (files.empty())
        throw Error(Status::kIo,
                    fmt::format("{}: the folder holds no {} frames{}", folder, image_io::frame_formats("or"), others));
    if (kinds.size() > 1) {
        const auto found = [&](const image_io::Format &format) { return kinds.count(&format) > 0; };
        const auto &all = image_io::formats();
        throw Error(Status::kInvalidData,
                    fmt::format("{}: the folder holds both {} images; say which are the frames, for example "
                                "{}*{}\"",
                                folder, image_io::listed("and", found), advised,
                                std::find_if(all.begin(), all.end(), found)->extension()));
    }
    image_io::leave_previews_out(files);
    if (const std::string why = image_io::why_no_series(folder, files, advised, "\""); !why.empty())
        throw Error(Status::kInvalidData, why);
    return files;
}

// The folder's own name may hold what a pattern gives a meaning.
std::string escaped(const std::string &folder) {
    std::string result;
    for (const char c : folder) {
        if (c == '*' || c == '?' || c == '[' || c == ']' || c == '\\')
            result += '\\';
        result += c;
    }
    return result;
}

} // namespace

SequenceFiles::SequenceFiles(const std::string &folder, const std::string &file, const std::string &description,
                             const std::string &field, bool msb_aligned, const std::optional<image_io::RawLayout> &raw)
    : file_(file), name_((fs::path(folder) / file).lexically_normal().string()), msb_aligned_(msb_aligned) {
    request_.raw = raw;
    const std::string path = (fs::path(folder) / file).string();
    std::vector<std::string> files;
    std::error_code code;
    const auto is_folder = [&](const std::string &name) { return fs::is_directory(name, code); };
    image_io::ImageName several = image_io::split_name(path, is_folder); // with a channel, or a page, of all files
    if (is_folder(several.path)) {
        files = frames_of_folder(several.path, file.substr(0, file.size() - (path.size() - several.path.size())));
        single_ = false;
    } else if (fs::exists(path, code) || !image_io::split_name(path).channel.empty()) {
        files = {path};
    } else {
        const bool is_pattern = image_io::is_pattern(file);
        if (is_pattern) {
            several = image_io::split_several(escaped(folder) + "/" + file);
            files = image_io::matches_of(several.path);
        }
        image_io::leave_previews_out(files);
        if (files.empty())
            throw Error(Status::kIo,
                        fmt::format("{}: {} is \"{}\", but {} {}; correct the name, or take the sequence out",
                                    description, field, file, name_,
                                    is_pattern ? "matches no file" : "does not exist"));
        single_ = false;
    }
    std::sort(files.begin(), files.end(), image_io::natural_less);
    if (!single_)
        for (std::string &one : files)
            one = image_io::join_name({one, several.channel});
    const std::string advice =
        fmt::format(". {}: {} names it; expected there is an .npy stack of (frames, height, width), uint16, or gray "
                    "16-bit {} frames: replace the file (numpy.save(file, codes.astype(numpy.uint16)) writes "
                    "a stack), or take the sequence out",
                    description, field, image_io::frame_formats("or"));
    for (const std::string &one : files)
        parts_.push_back(reading([&] { return part_of(one); }, advice));
}

SequenceFiles::Part SequenceFiles::part_of(const std::string &path) const {
    Part part;
    part.path = path;
    part.info = image_io::open(path, request_)->info();
    std::error_code ignored; // it could be opened
    const std::string on_disk = image_io::split_name(path).path;
    part.size_bytes = fs::file_size(on_disk, ignored);
    part.changed = fs::last_write_time(on_disk, ignored);
    return part;
}

// Where a file says that 0 is white, more light is a lower number: the reader turns them. Some programs only set the
// word: codes that fit into the camera's bits as stored, but not turned, are taken as stored.
void SequenceFiles::settle_white(Part &part) const {
    if (!part.info.white_is_zero)
        return;
    const auto reader = reading([&] { return image_io::open(part.path, request_); });
    const auto top = static_cast<float>(part.info.full_scale), maximum = static_cast<float>((1u << bits_) - 1);
    float least = top, most = 0;
    reading([&] {
        reader->read_rows(0, [&](const float *row) {
            const auto [low, high] = std::minmax_element(row, row + part.info.width);
            least = std::min(least, *low);
            most = std::max(most, *high);
        });
    });
    if (msb_aligned_ || most <= maximum || top - least > maximum) {
        part.info.warnings.push_back(image_io::told_white(part.info));
        return;
    }
    part.turned_at = top;
    part.info.warnings.push_back(fmt::format(
        "its photometric interpretation says that 0 is white; then its codes would be above {}, the top code of {} "
        "bits: they are taken as stored. Save the frames as min-is-black",
        maximum, bits_));
}

std::uint64_t SequenceFiles::check(const CaptureLayout &layout) {
    width_ = layout.width;
    bits_ = layout.bits;
    std::uint64_t frames = 0;
    for (Part &part : parts_) {
        const image_io::Info &info = part.info;
        const auto refuse = [&](const std::string &what) {
            throw Error(Status::kInvalidData, fmt::format("{}: {}", part.path, what));
        };
        const bool stack = info.format->codes == image_io::Codes::stacks;
        if (stack && !single_)
            refuse(fmt::format("is an {0} array among the frames of a folder or pattern; expected {1} frames there, or "
                               "name the {0} stack itself",
                               info.format->extension(), image_io::frame_formats("or")));
        if (const std::string why = image_io::why_no_codes(info, file_); !why.empty())
            refuse(why);
        if (info.full_scale_given)
            refuse("codes of a capture are whole numbers without a scale; take full_scale out of \"file\"");
        if (info.sample == "uint8" && layout.bits != 8)
            refuse(fmt::format("has samples of type uint8; expected uint16 for codes of {} bits (8-bit files hold "
                               "8-bit codes only): if these are the converter's, set /camera/bits to 8",
                               layout.bits));
        if (info.width != layout.width || info.height != layout.height)
            refuse(fmt::format("has frames of {} x {} pixels (width x height); /camera says {} x {}{}", info.width,
                               info.height, layout.width, layout.height,
                               info.width == layout.height && info.height == layout.width
                                   ? "; the two sides are exchanged: an array is (frames, height, width)"
                               : info.warnings.empty()
                                   ? ": correct /camera/width and /camera/height, or name frames of that size"
                                   : ". But " + info.warnings.front()));
        settle_white(part);
        part.first_frame = frames;
        frames += info.frame_count;
        if (frames > kMaxCaptureFrames)
            throw Error(Status::kInvalidData,
                        fmt::format("{}: has more than {} frames; use fewer", name_, kMaxCaptureFrames));
    }
    return frames;
}

std::vector<FileOddity> SequenceFiles::oddities() const {
    std::vector<FileOddity> result;
    std::vector<std::string> all;
    for (const Part &part : parts_)
        all.push_back(part.path);
    if (const std::string missing = image_io::missing_numbers(all); !missing.empty())
        result.push_back({missing + "; the frames before and after are taken as neighbours in time", {name_}});
    if (const std::string order = image_io::counted_otherwise(all); !order.empty())
        result.push_back({order, {name_}});
    std::map<std::string, FileOddity> oddities; // by what is said of them
    for (const Part &part : parts_)
        for (const std::string &warning : part.info.warnings) {
            const bool swapped = warning == part.info.looks_swapped;
            // The codes of all sequences together tell it of arrays, with the same way out.
            if (swapped && part.info.format->codes == image_io::Codes::stacks)
                continue;
            FileOddity &one = oddities[warning];
            one.text = warning;
            one.files.push_back(part.path);
            if (swapped)
                one.kind = kSwappedBytes;
        }
    for (auto &[warning, one] : oddities)
        result.push_back(std::move(one));
    return result;
}

image_io::Reader &SequenceFiles::reader_of(std::size_t part) const {
    if (reader_ && open_part_ == part)
        return *reader_;
    reader_.reset();
    const Part &was = parts_[part];
    const Part is = reading([&] { return part_of(was.path); });
    if (is.size_bytes != was.size_bytes || is.changed != was.changed)
        throw Error(Status::kIo,
                    fmt::format("{}: changed after the capture was opened; open it again once its files are complete",
                                was.path));
    reader_ = reading([&] { return image_io::open(was.path, request_); });
    open_part_ = part;
    return *reader_;
}

namespace {

// Codes of a frame that do not fit into the camera's bits.
struct TooLarge {
    std::size_t count = 0;
    std::uint32_t x = 0, y = 0; // of the first one
    float code = 0, largest = 0;
    image_io::detail::WholeNumbers words{2}; // from the first one on
    std::uint32_t first_column = 0, last_column = 0, last_row = 0;

    void add(std::uint32_t column, std::uint32_t row, float number) {
        if (count++ == 0) {
            x = first_column = last_column = column;
            y = row;
            code = number;
        }
        first_column = std::min(first_column, column);
        last_column = std::max(last_column, column);
        last_row = row;
        largest = std::max(largest, number);
    }
    // Why the codes are too large, and what to do. info: of the file.
    std::string advice(std::uint32_t bits, const image_io::Info &info) const {
        std::string but;
        for (const std::string &warning : info.warnings)
            but += ". But " + warning;
        // In the other order they may fit.
        if (const unsigned other = words.bits_if_swapped(); other > 0)
            return !info.looks_swapped.empty() ? but.substr(2)
                                               : fmt::format("But its words {}. If so, save array.byteswap()",
                                                             image_io::detail::told_swapped(other));
        while (bits < kMaxCaptureBits && largest >= static_cast<float>(1u << bits))
            ++bits;
        if (const unsigned significant = info.significant_bits; significant > 0 && significant < 16)
            but = fmt::format(". The file says that {} bits of a word are the converter's", significant) + but;
        return fmt::format("Set bits to {} or more, or msb_aligned to true if the camera stores codes in the upper "
                           "bits{}",
                           bits, but);
    }
    std::string text(std::size_t pixels) const {
        return fmt::format(
            "{} of {} codes of the frame are above it, in rows {} to {} and columns {} to {}, the largest "
            "is {}",
            count, pixels, y, last_row, first_column, last_column, largest);
    }
};

} // namespace

void SequenceFiles::read(std::uint32_t frame, std::uint32_t first_row, std::uint32_t row_count,
                         std::uint16_t *to) const {
    struct Enough {}; // rows below are not asked for
    const std::lock_guard<std::mutex> lock(reading_);
    const auto next = std::upper_bound(parts_.begin(), parts_.end(), frame,
                                       [](std::uint64_t f, const Part &part) { return f < part.first_frame; });
    const Part &part = *std::prev(next);
    image_io::Reader &reader = reader_of(static_cast<std::size_t>(&part - parts_.data()));
    const std::uint32_t maximum = (1u << bits_) - 1;
    // Files that tell fewer bits have their codes in the lower ones.
    const bool shifted = msb_aligned_ && part.info.full_scale == 65535.0;
    const auto step = static_cast<float>(shifted ? 1u << (kMaxCaptureBits - bits_) : 1u);
    std::uint32_t y = 0;
    TooLarge too_large;
    const auto take = [&](const float *row) {
        // Where codes do not fit, the whole frame tells how many.
        if (y >= first_row + row_count && too_large.count == 0)
            throw Enough();
        if (y >= first_row && (y < first_row + row_count || too_large.count > 0))
            for (std::uint32_t x = 0; x < width_; ++x) {
                const float number = part.turned_at > 0 ? part.turned_at - row[x] : row[x];
                const float code = number / step;
                if (shifted) {
                    // Some cameras fill the lower bits of what clips.
                    if (code != std::floor(code) && number != 65535.0f)
                        throw Error(Status::kInvalidData,
                                    fmt::format("{}: frame {}{}, pixel ({}, {}): the word is {}, no multiple of {}, "
                                                "though /camera/msb_aligned says that codes of {} bits stand in the "
                                                "upper bits of 16. Take that out, or correct /camera/bits",
                                                part.path, frame, single_ ? "" : " of the sequence", x, y, number, step,
                                                bits_));
                    *to++ = static_cast<std::uint16_t>(code);
                    continue;
                }
                if (!(number <= static_cast<float>(maximum)))
                    too_large.add(x, y, number);
                if (too_large.count == 0)
                    *to++ = static_cast<std::uint16_t>(number);
                else
                    too_large.words.add(static_cast<std::uint16_t>(number));
            }
        ++y;
    };
    try {
        reading([&] { reader.read_rows(frame - part.first_frame, take); });
        if (too_large.count > 0) {
            throw Error(
                Status::kInvalidData,
                fmt::format("{}: frame {}{}, pixel ({}, {}): the code is {}, but /camera/bits is {}, so that {} "
                            "is the top code. {}. {}",
                            part.path, frame, single_ ? "" : " of the sequence", too_large.x, too_large.y,
                            too_large.code, bits_, maximum, too_large.text(std::size_t{width_} * y),
                            too_large.advice(bits_, part.info)));
        }
    } catch (const Enough &) {
        reader_.reset(); // it stopped within a frame
    } catch (...) {
        reader_.reset();
        throw;
    }
    if (frame + 1 == parts_.back().first_frame + parts_.back().info.frame_count)
        reader_.reset(); // a capture may have more sequences than a process open files
}

std::vector<std::uint8_t> read_mask(const std::string &path, const CaptureLayout &layout,
                                    const std::string &description, const std::string &field,
                                    std::vector<FileOddity> &oddities) {
    const std::string advice = fmt::format(
        ". {}: {} names it; expected there is one 8-bit gray image of {} x {} pixels (width x height), 0 where a pixel "
        "is not to count: replace it, or take \"mask\" out so that every pixel counts",
        description, field, layout.width, layout.height);
    const auto read = [&] {
        const auto reader = image_io::open(path);
        const image_io::Info &info = reader->info();
        if (info.frame_count != 1)
            throw Error(Status::kInvalidData,
                        fmt::format("{}: holds {} images, a mask is one: name it in \"mask\", for example \"{}\"{}",
                                    path, info.frame_count, image_io::page_name(fs::path(path).filename().string(), 0),
                                    advice));
        if (info.channels != 1 || (info.sample != "uint8" && info.sample != "bool"))
            throw Error(Status::kInvalidData,
                        fmt::format("{}: is one image of {} with {} channel{}; a mask is one 8-bit gray image{}", path,
                                    info.sample, info.channels, info.channels == 1 ? "" : "s", advice));
        if (info.width != layout.width || info.height != layout.height)
            throw Error(Status::kInvalidData, fmt::format("{}: the mask has {} x {} pixels; /camera says {} x {}{}{}",
                                                          path, info.width, info.height, layout.width, layout.height,
                                                          info.width == layout.height && info.height == layout.width
                                                              ? "; the two sides are exchanged"
                                                              : "",
                                                          advice));
        std::vector<std::uint8_t> mask;
        mask.reserve(layout.pixel_count());
        reader->read_rows(0, [&](const float *row) {
            for (std::uint32_t x = 0; x < layout.width; ++x)
                mask.push_back(static_cast<std::uint8_t>(row[x]));
        });
        return mask;
    };
    std::vector<std::uint8_t> mask = reading(read, advice);
    if (const std::string soft = image_io::told_soft({mask.begin(), mask.end()}); !soft.empty())
        oddities.push_back({soft, {path}, "mask"});
    return mask;
}

} // namespace clsp
