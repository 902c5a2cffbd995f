// The yardstick on a CPU: FFTW (single precision, as many threads as cores, in place), its two transforms alone and the
// whole way from phases and an ideal image to the intensity behind a round aperture.
#include "bench.hpp"

#include <cmath>
#include <cstdint>
#include <fftw3.h>
#include <memory>
#include <omp.h>
#include <vector>

namespace {

class Transforms {
  public:
    Transforms(int width, int height)
        : width_(width), height_(height), field_(fftwf_alloc_complex(pixels()), fftwf_free) {
        fftwf_plan_with_nthreads(omp_get_max_threads());
        forward_ = fftwf_plan_dft_2d(height, width, field(), field(), FFTW_FORWARD, FFTW_MEASURE);
        inverse_ = fftwf_plan_dft_2d(height, width, field(), field(), FFTW_BACKWARD, FFTW_MEASURE);
        for (std::size_t i = 0; i < pixels(); ++i)
            field()[i][0] = field()[i][1] = 0.0f; // a zero field stays finite however often it is transformed
    }
    ~Transforms() {
        fftwf_destroy_plan(forward_);
        fftwf_destroy_plan(inverse_);
    }
    Transforms(const Transforms &) = delete;
    Transforms &operator=(const Transforms &) = delete;
    static bool ready() {
        static const int threads_ready = fftwf_init_threads();
        return threads_ready != 0;
    }

    std::size_t pixels() const { return std::size_t(width_) * std::size_t(height_); }
    fftwf_complex *field() { return field_.get(); }
    void forward() { fftwf_execute(forward_); }
    void inverse() { fftwf_execute(inverse_); }

  private:
    int width_, height_;
    std::unique_ptr<fftwf_complex[], decltype(&fftwf_free)> field_;
    fftwf_plan forward_, inverse_;
};

void fftw_forward_and_inverse(benchmark::State &state) {
    if (!Transforms::ready()) {
        state.SkipWithError("fftwf_init_threads failed");
        return;
    }
    Transforms transforms(int(state.range(0)), int(state.range(1)));
    for (auto _ : state) {
        transforms.forward();
        transforms.inverse();
        benchmark::ClobberMemory();
    }
}
BENCHMARK(fftw_forward_and_inverse)->Apply(bench::sizes);

// D in hundredths.
void fftw_frame(benchmark::State &state) {
    if (!Transforms::ready()) {
        state.SkipWithError("fftwf_init_threads failed");
        return;
    }
    const int width = int(state.range(0)), height = int(state.range(1));
    const double diameter = 0.01 * double(state.range(2));
    Transforms transforms(width, height);
    const std::int64_t pixels = std::int64_t(transforms.pixels());
    std::vector<float> phase(std::size_t(pixels), 0.0f), ideal(std::size_t(pixels), 1.0f),
        intensity(std::size_t(pixels), 0.0f), mask(std::size_t(pixels), 0.0f);
    for (std::int64_t i = 0; i < pixels; ++i) { // Weyl's sequence: no two equal
        const double turns = 0.6180339887498949 * double(i);
        phase[std::size_t(i)] = float(6.283185307179586 * (turns - std::floor(turns)));
    }
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double u = double(x < (width + 1) / 2 ? x : x - width) / width,
                         v = double(y < (height + 1) / 2 ? y : y - height) / height;
            mask[std::size_t(y) * std::size_t(width) + std::size_t(x)] =
                u * u + v * v <= 0.25 * diameter * diameter ? 1.0f / float(pixels) : 0.0f;
        }
    fftwf_complex *const field = transforms.field();
    const auto frame = [&] {
#pragma omp parallel for simd
        for (std::int64_t i = 0; i < pixels; ++i) {
            const float amplitude = std::sqrt(ideal[std::size_t(i)]);
            field[i][0] = amplitude * std::cos(phase[std::size_t(i)]);
            field[i][1] = amplitude * std::sin(phase[std::size_t(i)]);
        }
        transforms.forward();
#pragma omp parallel for simd
        for (std::int64_t i = 0; i < pixels; ++i) {
            field[i][0] *= mask[std::size_t(i)];
            field[i][1] *= mask[std::size_t(i)];
        }
        transforms.inverse();
#pragma omp parallel for simd
        for (std::int64_t i = 0; i < pixels; ++i)
            intensity[std::size_t(i)] = field[i][0] * field[i][0] + field[i][1] * field[i][1];
        benchmark::ClobberMemory();
    };
    frame();
    for (auto _ : state)
        frame();
}
BENCHMARK(fftw_frame)->Apply(bench::apertures);

} // namespace
