#include "report/picture_png.hpp"

#include "runtime/error.hpp"

#include <cstdlib>
#include <fmt/core.h>
#include <memory>
#include <new>
#include <spng.h>

namespace clsp {

std::vector<std::uint8_t> encode_png(const Picture &picture) {
    struct Free {
        void operator()(spng_ctx *context) const { spng_ctx_free(context); }
        void operator()(void *memory) const { std::free(memory); }
    };
    const std::unique_ptr<spng_ctx, Free> context(spng_ctx_new(SPNG_CTX_ENCODER));
    if (!context)
        throw std::bad_alloc();
    const auto check = [](int status) {
        if (status == SPNG_EMEM)
            throw std::bad_alloc();
        if (status != SPNG_OK)
            throw Error(Status::kInternal,
                        fmt::format("a picture of the report cannot be encoded as PNG: {}", spng_strerror(status)));
    };
    spng_ihdr header{};
    header.width = picture.width;
    header.height = picture.height;
    header.bit_depth = 8;
    header.color_type = picture.channels == 3 ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE;
    check(spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1));
    check(spng_set_ihdr(context.get(), &header));
    check(spng_encode_image(context.get(), picture.pixels.data(), picture.pixels.size(), SPNG_FMT_PNG,
                            SPNG_ENCODE_FINALIZE));
    std::size_t size = 0;
    int status = SPNG_OK;
    const std::unique_ptr<void, Free> buffer(spng_get_png_buffer(context.get(), &size, &status));
    check(status);
    const auto *bytes = static_cast<const std::uint8_t *>(buffer.get());
    return {bytes, bytes + size};
}

std::string base64(const std::vector<std::uint8_t> &bytes) {
    constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const auto byte = [&](std::size_t k) { return i + k < bytes.size() ? std::uint32_t{bytes[i + k]} : 0u; };
        const std::uint32_t word = byte(0) << 16 | byte(1) << 8 | byte(2);
        text += kDigits[word >> 18];
        text += kDigits[word >> 12 & 63u];
        text += i + 1 < bytes.size() ? kDigits[word >> 6 & 63u] : '=';
        text += i + 2 < bytes.size() ? kDigits[word & 63u] : '=';
    }
    return text;
}

} // namespace clsp
