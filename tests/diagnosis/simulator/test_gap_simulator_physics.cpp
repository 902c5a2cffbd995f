// What the simulated codes are, against closed forms of the capture-set format's equations (sections 1 and 3).
//
// Power of the statistical tests: a moving board of 64 x 48 pixels at D = 0.551 has about 0.9 independent speckles for
// every 1 / (pi D^2 / 4) pixels, 660 a frame, 26000 in 40 frames: contrast is good to about 1 %, means of the intensity
// to 0.6 %. Bounds are five standard deviations or more; seeds are fixed.
#include "diagnosis/simulator/gap_simulator_support.hpp"

#include "stages/philox.hpp"

#include <algorithm>
#include <complex>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numeric>

namespace clsp::gap_simulator_test {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::uint32_t kFrames = 40;

class Physics : public GapSimulator {
  protected:
    Simulator simulator{context, small_layout()};
    const std::uint32_t width = simulator.layout().width, height = simulator.layout().height;
    const std::size_t pixels = simulator.layout().pixel_count();

    Codes many(std::size_t sequence, const std::vector<EffectSetting> &effects, const SimulationLevels &levels = kQuiet,
               std::uint32_t frames = kFrames) {
        return draw(simulator, sequence, effects, levels, 5, frames);
    }
    // Contrast of the speckle: the quantization's 1/12 taken out.
    double contrast(const std::vector<EffectSetting> &effects, std::size_t sequence = kBoardMoving) {
        const Codes codes = many(sequence, effects);
        return std::sqrt(variance(codes) - 1.0 / 12.0) / (mean(codes) - 64.0);
    }
    // Mean of a pixel over the frames.
    std::vector<double> mean_image(const Codes &codes) const {
        std::vector<double> image(pixels, 0.0);
        for (std::size_t i = 0; i < codes.size(); ++i)
            image[i % pixels] += codes[i] * double(pixels) / double(codes.size());
        return image;
    }
    // Normalized covariance of neighbours (dx, dy) apart; the frame is periodic, as the transform is.
    double correlation(const Codes &codes, std::uint32_t dx, std::uint32_t dy) const {
        const double m = mean(codes);
        double sum = 0.0;
        for (std::size_t i = 0; i < codes.size(); ++i) {
            const std::size_t frame = i / pixels, y = i % pixels / width, x = i % width;
            const std::size_t j = frame * pixels + (y + dy) % height * width + (x + dx) % width;
            sum += (codes[i] - m) * (codes[j] - m);
        }
        return sum / double(codes.size()) / variance(codes);
    }
    // |mu|^2, mu the field's correlation behind a ring-shaped pupil, on the frequencies of the grid.
    double speckle_correlation(double diameter, double obstruction, double dx, double dy) const {
        std::complex<double> sum = 0.0;
        double count = 0.0;
        for (int ky = -int(height) / 2; ky < int(height) / 2; ++ky)
            for (int kx = -int(width) / 2; kx < int(width) / 2; ++kx) {
                const double fx = double(kx) / width, fy = double(ky) / height,
                             rho = std::hypot(fx, fy) / (0.5 * diameter);
                if (rho >= 1.0 || (obstruction > 0.0 && rho <= obstruction))
                    continue;
                sum += std::polar(1.0, 2.0 * kPi * (fx * dx + fy * dy));
                count += 1.0;
            }
        return std::norm(sum / count);
    }
    // sum |h|^4 / (sum |h|^2)^2 of the amplitude point spread h: one over the number of surface samples that make a
    // point of the image.
    double inverse_sample_count(double diameter) const {
        double fourth = 0.0, second = 0.0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const double power = speckle_correlation(
                    diameter, 0.0, x, y); // h is the pupil's transform, as the field's correlation is
                second += power;
                fourth += power * power;
            }
        return fourth / (second * second);
    }
    static constexpr double kDiameter = 2.9 / (0.94 * 5.6);
};

// Random123's kat_vectors of philox4x32 with 10 rounds.
TEST(HostBlock, KnownAnswers) {
    using Block = std::array<std::uint32_t, 4>;
    EXPECT_EQ(host_block(0, {0, 0, 0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
    EXPECT_EQ(host_block(~std::uint64_t{0}, {~0u, ~0u, ~0u, ~0u}),
              (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
    EXPECT_EQ(host_block(0x299f31d0a4093822u, {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}),
              (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

// Work memory of the lens is shared out anew where its parts change but its size does not: a second polarization's
// intensity takes as much as the samples that pixels integrate.
TEST_F(Physics, ALensThatWasAnotherBefore) {
    for (const auto &[first, second] :
         {std::pair<EffectSetting, EffectSetting>{{"depolarization", {0.5}}, {"pixel_integration", {1.0}}},
          {{"pixel_integration", {1.0}}, {"depolarization", {0.5}}}}) {
        Simulator changed(context, small_layout()), fresh(context, small_layout());
        draw(changed, kBoardMoving, {first}, kQuiet, 5, 2);
        EXPECT_EQ(draw(changed, kBoardMoving, {second}, kQuiet, 5, 2),
                  draw(fresh, kBoardMoving, {second}, kQuiet, 5, 2))
            << second.id;
    }
}

TEST_F(Physics, TheBaseline) {
    const Codes dark = many(kDark, {}, kLevels), flat = many(kFlat, {}, kLevels);
    EXPECT_NEAR(mean(dark), 64.0, 0.1);
    EXPECT_NEAR(variance(dark), 16.0 + 1.0 / 12.0, 0.4);
    EXPECT_NEAR(mean(flat), 164.0, 0.1);
    EXPECT_NEAR(variance(flat), 16.0 + 1.0 / 12.0, 0.4);
    const Codes board = many(kBoardMoving, {});
    EXPECT_NEAR(mean(board), 164.0, 3.0);
    EXPECT_NEAR(contrast({}), 1.0, 0.05);
    for (const auto &[dx, dy] : {std::pair{1u, 0u}, {0u, 1u}, {1u, 1u}, {2u, 0u}, {3u, 0u}})
        EXPECT_NEAR(correlation(board, dx, dy), speckle_correlation(kDiameter, 0.0, dx, dy), 0.03) << dx << ", " << dy;
    EXPECT_NEAR(simulator.mean_intensity(kBoardMoving, {}, 5, kFrames) * 100.0 + 64.0, mean(board), 0.2);
    EXPECT_NEAR(simulator.mean_intensity(kDotsMoving, {}, 5, kFrames) * 100.0 + 64.0, mean(many(kDotsMoving, {})), 0.2);
    EXPECT_NEAR(simulator.mean_intensity(kFlat, {}, 5, kFrames), 1.0, 1e-6);
    EXPECT_EQ(simulator.mean_intensity(kDark, {}, 5, kFrames), 0.0);
    // Dots: 2 pi sigma^2 each.
    EXPECT_NEAR(simulator.mean_intensity(kDotsMoving, {}, 5, kFrames), 12.0 * 2.0 * kPi * 2.2 * 2.2 / double(pixels),
                0.006);
}

TEST_F(Physics, ASequenceHasItsOwnFNumber) {
    CaptureLayout layout = small_layout();
    layout.sequences[kBoardMoving].f_number = 8.0;
    Simulator other(context, layout);
    const Codes codes = draw(other, kBoardMoving, {}, kQuiet, 5, kFrames);
    EXPECT_NEAR(mean(codes), 164.0, 4.0);
    EXPECT_NEAR(correlation(codes, 2, 0), speckle_correlation(2.9 / (0.94 * 8.0), 0.0, 2, 0), 0.04);
}

// The image is sampled at points, whatever the aperture: the law of intensities is exponential, and the correlation is
// Airy's disk. Neighbours are nearly independent, so a share of 4 % scatters by less than 0.001 in ten frames.
TEST_F(Physics, APupilWiderThanTheFrequencyPlane) {
    for (const double f_number : {2.96, 2.8, 2.0, 1.4}) {
        SCOPED_TRACE(f_number);
        CaptureLayout layout = small_layout();
        layout.f_number = f_number;
        const double diameter = 2.9 / (0.94 * f_number);
        Simulator other(context, layout);
        const Codes codes = draw(other, kBoardMoving, {}, kQuiet, 5, 10);
        EXPECT_NEAR(mean(codes), 164.0, 2.0);
        EXPECT_NEAR(std::sqrt(variance(codes)) / (mean(codes) - 64.0), 1.0, 0.03);
        const auto dark = std::count_if(codes.begin(), codes.end(), [](std::uint16_t code) { return code < 69; });
        EXPECT_NEAR(double(dark) / double(codes.size()), 1.0 - std::exp(-0.045), 0.006);
        for (const int lag : {1, 2}) {
            const double x = kPi * diameter * lag;
            EXPECT_NEAR(correlation(codes, lag, 0), std::pow(2.0 * std::cyl_bessel_j(1.0, x) / x, 2), 0.02) << lag;
        }
    }
}

TEST_F(Physics, TheBaselineMayBePartlyPolarizedAndOfUnitPhasors) {
    CaptureLayout layout = small_layout();
    layout.degree_of_polarization = 0.5;
    Simulator half(context, layout);
    const Codes codes = draw(half, kBoardMoving, {}, kQuiet, 5, kFrames);
    EXPECT_NEAR(std::sqrt(variance(codes)) / (mean(codes) - 64.0), std::sqrt(0.5 * (1.0 + 0.25)), 0.04);
    layout = small_layout();
    layout.field = FieldKind::kUnitPhasor;
    Simulator phasor(context, layout);
    const Codes of_phasors = draw(phasor, kBoardMoving, {}, kQuiet, 5, kFrames);
    // |z| = 1: <|V|^4> = 2 - sum |h|^4 with sum |h|^2 = 1.
    EXPECT_NEAR(std::sqrt(variance(of_phasors)) / (mean(of_phasors) - 64.0),
                std::sqrt(1.0 - inverse_sample_count(kDiameter)), 0.03);
}

TEST_F(Physics, Laser) {
    // Lines: contrast^2 = sum w_k w_l c_kl, c_kl the mean squared coherence of two lines: e + (1 - e) / N, e = exp(-(k
    // - l)^2 s^2), as N samples of the surface with their own heights make a point of the image.
    const double per_count = inverse_sample_count(kDiameter);
    const auto square_of_lines = [&](double s) {
        double sum = 0.0, total = 0.0;
        std::vector<std::array<double, 2>> lines;
        for (const double k : {-2.0, -1.0, 0.0, 1.0, 2.0}) {
            lines.push_back({k, std::exp(-0.5 * k * k)});
            total += lines.back()[1];
        }
        for (const auto &a : lines)
            for (const auto &b : lines)
                sum += a[1] * b[1] / (total * total) *
                       (per_count + (1.0 - per_count) * std::exp(-(a[0] - b[0]) * (a[0] - b[0]) * s * s));
        return sum;
    };
    EXPECT_NEAR(contrast({{"linewidth", {1.2}}}), std::sqrt(square_of_lines(1.2)), 0.03);
    // In an exposure over L correlation lengths both averages multiply, however few lines and patterns are drawn: the
    // squared contrast is good to 2 % here (26000 speckles times the patterns and lines), the bound is five times that.
    for (const double s : {0.5, 1.2, 3.0})
        for (const double lags : {0.0, 0.4, 2.5, 12.0}) {
            const double x = 2.0 * lags, moved = lags > 0.0 ? 2.0 * (std::exp(-x) - 1.0 + x) / (x * x) : 1.0;
            const double seen = contrast({{"linewidth", {s}}, {"motion_decorrelation", {lags}}});
            EXPECT_NEAR(seen * seen / (square_of_lines(s) * moved), 1.0, 0.1) << s << ' ' << lags;
        }

    // Flicker: the factor of each frame, on a static board.
    const Codes still = many(kBoardStatic, {}, kQuiet, 6),
                flickers = many(kBoardStatic, {{"power_flicker", {0.1}}}, kQuiet, 6);
    double mean_factor = 0.0;
    for (std::uint32_t frame = 0; frame < 6; ++frame) {
        const double factor =
            1.0 + 0.1 * host_normals(5, (std::uint64_t{kBoardStatic} << 32) | frame, kStreamFlicker)[0];
        mean_factor += factor / 6.0;
        for (std::size_t i = frame * pixels; i < (frame + 1) * pixels; ++i)
            if (still[i] < 900 && flickers[i] < 900) {
                ASSERT_NEAR(flickers[i] - 64.0, factor * (still[i] - 64.0), 1.1);
            }
    }
    EXPECT_NEAR(simulator.mean_intensity(kBoardStatic, {{"power_flicker", {0.1}}}, 5, 6),
                mean_factor * simulator.mean_intensity(kBoardStatic, {}, 5, 6), 1e-4);
    // Light from elsewhere does not flicker.
    EXPECT_EQ(many(kFlat, {{"power_flicker", {0.1}}}, kQuiet, 6), many(kFlat, {}, kQuiet, 6));
}

TEST_F(Physics, SurfaceAndMotion) {
    EXPECT_NEAR(contrast({{"depolarization", {0.0}}}), std::sqrt(0.5), 0.03);
    EXPECT_NEAR(contrast({{"depolarization", {0.7}}}), std::sqrt(0.5 * 1.49), 0.04);

    // <I> = (1 - c) + c a^2, a = 1 / (rms of the pupil) the pupil's amplitude at frequency 0.
    double inside = 0.0;
    for (int ky = -int(height) / 2; ky < int(height) / 2; ++ky)
        for (int kx = -int(width) / 2; kx < int(width) / 2; ++kx)
            inside += std::hypot(double(kx) / width, double(ky) / height) < 0.5 * kDiameter ? 1.0 : 0.0;
    const double a2 = double(pixels) / inside;
    EXPECT_NEAR(simulator.mean_intensity(kBoardMoving, {{"low_roughness", {0.3}}}, 5, kFrames), 0.7 + 0.3 * a2, 0.03);

    // An exposure over L correlation lengths: C^2 = 2 / L^2 int_0^L (L - l) exp(-2 l) dl.
    const double lags = 2.5, x = 2.0 * lags;
    EXPECT_NEAR(contrast({{"motion_decorrelation", {lags}}}), std::sqrt(2.0 * (std::exp(-x) - 1.0 + x) / (x * x)),
                0.03);

    // A part c of the light keeps its phase all the while and beats with what changes, whose correlation exp(-l) falls
    // off half as fast as its square: variance (1 - c)^2 C^2 + 2 c a^2 (1 - c) K, K = 2 / L^2 int_0^L (L - l) exp(-l)
    // dl.
    const double c = 0.3, steady = c * a2, k = 2.0 * (std::exp(-lags) - 1.0 + lags) / (lags * lags);
    const double moved = 2.0 * (std::exp(-x) - 1.0 + x) / (x * x);
    EXPECT_NEAR(contrast({{"low_roughness", {c}}, {"motion_decorrelation", {lags}}}),
                std::sqrt((1.0 - c) * (1.0 - c) * moved + 2.0 * steady * (1.0 - c) * k) / (1.0 - c + steady), 0.02);

    // Boiling: the intensity's correlation from frame to frame is exp(-2 / tau).
    const Codes boils = many(kBoardStatic, {{"surface_boiling", {6.0}}}, kQuiet, 200);
    std::vector<double> image = mean_image(boils);
    double covariance = 0.0, power = 0.0;
    for (std::size_t i = 0; i + pixels < boils.size(); ++i) {
        covariance += (boils[i] - 164.0) * (boils[i + pixels] - 164.0);
        power += (boils[i] - 164.0) * (boils[i] - 164.0);
    }
    EXPECT_NEAR(covariance / power, std::exp(-2.0 / 6.0), 0.04);

    // Still scenes keep their mean over air and vibration, and change from frame to frame.
    for (const EffectSetting &effect : {EffectSetting{"airflow", {0.8, 6.0}}, EffectSetting{"vibration", {0.3}}}) {
        const Codes codes = many(kBoardStatic, {effect}, kQuiet, 10);
        EXPECT_NEAR(mean(codes), mean(many(kBoardStatic, {}, kQuiet, 10)), 5.0) << effect.id;
        EXPECT_FALSE(std::equal(codes.begin(), codes.begin() + pixels, codes.begin() + pixels)) << effect.id;
    }

    // Spread light stays in the picture, but for what leaves it at the border.
    const double sharp = simulator.mean_intensity(kDotsMoving, {}, 5, kFrames);
    EXPECT_NEAR(simulator.mean_intensity(kDotsMoving, {{"subsurface_scattering", {2.0, 0.6}}}, 5, kFrames), sharp,
                0.06 * sharp);
}

// What was measured is all light, of which ambient light has its part everywhere and in every frame.
TEST_F(GapSimulator, LampAndAmbientLightTogetherAreAsUnevenAsFramesWere) {
    CaptureLayout layout = small_layout();
    SequenceLayout &flat = layout.sequences[kFlat];
    flat.illumination = {{31.5, 23.5}, 31.5, {0.2, 0.0}, 130.0};
    flat.frame_light = {1.1f, 0.9f};
    flat.frame_light_level_dn = 130.0;
    Simulator simulator(context, layout);
    for (const double ambient : {0.0, 30.0}) {
        // 130 DN in all, whatever part of it is ambient.
        const std::vector<EffectSetting> effects =
            ambient > 0.0 ? std::vector<EffectSetting>{{"ambient_light", {ambient}}} : std::vector<EffectSetting>{};
        const double lamp = 130.0 - ambient;
        const Codes codes = draw(simulator, kFlat, effects, {lamp, 64.0, 0.0}, 5, 2);
        for (std::uint32_t t = 0; t < 2; ++t)
            for (std::uint32_t x = 0; x < layout.width; ++x) {
                const double uneven = 1.0 + 0.2 * (x - 31.5) / 31.5 * 130.0 / lamp,
                             drift = 1.0 + (t == 0 ? 0.1 : -0.1) * 130.0 / lamp;
                ASSERT_NEAR(codes[t * layout.pixel_count() + x], 64.0 + lamp * uneven * drift + ambient, 0.51);
            }
        EXPECT_NEAR(simulator.mean_intensity(kFlat, effects, 5, 2), 1.0, 1e-6);
    }
}

TEST_F(Physics, Optics) {
    // A pupil's phase leaves the grain, its size and shape do not.
    EXPECT_NEAR(correlation(many(kBoardMoving, {{"defocus", {1.5}}}), 2, 0), speckle_correlation(kDiameter, 0.0, 2, 0),
                0.03);
    EXPECT_NEAR(correlation(many(kBoardMoving, {{"aperture_mismatch", {1.45}}}), 2, 0),
                speckle_correlation(kDiameter / 1.45, 0.0, 2, 0), 0.04);
    EXPECT_NEAR(correlation(many(kBoardMoving, {{"pupil_obstruction", {0.6}}}), 2, 0),
                speckle_correlation(kDiameter, 0.6, 2, 0), 0.03);
    for (const char *id : {"defocus", "aperture_mismatch", "pupil_obstruction"})
        EXPECT_NEAR(simulator.mean_intensity(kBoardMoving, {{id, {}}}, 5, kFrames), 1.0, 0.04) << id;
    // Defocus widens dots: less light at their centres.
    const auto at_centre = [&](const std::vector<EffectSetting> &effects) {
        return mean_image(many(kDotsMoving, effects))[std::size_t{24} * width + 24];
    };
    EXPECT_LT(at_centre({{"defocus", {1.5}}}) - 64.0, 0.75 * (at_centre({}) - 64.0));

    // Fall-off and ambient light on flat: (1 + level / g) (1 - a r^2), r = 1 in the corner.
    const Codes codes = many(kFlat, {{"vignetting", {0.4}}, {"ambient_light", {30.0}}}, kQuiet, 1);
    const double corner2 = 31.5 * 31.5 + 23.5 * 23.5;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const double r2 = ((x - 31.5) * (x - 31.5) + (y - 23.5) * (y - 23.5)) / corner2;
            ASSERT_NEAR(codes[std::size_t{y} * width + x], 64.0 + 130.0 * (1.0 - 0.4 * r2), 0.51);
        }
    // Ambient light alone: the level, whatever the gain, and not in the mean of what the gain multiplies.
    for (const double gain : {20.0, 200.0}) {
        const Codes lit = many(kBoardMoving, {{"ambient_light", {30.0}}}, {gain, 64.0, 0.0}, 1),
                    unlit = many(kBoardMoving, {}, {gain, 64.0, 0.0}, 1);
        for (std::size_t i = 0; i < lit.size(); ++i)
            ASSERT_NEAR(lit[i], std::min(unlit[i] + 30, 1023), 1.0);
    }
    EXPECT_EQ(simulator.mean_intensity(kBoardMoving, {{"ambient_light", {30.0}}}, 5, 2),
              simulator.mean_intensity(kBoardMoving, {}, 5, 2));
    EXPECT_EQ(mean(many(kDark, {{"ambient_light", {30.0}}}, kQuiet, 1)), 64.0);

    // Glare keeps the mean of a board, and lifts the light between dots.
    EXPECT_NEAR(simulator.mean_intensity(kBoardMoving, {{"glare", {0.2, 6.0}}}, 5, 4),
                simulator.mean_intensity(kBoardMoving, {}, 5, 4), 0.02);
    const auto between = [&](const std::vector<EffectSetting> &effects) {
        const std::vector<double> image = mean_image(many(kDotsMoving, effects));
        return image[std::size_t{16} * width + 16] - 64.0; // amid four dots
    };
    EXPECT_GT(between({{"glare", {0.2, 6.0}}}), between({}) + 0.5);

    // Distortion and wavelength move dots outwards: x -> x (1 + k1 r^2), x -> x (1 + delta / lambda).
    const auto centroid = [&](const std::vector<EffectSetting> &effects, double near_x, double near_y) {
        const std::vector<double> image = mean_image(many(kDotsMoving, effects, {60.0, 64.0, 0.0}));
        double sum = 0.0, sum_x = 0.0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                if (std::abs(x - near_x) < 7.0 && std::abs(y - near_y) < 7.0) {
                    const double light = image[std::size_t{y} * width + x] - 64.0;
                    sum += light;
                    sum_x += light * x;
                }
        return sum_x / sum;
    };
    // The dot at (8.3, 8.6) is 23.2 px left of the axis, r = 0.699 of the corner; sub-pixel centroids of 40 looks are
    // good to 0.15 px, and the same looks are compared.
    const double plain = centroid({}, 8.3, 8.6);
    EXPECT_NEAR(plain, 8.3, 0.6);
    const double r2 = (23.2 * 23.2 + 14.9 * 14.9) / corner2;
    EXPECT_NEAR(centroid({{"lens_distortion", {0.05}}}, 8.3, 8.6) - plain, -23.2 * 0.05 * r2, 0.2);
    EXPECT_NEAR(centroid({{"wavelength_shift", {12.0}}}, 8.3, 8.6) - plain, -23.2 * 12.0 / 940.0, 0.1);
}

TEST_F(Physics, Dots) {
    const double plain = simulator.mean_intensity(kDotsMoving, {}, 5, kFrames);
    const auto relative = [&](const EffectSetting &effect) {
        return simulator.mean_intensity(kDotsMoving, {effect}, 5, kFrames) / plain;
    };
    // One more dot of the relative intensity; twelve copies; a share that is only spread.
    EXPECT_NEAR(relative({"zero_order", {6.0}}), 1.0 + 6.0 / 12.0, 0.15);
    EXPECT_NEAR(relative({"ghost_dots", {0.25}}), 1.2, 0.08); // some of the copies lie beyond the border
    EXPECT_NEAR(relative({"scatter_background", {0.25}}), 1.0, 0.08);
    EXPECT_NEAR(relative({"beam_skew", {0.5}}), 1.0, 0.08);
    // The area of exp(-(r^2)^3 / 2): pi 2^(1/3) Gamma(4/3) sigma^2 of 2 pi sigma^2.
    EXPECT_NEAR(relative({"beam_flat_top", {1.0}}), std::cbrt(2.0) * std::tgamma(4.0 / 3.0) / 2.0, 0.05);
}

TEST_F(Physics, Sensor) {
    // Crosstalk: neighbours share light. Of white differences: variance and covariance of the kernel (1 - f, f/4) on
    // the speckle.
    const Codes shared = many(kBoardMoving, {{"crosstalk", {0.25}}});
    EXPECT_GT(correlation(shared, 1, 0), speckle_correlation(kDiameter, 0.0, 1, 0) + 0.05);
    EXPECT_NEAR(mean(shared), mean(many(kBoardMoving, {})), 0.6);
    // Shot noise: variance = dn_per_electron * signal.
    EXPECT_NEAR(variance(many(kFlat, {{"shot_noise", {0.5}}}, kLevels)), 16.0 + 1.0 / 12.0 + 0.5 * 100.0, 1.0);
    EXPECT_NEAR(mean(many(kFlat, {{"shot_noise", {0.5}}}, kLevels)), 164.0, 0.15);

    const auto fixed = [&](std::size_t sequence, const EffectSetting &effect) {
        const Codes codes = many(sequence, {effect}, {100.0, 400.0, 0.0}, 2);
        EXPECT_TRUE(std::equal(codes.begin(), codes.begin() + pixels, codes.begin() + pixels)) << effect.id;
        return std::sqrt(variance(codes) - 1.0 / 12.0);
    };
    // 3072 pixels: standard deviations are good to 1.3 %; 64 columns: to 9 %.
    EXPECT_NEAR(fixed(kFlat, {"prnu", {0.1}}), 10.0, 0.7);
    EXPECT_NEAR(fixed(kDark, {"dsnu", {5.0}}), 5.0, 0.35);
    EXPECT_NEAR(fixed(kDark, {"column_fpn", {20.0}}), 20.0, 9.0);
    // Hot pixels: 31 of them expected, exponential of mean 150.
    const Codes hot = many(kDark, {{"hot_pixels", {0.01, 150.0}}}, kQuiet, 1);
    const auto count = std::count_if(hot.begin(), hot.end(), [](std::uint16_t code) { return code > 64; });
    EXPECT_GT(count, 8);
    EXPECT_LT(count, 60);
    EXPECT_NEAR((mean(hot) - 64.0) * double(pixels) / double(count), 150.0, 130.0);

    // Rows: the same along a row, new in each frame and row.
    const Codes rows = many(kDark, {{"row_noise", {4.0}}}, {0.0, 400.0, 0.0}, kFrames);
    for (std::size_t i = 0; i < rows.size(); ++i)
        ASSERT_EQ(rows[i], rows[i / width * width]);
    EXPECT_NEAR(std::sqrt(variance(rows) - 1.0 / 12.0), 4.0, 0.35); // 1920 rows: 1.6 %

    const Codes gamma = many(kFlat, {{"gamma", {0.75}}}, kQuiet, 1);
    EXPECT_NEAR(gamma[0], 64.0 + 1023.0 * std::pow(100.0 / 1023.0, 0.75), 0.51);
    EXPECT_EQ(many(kFlat, {{"full_well", {380.0}}}, {700.0, 64.0, 0.0}, 1), Codes(pixels, 444));
    for (const std::uint16_t code : many(kBoardMoving, {{"adc_bits", {6.0}}}, kLevels, 1))
        ASSERT_EQ(code % 16, 0);
    const Codes bayer = many(kFlat, {{"bayer_mismatch", {0.06}}}, kQuiet, 1);
    for (std::size_t i = 0; i < pixels; ++i) {
        const std::size_t x = i % width % 2, y = i / width % 2;
        ASSERT_EQ(bayer[i], x == y ? 164 : x == 1 ? 158 : 170);
    }
    const Codes other = many(kFlat, {{"bayer_mismatch", {0.06, 1.0}}}, kQuiet, 1);
    for (std::size_t i = 0; i < pixels; ++i) {
        const std::size_t x = i % width % 2, y = i / width % 2;
        ASSERT_EQ(other[i], x != y ? 164 : x == 0 ? 158 : 170);
    }

    // Lag: S_t = f S_(t-1) + (1 - f) v_t, beginning anew with each sequence.
    const Codes v = many(kBoardMoving, {}, {60.0, 64.0, 0.0}, 5),
                lags = many(kBoardMoving, {{"image_lag", {0.15}}}, {60.0, 64.0, 0.0}, 5);
    EXPECT_EQ(lags, many(kBoardMoving, {{"image_lag", {0.15}}}, {60.0, 64.0, 0.0}, 5));
    for (std::size_t i = 0; i < pixels; ++i) {
        double state = v[i];
        for (std::size_t frame = 0; frame < 5; ++frame) {
            state = frame == 0 ? state : 0.15 * state + 0.85 * v[frame * pixels + i];
            if (state < 1000.0) {
                ASSERT_NEAR(lags[frame * pixels + i], state, 1.5);
            }
        }
    }

    // Pixels that integrate see less contrast: the mean of |mu|^2 over two points of a pixel.
    double expected = 0.0;
    constexpr int kPoints = 8;
    for (int i = -kPoints + 1; i < kPoints; ++i)
        for (int j = -kPoints + 1; j < kPoints; ++j)
            expected += double(kPoints - std::abs(i)) * (kPoints - std::abs(j)) *
                        speckle_correlation(kDiameter, 0.0, double(i) / kPoints, double(j) / kPoints);
    expected /= double(kPoints) * kPoints * kPoints * kPoints;
    EXPECT_NEAR(contrast({{"pixel_integration", {1.0}}}), std::sqrt(expected), 0.03);
}

// A baseline capture of an independent generator: 24 frames of 128 x 160, f/8, black level 64.22 and read noise 4.26 DN
// (its key).
std::vector<std::uint16_t> practice_codes(const std::filesystem::path &file) {
    std::ifstream in(file, std::ios::binary);
    std::string magic(10, '\0');
    in.read(magic.data(), 10);
    const std::size_t header = static_cast<unsigned char>(magic[8]) + 256u * static_cast<unsigned char>(magic[9]);
    in.ignore(static_cast<std::streamsize>(header));
    std::vector<std::uint16_t> codes(std::size_t{24} * 128 * 160);
    in.read(reinterpret_cast<char *>(codes.data()), static_cast<std::streamsize>(codes.size() * 2));
    return in ? codes : std::vector<std::uint16_t>{};
}

TEST_F(Physics, ABaselineCaptureOfAnotherGenerator) {
    const char *const data = std::getenv("CLSPECKLE_TEST_DATA");
    const std::filesystem::path folder = std::filesystem::path(data != nullptr ? data : "none") / "practice" / "p01";
    if (!std::filesystem::is_directory(folder))
        GTEST_SKIP() << "CLSPECKLE_TEST_DATA names no folder with practice sets";
    CaptureLayout layout = small_layout();
    layout.width = 160;
    layout.height = 128;
    layout.f_number = 8.0;
    layout.principal_point_px = {79.5, 63.5};
    layout.sequences.resize(4); // dark, flat, board_static, board_moving
    Simulator camera(context, layout);
    const SimulationLevels levels{130.3042, 64.2184, 4.2582};
    for (const std::size_t s : {kDark, kFlat, kBoardMoving}) {
        SimulationLevels at = levels;
        const Codes real = practice_codes(folder / (std::string(kNames[s]) + ".npy"));
        ASSERT_EQ(real.size(), std::size_t{24} * 128 * 160);
        at.gain_dn = s == kDark ? 0.0 : mean(real) - levels.black_level_dn; // the light's level is a nuisance
        const Codes ours = draw(camera, s, {}, at, 5, 24);
        // Half a million pixels: noise variance to 0.2 % each. Speckle: 10000 grains, mean to 1 %, variance to 3 %
        // each.
        if (s == kBoardMoving) {
            EXPECT_NEAR(mean(ours), mean(real), 0.05 * (mean(real) - 64.0));
            EXPECT_NEAR(std::sqrt(variance(ours)) / (mean(ours) - 64.2),
                        std::sqrt(variance(real)) / (mean(real) - 64.2), 0.04);
        } else {
            EXPECT_NEAR(mean(ours), mean(real), 0.05);
            EXPECT_NEAR(variance(ours), variance(real), 0.25);
        }
    }
}

} // namespace
} // namespace clsp::gap_simulator_test
