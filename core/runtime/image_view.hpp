// A checked view of an image in a cl_mem.
#pragma once

#include "runtime/opencl.hpp"

#include <cstdint>
#include <initializer_list>
#include <string>

namespace clsp {

// The numbers are those of CLSP_FORMAT_*; capi asserts that they agree.
enum class Format : std::uint32_t {
    kNone = 0,
    kUint8 = 1,
    kUint16 = 2,
    kUint32 = 3,
    kFloat32 = 4,
    kFloat32x2 = 5,
    kFloat32x3 = 6,
    kFloat32x4 = 7,
};

std::uint32_t component_bytes(Format format);
std::uint32_t component_count(Format format);
std::string format_name(Format format);

// The largest image side anywhere in the library.
constexpr std::uint32_t kMaxImageSide = 16384;

// What the caller says about an image, unchecked; the same members as ClspImage.
struct ImageDescription {
    cl_mem mem = nullptr;
    std::uint64_t offset_bytes = 0;
    std::uint64_t pitch_bytes = 0;
    std::uint32_t width = 0, height = 0;
    Format format = Format::kNone;

    explicit operator bool() const { return mem != nullptr; }
};

// A view that has been checked, in the units that kernels take.
struct ImageView {
    cl_mem mem = nullptr;
    cl_ulong offset = 0; // in components
    cl_uint pitch = 0;   // in components
    std::uint32_t width = 0, height = 0;
    Format format = Format::kNone;
    // The bytes it covers, for overlap checks: in terms of the outermost buffer.
    cl_mem parent = nullptr;
    std::uint64_t first_byte = 0, end_byte = 0;

    explicit operator bool() const { return mem != nullptr; }
};

struct ImageSize {
    std::uint32_t width, height;
};

// Checks everything that can be checked of an image: context, size, format, alignment, pitch, room in the buffer.
// `name` is what messages call it. size {0, 0} takes any size.
ImageView check_image(const ImageDescription &image, const char *name, ::cl_context context, ImageSize size,
                      std::initializer_list<Format> formats);

// True if two views share a byte.
bool overlap(const ImageView &a, const ImageView &b);
// True if two views are the same pixels laid out the same way.
bool same_pixels(const ImageView &a, const ImageView &b);
// Throws kInvalidArgument if the kernel may not write to the image's buffer.
void check_writable(const ImageView &view, const char *name);
// Throws kOverlap if they overlap.
void refuse_overlap(const ImageView &output, const char *output_name, const ImageView &input, const char *input_name);

// Checks that `bytes` bytes from `offset` lie within the buffer and that it belongs to the context.
void check_buffer(cl_mem mem, const char *name, ::cl_context context, std::uint64_t offset, std::uint64_t bytes);

// Throws kInvalidArgument unless both sides are 1 to kMaxImageSide.
void check_image_size(std::uint32_t width, std::uint32_t height, const char *what);

} // namespace clsp
