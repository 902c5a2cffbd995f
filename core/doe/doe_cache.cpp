#include "doe/doe_cache.hpp"

#include "runtime/hash.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <fmt/core.h>
#include <type_traits>

namespace clsp {
namespace {

// Changes whenever the same description gives another pattern, or the file another layout.
constexpr char kMagic[16] = "clsp-pattern-2\n";

static_assert(std::is_trivially_copyable_v<DoePowerBudget>, "the budget is stored as it is");

struct Header {
    char magic[16];
    char key[32];
    std::uint64_t texel_count, dot_count, hash;
    DoePowerBudget budget;
};

std::uint64_t content_hash(const DoePatternResult &result) {
    WideHash hash;
    hash.add(&result.budget, sizeof result.budget);
    hash.add(result.texels.data(), result.texels.size() * sizeof(float));
    hash.add(result.dot_shares.data(), result.dot_shares.size() * sizeof(double));
    return hash.digest()[0];
}

std::string name_of(const std::string &key) {
    return key + ".doe";
}

} // namespace

std::string doe_pattern_key(const DoeElement &element, const BeamProfile &beam, const std::string &device_name) {
    const DoePatternParameters &p = element.parameters;
    const DoeDefects &d = p.defects;
    WideHash hash;
    hash.add(kMagic, sizeof kMagic);
    hash.add(device_name.data(), device_name.size());
    for (const double value : {double(p.width),
                               double(p.height),
                               double(p.periodic),
                               p.pixel_pitch_m,
                               p.wavelength_m,
                               double(p.design_levels),
                               double(element.orders),
                               double(p.oversampling),
                               p.doe_width_m,
                               p.doe_height_m,
                               p.power_w,
                               double(p.image_width),
                               double(p.image_height),
                               p.half_extent_x,
                               p.half_extent_y,
                               double(p.pixel_envelope),
                               double(d.levels),
                               d.relative_depth_error,
                               d.rounding_sigma_m,
                               d.etch_noise_rms_m,
                               d.refractive_index,
                               d.dispersion_per_m,
                               double(element.samples)})
        hash.add(value);
    hash.add(&d.seed, sizeof d.seed);
    for (const SpectralLine &line : element.lines) {
        hash.add(line.wavelength_m);
        hash.add(line.share);
    }
    hash.add(element.dots.data(), element.dots.size() * sizeof element.dots[0]);
    hash.add(element.weights.data(), element.weights.size() * sizeof(double));
    const std::vector<double> profile = beam.content();
    hash.add(profile.data(), profile.size() * sizeof(double));
    hash.add(element.phase.data(), element.phase.size() * sizeof(float));
    const auto digest = hash.digest();
    return fmt::format("{:016x}{:016x}", digest[0], digest[1]);
}

std::shared_ptr<DoePatternResult> load_doe_pattern(const CacheFolder &folder, const std::string &key) {
    CacheFolder::File file = folder.open(name_of(key));
    Header header{};
    if (!file || !file.read(&header, sizeof header))
        return nullptr;
    const std::uint64_t texels = std::uint64_t{header.budget.image_width} * header.budget.image_height;
    constexpr std::uint64_t kMost = std::uint64_t{1} << 32;
    if (std::memcmp(header.magic, kMagic, sizeof kMagic) != 0 || key.size() != sizeof header.key ||
        std::memcmp(header.key, key.data(), sizeof header.key) != 0 || header.texel_count != texels || texels > kMost ||
        header.dot_count > kMost ||
        file.size() != sizeof header + texels * sizeof(float) + header.dot_count * sizeof(double))
        return nullptr;
    auto result = std::make_shared<DoePatternResult>();
    result->budget = header.budget;
    result->texels.resize(texels);
    result->dot_shares.resize(header.dot_count);
    if (!file.read(result->texels.data(), texels * sizeof(float)) ||
        !file.read(result->dot_shares.data(), header.dot_count * sizeof(double)) ||
        content_hash(*result) != header.hash)
        return nullptr;
    return result;
}

void store_doe_pattern(const CacheFolder &folder, const std::string &key, const DoePatternResult &result) {
    Header header{};
    std::memcpy(header.magic, kMagic, sizeof kMagic);
    std::memcpy(header.key, key.data(), sizeof header.key);
    header.texel_count = result.texels.size();
    header.dot_count = result.dot_shares.size();
    header.hash = content_hash(result);
    header.budget = result.budget;
    folder.write(name_of(key), [&](image_io::AtomicFile &file) {
        file.write(&header, sizeof header);
        file.write(result.texels.data(), result.texels.size() * sizeof(float));
        file.write(result.dot_shares.data(), result.dot_shares.size() * sizeof(double));
    });
}

} // namespace clsp
