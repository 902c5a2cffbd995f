// Evidence, downstream errors and the pieces of the HTML report, against small cases whose answer is known.
#include "diagnosis/report/sample_reports.hpp"
#include "measure/downstream.hpp"
#include "measure/evidence.hpp"
#include "measure/evidence_statistics.hpp"
#include "report/explanations.hpp"
#include "report/figures.hpp"
#include "report/html_page.hpp"
#include "report/picture_png.hpp"
#include "report/report_html.hpp"
#include "report/report_json.hpp"
#include "report/report_script.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>
#include <spng.h>

using namespace clsp;

namespace {

std::shared_ptr<Context> context() {
    static const std::shared_ptr<Context> instance = Context::create({});
    return instance;
}

// A layout with one sequence of 64 x 48 pixels.
CaptureLayout one_sequence(CaptureScene scene, std::uint32_t frames) {
    CaptureLayout layout = sample::layout({{"only", scene, true, frames}});
    layout.width = 64;
    layout.height = 48;
    return layout;
}

evidence::Frames frames_of(const CaptureLayout &layout, const std::vector<std::uint16_t> &codes) {
    return {&layout, &layout.sequences[0], layout.sequences[0].frame_count, codes.data()};
}

} // namespace

TEST(Measures, WhiteNoiseHasAFlatSpectrumOfItsVariance) {
    // 32 frames of 64 x 48 normal codes with a standard deviation of 20 DN. A band averages over at least 32 * 6
    // independent powers: a standard error of at most 7 %; 24 bands stay within 25 % with a probability above 99.9 %.
    const CaptureLayout layout = one_sequence(CaptureScene::kFlat, 32);
    std::mt19937 random(1);
    std::normal_distribution<double> normal(500.0, 20.0);
    std::vector<std::uint16_t> codes(32 * layout.pixel_count());
    for (auto &code : codes)
        code = static_cast<std::uint16_t>(std::lround(normal(random)));
    const auto frames = frames_of(layout, codes);
    const evidence::Plane mean = evidence::mean_image(frames);
    for (const Fluctuation kind : {Fluctuation::kOverTime, Fluctuation::kInFrame}) {
        const std::vector<double> power = evidence::radial_power(frames, mean, kind, evidence::band_count(layout));
        ASSERT_EQ(power.size(), 24u);
        for (std::size_t k = 1; k < power.size();
             ++k) // the window mixes the lowest band with the mean that was taken off
            EXPECT_NEAR(power[k] / 400.0, 1.0, 0.25) << "band " << k;
    }
    const std::vector<double> correlation = evidence::temporal_autocorrelation(frames);
    ASSERT_EQ(correlation.size(), 32u);
    EXPECT_NEAR(correlation[0], 1.0, 1e-12);
    // One pair's correlation has a standard error of 1 / sqrt(3072) = 0.018.
    for (std::size_t lag = 1; lag < correlation.size(); ++lag)
        EXPECT_LT(std::abs(correlation[lag]), 0.1) << lag;
    const evidence::Plane deviation = evidence::temporal_deviation(frames, mean);
    double square = 0.0;
    for (const float value : deviation)
        square += double(value) * double(value) / double(deviation.size());
    EXPECT_NEAR(square, 400.0, 8.0); // standard error: 400 sqrt(2 / (31 * 3072)) = 1.8
}

TEST(Measures, ASineIsFoundAtItsFrequency) {
    const CaptureLayout layout = one_sequence(CaptureScene::kBoard, 1);
    std::vector<std::uint16_t> codes(layout.pixel_count());
    for (std::size_t i = 0; i < codes.size(); ++i)
        codes[i] = static_cast<std::uint16_t>(
            std::lround(500.0 + 100.0 * std::sin(2.0 * std::acos(-1.0) * 0.25 * double(i % 64))));
    const auto frames = frames_of(layout, codes);
    const std::vector<double> power = evidence::radial_power(frames, evidence::mean_image(frames),
                                                             Fluctuation::kInFrame, evidence::band_count(layout));
    const std::size_t peak = std::size_t(std::max_element(power.begin(), power.end()) - power.begin());
    EXPECT_NEAR(0.5 * (double(peak) + 0.5) / double(power.size()), 0.25, 0.5 / double(power.size()));
}

TEST(Measures, HistogramCountsEveryUnmaskedPixelOnce) {
    CaptureLayout layout = one_sequence(CaptureScene::kFlat, 2);
    std::vector<std::uint16_t> codes(2 * layout.pixel_count());
    for (std::size_t i = 0; i < codes.size(); ++i)
        codes[i] = static_cast<std::uint16_t>(100 + i % 700);
    layout.sequences[0].mask.assign(layout.pixel_count(), 1);
    for (std::size_t i = 0; i < 64; ++i)
        layout.sequences[0].mask[i] = 0;
    for (std::size_t i = 0; i < 64; ++i)
        codes[i] = 5; // masked
    const auto frames = frames_of(layout, codes);
    const evidence::HistogramRange range = evidence::histogram_range({frames, frames});
    EXPECT_LE(range.bins, kHistogramBins);
    EXPECT_GT(range.first, 5u);
    EXPECT_GE(range.first + range.bins * range.step, 799u);
    const evidence::Histogram histogram = evidence::histogram(frames, range);
    const double sum = std::accumulate(histogram.bins.begin(), histogram.bins.end(), 0.0);
    EXPECT_NEAR(sum + histogram.outside, 1.0, 1e-12);
    EXPECT_LT(histogram.outside, 0.002);
}

TEST(Measures, FramesOfOneCodeStayFinite) {
    const CaptureLayout layout = one_sequence(CaptureScene::kDots, 3);
    const std::vector<std::uint16_t> codes(3 * layout.pixel_count(), 1023);
    const auto frames = frames_of(layout, codes);
    const evidence::Plane mean = evidence::mean_image(frames);
    for (const double power :
         evidence::radial_power(frames, mean, Fluctuation::kOverTime, evidence::band_count(layout)))
        EXPECT_EQ(power, 0.0);
    EXPECT_EQ(evidence::temporal_autocorrelation(frames), (std::vector<double>{1.0, 0.0, 0.0}));
    const evidence::HistogramRange range = evidence::histogram_range({frames});
    const std::vector<double> histogram = evidence::histogram(frames, range).bins;
    EXPECT_EQ(std::accumulate(histogram.begin(), histogram.end(), 0.0), 1.0);
    EXPECT_EQ(centre_errors(layout, layout.sequences[0], codes.data(), 3).count, 0.0) << "no dot stands out";
    const Picture picture = evidence::gray_picture(mean, 64, 48, 1023.0, 1023.0);
    EXPECT_EQ(picture.pixels.size(), layout.pixel_count());
}

TEST(Measures, StackShowsTheDotThatIsThere) {
    const CaptureLayout layout = sample::layout({{"dots", CaptureScene::kDots, true, 1}});
    std::vector<std::uint16_t> codes(layout.pixel_count());
    // Dots of 600 DN over a black level of 64 DN.
    for (std::size_t i = 0; i < codes.size(); ++i) {
        double light = 0.0;
        for (const auto &dot : layout.dots->positions_px) {
            const double dx = double(i % layout.width) - dot[0], dy = double(i / layout.width) - dot[1];
            light += 600.0 * std::exp(-(dx * dx + dy * dy) / (2.0 * 2.2 * 2.2));
        }
        codes[i] = static_cast<std::uint16_t>(std::lround(64.0 + light));
    }
    const auto frames = frames_of(layout, codes);
    const evidence::DotStack stack = evidence::stack_dots(frames, evidence::mean_image(frames), 64.0);
    EXPECT_EQ(stack.dots, 12u); // those at least 12 px from the edges: 4 columns of 3
    ASSERT_EQ(stack.image.size(), 625u);
    const std::vector<double> radii = evidence::dot_profile_radii();
    ASSERT_EQ(stack.profile_dn.size(), radii.size());
    for (std::size_t k = 0; k < 8; ++k) // up to 4 px; farther out the neighbours' light shows
        EXPECT_NEAR(stack.profile_dn[k], 600.0 * std::exp(-radii[k] * radii[k] / (2.0 * 2.2 * 2.2)), 40.0) << radii[k];

    // The dots are where they should be; what is left is rounding and the neighbours' symmetrical light.
    const CentreErrors errors = centre_errors(layout, layout.sequences[0], codes.data(), 1);
    EXPECT_GT(errors.count, 10.0);
    EXPECT_LT(errors.rms(), 0.15);
    // Moved by a pixel to the right: that is the error, along x. Towards the nominal place the window still holds it
    // back a little.
    std::vector<std::uint16_t> moved(codes.size(), 64);
    for (std::size_t i = 0; i + 1 < codes.size(); ++i)
        moved[i + 1] = codes[i];
    const CentreErrors shifted = centre_errors(layout, layout.sequences[0], moved.data(), 1);
    EXPECT_NEAR(shifted.rms_x(), 1.0, 0.2);
    EXPECT_LT(shifted.square_sum - shifted.square_sum_x, 0.15 * 0.15 * shifted.count);
}

TEST(Pictures, LargeImagesAreAveragedAndPngsReadBack) {
    const evidence::Plane plane{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
    EXPECT_EQ(evidence::block_means(plane, 5, 2, 2), (evidence::Plane{3, 5, 6.5f}));
    EXPECT_EQ(evidence::quantile(plane, 0.0), 0.0);
    EXPECT_EQ(evidence::quantile(plane, 1.0), 9.0);
    const Picture colours = evidence::diverging_picture({-2, 0, 2}, 3, 1, 2.0);
    EXPECT_EQ(colours.pixels, (std::vector<std::uint8_t>{33, 102, 172, 255, 255, 255, 178, 24, 43}));
    for (const Picture &picture : {evidence::gray_picture(plane, 5, 2, 1.0, 8.0), colours}) {
        const std::vector<std::uint8_t> png = encode_png(picture);
        spng_ctx *reader = spng_ctx_new(0);
        ASSERT_EQ(spng_set_png_buffer(reader, png.data(), png.size()), 0);
        spng_ihdr header{};
        ASSERT_EQ(spng_get_ihdr(reader, &header), 0);
        EXPECT_EQ(header.width, picture.width);
        EXPECT_EQ(header.height, picture.height);
        std::vector<std::uint8_t> read(picture.pixels.size());
        EXPECT_EQ(spng_decode_image(reader, read.data(), read.size(), SPNG_FMT_PNG, 0), 0);
        EXPECT_EQ(read, picture.pixels);
        spng_ctx_free(reader);
    }
    EXPECT_EQ(base64({}), "");
    EXPECT_EQ(base64({'M'}), "TQ==");
    EXPECT_EQ(base64({'M', 'a'}), "TWE=");
    EXPECT_EQ(base64({'M', 'a', 'n'}), "TWFu");
}

TEST(Page, EscapesWhatMeansSomething) {
    EXPECT_EQ(escaped("a < b & \"c\" > 'd'"), "a &lt; b &amp; &quot;c&quot; &gt; &#39;d&#39;");
    EXPECT_EQ(escaped("\xff"), "\xef\xbf\xbd");
    EXPECT_EQ(escaped("tab\there"), "tab here");
    HtmlPage page;
    page.plot({{"text", "</script><!--"}}, "<caption>");
    EXPECT_EQ(page.text().find("</script><!--"), std::string::npos);
    EXPECT_NE(page.text().find("\\u003c/script>"), std::string::npos);
    EXPECT_NE(page.text().find("&lt;caption&gt;"), std::string::npos);
    EXPECT_EQ(figure(std::nan("")), "–");
    EXPECT_EQ(probability(1e-9), "< 0.001");
}

TEST(Explanations, EveryStatisticHasWordsOfItsOwn) {
    const CaptureLayout layout = sample::layout({{"dark", CaptureScene::kDark, false, 8},
                                                 {"flat", CaptureScene::kFlat, false, 8},
                                                 {"board", CaptureScene::kBoard, false, 8},
                                                 {"dots", CaptureScene::kDots, false, 8}});
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        const SequenceStatistics statistics(layout, s, 8);
        ASSERT_GT(statistics.list().size(), 20u);
        for (const StatisticInfo &statistic : statistics.list()) {
            std::string plain = statistic.name;
            std::replace(plain.begin(), plain.end(), '_', ' ');
            EXPECT_NE(explain_statistic(statistic.name), plain) << statistic.name;
        }
    }
    EXPECT_EQ(explain_region("r0c2"), "upper right");
    EXPECT_EQ(explain_region("r1c1"), "middle");
    EXPECT_EQ(explain_statistic("of_a_later_version"), "of a later version");
}

TEST(Evidence, HasItsSizes) {
    const sample::Sample s = sample::with_evidence(
        context(), {{"dark", CaptureScene::kDark, false, 3}, {"dots_moving", CaptureScene::kDots, true, 12}}, true);
    const Evidence &evidence = *s.result.evidence;
    ASSERT_EQ(evidence.sequences.size(), 2u);
    for (const SequenceEvidence &sequence : evidence.sequences) {
        ASSERT_EQ(sequence.versions.size(), 3u);
        EXPECT_EQ(sequence.frame_count, sequence.scene == CaptureScene::kDark ? 3u : kEvidenceFrames);
        EXPECT_EQ(sequence.frequency.size(), 30u);
        for (std::size_t v = 0; v < 3; ++v) {
            const VersionEvidence &version = sequence.versions[v];
            for (const Picture *picture : {&version.first_frame, &version.mean_image, &version.temporal_deviation}) {
                EXPECT_EQ(picture->width, 72u);
                EXPECT_EQ(picture->height, 60u);
                EXPECT_EQ(picture->pixels.size(), 72u * 60u);
            }
            EXPECT_EQ(version.mean_image.low_dn, sequence.versions[0].mean_image.low_dn)
                << "one scale for all versions";
            EXPECT_EQ(version.mean_image.high_dn, sequence.versions[0].mean_image.high_dn);
            EXPECT_EQ(version.difference.empty(), v == 0);
            EXPECT_EQ(version.difference.pixels.size(), v == 0 ? 0u : 3u * 72u * 60u);
            EXPECT_LE(version.histogram.size(), kHistogramBins);
            EXPECT_EQ(version.power.size(), sequence.frequency.size());
            EXPECT_EQ(version.autocorrelation.size(), sequence.frame_count);
            EXPECT_EQ(version.dot_stack.empty(), sequence.scene != CaptureScene::kDots);
            EXPECT_EQ(version.dot_profile_dn.size(), sequence.dot_radius_px.size());
        }
    }
}

TEST(Evidence, DefocusShowsInTheProfileAndTheModelFollows) {
    // Defocus of 1.2 waves lowers the peak of the dots far beyond their speckle: mean of 12 dots and 8 frames.
    const sample::Sample s = sample::with_evidence(context(), {{"dots_moving", CaptureScene::kDots, true, 8}}, true);
    const auto &versions = s.result.evidence->sequences[0].versions;
    const auto total = [](const std::vector<double> &profile) {
        double sum = 0.0;
        for (std::size_t k = 0; k < 4; ++k) // up to 2 px
            sum += profile[k] * (double(k) + 0.5);
        return sum;
    };
    const double real = total(versions[0].dot_profile_dn), before = total(versions[1].dot_profile_dn),
                 after = total(versions[2].dot_profile_dn);
    EXPECT_GT(before, 1.15 * real);
    EXPECT_LT(std::abs(after - real), 0.5 * std::abs(before - real));
    const Downstream &d = s.result.downstream;
    ASSERT_TRUE(d.valid);
    EXPECT_GT(d.real, 0.05);
    EXPECT_LT(std::abs(d.after - d.real), std::abs(d.before - d.real));
    // dz = z^2 dx / (b f) with 1 m, 0.05 m and 72 px: 278 mm for each pixel along x, of which there are two axes.
    EXPECT_NEAR(d.depth_error_mm_real / d.real, 1000.0 / (0.05 * 72.0) / std::sqrt(2.0), 60.0);
    EXPECT_NE(d.depth_assumption.find("50 mm"), std::string::npos);
}

TEST(Evidence, SameSeedSameReport) {
    const std::vector<sample::Sequence> sequences{{"board", CaptureScene::kBoard, true, 2}};
    EXPECT_EQ(report_html(sample::with_evidence(context(), sequences, false).result),
              report_html(sample::with_evidence(context(), sequences, false).result));
}

TEST(Report, JsonHoldsTheDepthError) {
    DiagnosisResult result;
    result.downstream = {true, 0.4, 0.2, 0.38, 80.0, 40.0, 76.0, "assumed"};
    const auto shrink = nlohmann::json::parse(report_json(result))["shrink"];
    EXPECT_EQ(shrink["downstream"]["depth_error_mm"]["real"], 80.0);
    EXPECT_EQ(shrink["downstream"]["depth_error_mm"]["after"], 76.0);
    EXPECT_EQ(shrink["downstream"]["depth_assumption"], "assumed");
    EXPECT_EQ(shrink["downstream"]["dot_centre_rms_px"]["before"], 0.2);
}

TEST(Report, HoldsVegaWhole) {
    ASSERT_EQ(kVegaModuleCount, 20u);
    for (std::size_t i = 0; i < kVegaModuleCount; ++i) {
        const std::string text = kVegaModules[i].text;
        EXPECT_GT(text.size(), 500u) << kVegaModules[i].name;
        EXPECT_EQ(text.find("sourceMappingURL"), std::string::npos);
        EXPECT_EQ(text.find("</script"), std::string::npos);
        EXPECT_NE(text.rfind("}));"), std::string::npos) << "the end of " << kVegaModules[i].name;
    }
}

TEST(Report, SaysTheVerdict) {
    for (const auto &[name, result] : sample::reports(context())) {
        const std::string html = report_html(result);
        EXPECT_NE(html.find(std::string("Verdict: ") + verdict_name(result.verdict)), std::string::npos) << name;
        EXPECT_EQ(html.find("<img src=x"), std::string::npos) << name;
        EXPECT_NE(html.find("seed " + std::to_string(result.seed)), std::string::npos) << name;
        EXPECT_EQ(html.substr(html.size() - 8), "</html>\n") << name;
    }
}
