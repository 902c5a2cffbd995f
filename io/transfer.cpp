#include "io/transfer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
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
        return has(at, 2) ? static_cast<std::uint32_t>(data_[at] << 8 | data_[at + 1]) : 0;
    }
    bool has(std::size_t at, std::size_t bytes) const { return at <= size_ && bytes <= size_ - at; }
    double fixed(std::size_t at) const { return static_cast<std::int32_t>(u32(at)) / 65536.0; }
    bool is(std::size_t at, const char *name) const { return has(at, 4) && !std::memcmp(data_ + at, name, 4); }
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

/** Whether a table is a known curve's, as files keep those, too. */
bool is_of(const Transfer &known, const std::vector<float> &entries) {
    for (std::size_t i = 0; i < entries.size(); ++i)
        if (std::abs(entries[i] - known.to_light(static_cast<double>(i) / static_cast<double>(entries.size() - 1))) >
            0.002)
            return false;
    return true;
}

/** A tone curve, "curv" or "para". */
Transfer tone_curve(const Profile &profile, std::size_t at, const std::string &said_by) {
    if (profile.is(at, "curv")) {
        const std::uint32_t count = profile.u32(at + 8);
        if (count == 0)
            return power(1, said_by);
        if (count == 1)
            return power(profile.u16(at + 12) / 256.0, said_by);
        if (count > 65536 || !profile.has(at + 12, std::size_t{2} * count))
            return unknown_transfer(said_by, "a tone curve that is cut short");
        std::vector<float> entries(count);
        for (std::uint32_t i = 0; i < count; ++i)
            entries[i] = static_cast<float>(profile.u16(at + 12 + 2 * i)) / 65535.0f;
        return transfer_of_table(std::move(entries), said_by);
    }
    constexpr std::size_t counts[] = {1, 3, 4, 5, 7};
    const std::uint32_t type = profile.u16(at + 8);
    if (!profile.is(at, "para") || type > 4 || !profile.has(at + 12, 4 * counts[std::min(type, 4u)]))
        return unknown_transfer(said_by, "a tone curve of a kind that is not known here");
    double p[7] = {};
    for (std::size_t i = 0; i < counts[type]; ++i)
        p[i] = profile.fixed(at + 12 + 4 * i);
    if (type == 0)
        return power(p[0], said_by);
    if (std::abs(p[0] - 2.4) < 0.01 && std::abs(p[1] - 1 / 1.055) < 0.01)
        return srgb(said_by);
    Transfer transfer;
    transfer.curve = Transfer::Curve::parametric;
    transfer.said_by = said_by;
    // The shorter types in the words of the longest, (a x + b)^g + e from d on, and c x + f below.
    const double start = p[1] != 0 ? -p[2] / p[1] : 0;
    if (type == 1)
        transfer.parameters = {p[0], p[1], p[2], 0, start, 0, 0};
    else if (type == 2)
        transfer.parameters = {p[0], p[1], p[2], 0, start, p[3], p[3]};
    else
        transfer.parameters = {p[0], p[1], p[2], p[3], p[4], p[5], p[6]};
    return transfer;
}

/** SMPTE ST 2084: of 10000 cd/m^2. */
double pq_to_light(double number) {
    constexpr double m1 = 2610.0 / 16384, m2 = 2523.0 / 32, c1 = 3424.0 / 4096, c2 = 2413.0 / 128, c3 = 2392.0 / 128;
    const double root = std::pow(number, 1 / m2);
    return std::pow(std::max(0.0, root - c1) / (c2 - c3 * root), 1 / m1);
}

/** ARIB STD-B67: the light of the scene. */
double hlg_to_light(double number) {
    constexpr double a = 0.17883277, b = 1 - 4 * a;
    const double c = 0.5 - a * std::log(4 * a);
    return number <= 0.5 ? number * number / 3 : (std::exp((number - c) / a) + b) / 12;
}

} // namespace

Transfer srgb(const std::string &said_by) {
    Transfer transfer;
    transfer.curve = Transfer::Curve::srgb;
    transfer.said_by = said_by;
    return transfer;
}

Transfer power(double exponent, const std::string &said_by) {
    if (!(exponent > 0 && std::isfinite(exponent)))
        return unknown_transfer(said_by, fmt::format("the power {}", exponent));
    Transfer transfer;
    transfer.said_by = said_by;
    if (std::abs(exponent - 1) < 0.01) // chunks and profiles keep two to five digits
        return transfer;
    transfer.curve = Transfer::Curve::power;
    transfer.exponent = exponent;
    return transfer;
}

Transfer unknown_transfer(const std::string &said_by, const std::string &because) {
    Transfer transfer;
    transfer.curve = Transfer::Curve::unknown;
    transfer.said_by = said_by;
    transfer.unknown_because = because;
    return transfer;
}

Transfer transfer_of_table(std::vector<float> entries, const std::string &said_by) {
    if (entries.size() > 16 && is_of(srgb(said_by), entries))
        return srgb(said_by);
    Transfer transfer;
    transfer.said_by = said_by;
    if (is_of(transfer, entries))
        return transfer;
    transfer.curve = Transfer::Curve::table;
    transfer.entries = std::move(entries);
    return transfer;
}

Transfer transfer_of_icc(const unsigned char *data, std::size_t size_bytes) {
    const std::string said_by = "its ICC profile";
    const Profile profile(data, size_bytes);
    if (const std::size_t gray = profile.tag("kTRC"))
        return tone_curve(profile, gray, said_by);
    const std::size_t red = profile.tag("rTRC"), green = profile.tag("gTRC"), blue = profile.tag("bTRC");
    if (red) {
        Transfer transfer = tone_curve(profile, red, said_by);
        for (const std::size_t other : {green, blue})
            if (other && other != red && !transfer.is_like(tone_curve(profile, other, said_by)))
                return unknown_transfer(said_by, "other curves for red, green and blue");
        return transfer;
    }
    return profile.holds("sRGB") ? srgb(said_by) : unknown_transfer(said_by, "no tone curve that is known here");
}

Transfer transfer_of_cicp(unsigned characteristics, bool full_range, const std::string &said_by) {
    if (!full_range)
        return unknown_transfer(said_by, "a narrow range, with black and white within the codes");
    Transfer transfer;
    transfer.said_by = said_by;
    switch (characteristics) {
    case 1:
    case 6:
    case 14:
    case 15:
        transfer.curve = Transfer::Curve::bt709;
        return transfer;
    case 4:
        return power(2.2, said_by);
    case 5:
        return power(2.8, said_by);
    case 8:
        return transfer;
    case 13:
        return srgb(said_by);
    case 16:
        transfer.curve = Transfer::Curve::pq;
        return transfer;
    case 18:
        transfer.curve = Transfer::Curve::hlg;
        return transfer;
    default:
        return unknown_transfer(
            said_by, fmt::format("the transfer characteristics {}, which are not known here", characteristics));
    }
}

Transfer transfer_of_color_space(const std::string &name, const std::string &said_by) {
    std::string word;
    for (const char c : name)
        if (std::isalnum(static_cast<unsigned char>(c)))
            word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const auto has = [&](const char *part) { return word.find(part) != std::string::npos; };
    if (has("lin"))
        return {};
    if (has("srgb"))
        return srgb(said_by);
    if (word.size() > 3 && word[0] == 'g' && std::isdigit(static_cast<unsigned char>(word[1])) &&
        std::isdigit(static_cast<unsigned char>(word[2])))
        return power((word[1] - '0') + 0.1 * (word[2] - '0'), said_by);
    for (const char *encoded : {"acescc", "log", "pq", "hlg", "rec709", "rec1886", "display", "gamma"})
        if (has(encoded))
            return unknown_transfer(said_by, fmt::format("the color space \"{}\", which is not known here", name));
    return {};
}

bool Transfer::is_like(const Transfer &other) const {
    return curve == other.curve && exponent == other.exponent && parameters == other.parameters &&
           entries == other.entries;
}

double Transfer::to_light(double value) const {
    const double sign = value < 0 ? -1 : 1, number = std::abs(value);
    switch (curve) {
    case Curve::srgb:
        return sign * (number <= 0.04045 ? number / 12.92 : std::pow((number + 0.055) / 1.055, 2.4));
    case Curve::power:
        return sign * std::pow(number, exponent);
    case Curve::bt709:
        return sign * (number < 0.081 ? number / 4.5 : std::pow((number + 0.099) / 1.099, 1 / 0.45));
    case Curve::pq:
        return sign * pq_to_light(number);
    case Curve::hlg:
        return sign * hlg_to_light(number);
    case Curve::parametric: {
        const auto &[g, a, b, c, d, e, f] = parameters;
        return sign * (number >= d ? std::pow(std::max(0.0, a * number + b), g) + e : c * number + f);
    }
    case Curve::table: {
        const double place = std::min(number, 1.0) * static_cast<double>(entries.size() - 1);
        const auto low = std::min(static_cast<std::size_t>(place), entries.size() - 2);
        const double part = place - static_cast<double>(low);
        return sign * ((1 - part) * entries[low] + part * entries[low + 1]);
    }
    default:
        return value;
    }
}

std::string Transfer::name() const {
    switch (curve) {
    case Curve::srgb:
        return "sRGB";
    case Curve::power:
        return fmt::format("the power {:.4g}", exponent);
    case Curve::bt709:
        return "BT.709";
    case Curve::pq:
        return "PQ, of 10000 cd/m^2";
    case Curve::hlg:
        return "HLG";
    case Curve::parametric:
        return fmt::format("a curve with the power {:.4g}", parameters[0]);
    case Curve::table:
        return fmt::format("a table of {} numbers", entries.size());
    case Curve::unknown:
        return unknown_because;
    default:
        return "linear";
    }
}

} // namespace image_io
