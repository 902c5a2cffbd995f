#include "io/transfer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace image_io {

namespace {

/** Numbers of an ICC profile, which are big-endian; 0 beyond its end. */
class Profile {
  public:
    Profile(const unsigned char *data, std::size_t size) : data_(data), size_(size) {}

    std::uint32_t u32(std::size_t at) const { return u16(at) << 16 | u16(at + 2); }
    std::uint32_t u16(std::size_t at) const {
        return at + 2 <= size_ ? static_cast<std::uint32_t>(data_[at] << 8 | data_[at + 1]) : 0;
    }
    double fixed(std::size_t at) const { return static_cast<std::int32_t>(u32(at)) / 65536.0; }
    bool is(std::size_t at, const char *name) const { return at + 4 <= size_ && !std::memcmp(data_ + at, name, 4); }
    /** Where a tag's data are; 0: it has none. */
    std::size_t tag(const char *name) const {
        const std::uint32_t count = std::min<std::uint32_t>(u32(128), 100);
        for (std::size_t i = 0; i < count; ++i)
            if (is(132 + 12 * i, name))
                return u32(136 + 12 * i);
        return 0;
    }
    bool holds(const std::string &text) const {
        std::string wide; // as version 4 stores it
        for (const char c : text)
            wide += {'\0', c};
        const unsigned char *end = data_ + size_;
        return std::search(data_, end, text.begin(), text.end()) != end ||
               std::search(data_, end, wide.begin(), wide.end()) != end;
    }

  private:
    const unsigned char *data_;
    std::size_t size_;
};

} // namespace

Transfer srgb(const std::string &said_by) {
    return {Transfer::Curve::srgb, 1, said_by};
}

Transfer power(double exponent, const std::string &said_by) {
    if (!(exponent > 0 && std::isfinite(exponent)))
        return {Transfer::Curve::unknown, 1, said_by};
    if (std::abs(exponent - 1) < 0.01) // chunks and profiles keep two to five digits
        return {Transfer::Curve::linear, 1, said_by};
    return {Transfer::Curve::power, exponent, said_by};
}

Transfer transfer_of_icc(const unsigned char *data, std::size_t size_bytes) {
    const std::string said_by = "its ICC profile";
    const Profile profile(data, size_bytes);
    const std::size_t gray = profile.tag("kTRC"), red = profile.tag("rTRC");
    const std::size_t at = gray ? gray : red;
    if (at && profile.is(at, "curv") && profile.u32(at + 8) == 0)
        return power(1, said_by);
    if (at && profile.is(at, "curv") && profile.u32(at + 8) == 1)
        return power(profile.u16(at + 12) / 256.0, said_by);
    if (at && profile.is(at, "para")) {
        const double exponent = profile.fixed(at + 12);
        if (profile.u16(at + 8) == 0)
            return power(exponent, said_by);
        // sRGB's: ((x + 0.055) / 1.055) ^ 2.4.
        if (std::abs(exponent - 2.4) < 0.01 && std::abs(profile.fixed(at + 16) - 1 / 1.055) < 0.01)
            return srgb(said_by);
    } else if (profile.holds("sRGB")) {
        return srgb(said_by);
    }
    return {Transfer::Curve::unknown, 1, said_by};
}

double Transfer::to_light(double value) const {
    const double sign = value < 0 ? -1 : 1, number = std::abs(value);
    if (curve == Curve::srgb)
        return sign * (number <= 0.04045 ? number / 12.92 : std::pow((number + 0.055) / 1.055, 2.4));
    return curve == Curve::power ? sign * std::pow(number, exponent) : value;
}

std::string Transfer::name() const {
    switch (curve) {
    case Curve::srgb:
        return "sRGB";
    case Curve::power:
        return fmt::format("the power {:.4g}", exponent);
    case Curve::unknown:
        return "a curve that is not known here";
    default:
        return "linear";
    }
}

} // namespace image_io
