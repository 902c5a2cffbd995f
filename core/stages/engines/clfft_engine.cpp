// clFFT's engine, which takes every grid: a kernel makes the field, another one applies the pupil between the
// transforms, a third one makes pixels.
#include "stages/engines/engine.hpp"
#include "fft/fft.hpp"
#include "runtime/kernel_arguments.hpp"

#include <fmt/core.h>

namespace clsp {
namespace {

class ClfftEngine final : public Engine {
  public:
    explicit ClfftEngine(const EngineRequest &request)
        : Engine(request, {EngineKind::kClfft, {}, {}}), fft_(clfft_of(*context_, grid_.grid_width, grid_.grid_height)),
          pupil_(request.pupil_values), complex_pupil_(!request.pupil.phase_turns.empty()),
          pixels_(context_, grid_, request.pixel_taps, false) {
        pupil_kernel(false);
    }

  private:
    std::uint64_t field_bytes() const override { return grid_.samples() * sizeof(cl_float2); }
    std::uint64_t scratch_bytes() const override { return fft_->scratch_bytes(); }
    void build_kernels(const Phase &phase, Field &field, const std::vector<LaserLine> &, const Exposure &exposure,
                       bool) override {
        field.prepare(phase, exposure.screen != nullptr);
        pupil_kernel(exposure.moves_image);
    }
    void enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) override;
    void enqueue_pixels(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                        const ImageView &intensity) override {
        pixels_.enqueue(chain, field, static_cast<cl_float>(weights[0]), before, intensity);
    }
    cl::Kernel &pupil_kernel(bool shifted) {
        cl::Kernel &kernel = shifted ? shift_pupil_ : apply_pupil_;
        if (!kernel())
            kernel =
                context_->kernel("fft/clfft/pupil.cl", "apply_pupil",
                                 fmt::format("-DCOMPLEX_PUPIL={} -DSHIFT={}", complex_pupil_ ? 1 : 0, shifted ? 1 : 0));
        return kernel;
    }

    std::shared_ptr<Fft> fft_;
    cl::Buffer pupil_;
    bool complex_pupil_;
    SamplePixels pixels_;
    cl::Kernel apply_pupil_, shift_pupil_;
};

void ClfftEngine::enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) {
    pass.field.enqueue_illuminate(chain, pass.phase, pass.input, pass.polarization, pass.line, memory.field,
                                  pass.bad_pixels);
    fft_->enqueue(chain, FftDirection::kForward, "fft", memory.field, memory.scratch);
    cl::Kernel &apply = pupil_kernel(pass.shift.has_value());
    KernelArguments arguments(apply);
    arguments.add(memory.field).add(pupil_);
    if (pass.shift)
        arguments.add(static_cast<cl_float>((*pass.shift)[0])).add(static_cast<cl_float>((*pass.shift)[1]));
    if (complex_pupil_ || pass.shift) {
        arguments.add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.grid_height});
        chain.run("pupil", apply, grid_.grid_width, grid_.grid_height);
    } else {
        arguments.add(cl_ulong{grid_.samples()});
        chain.run("pupil", apply, grid_.samples());
    }
    fft_->enqueue(chain, FftDirection::kInverse, "inverse_fft", memory.field, memory.scratch);
}

} // namespace

std::unique_ptr<Engine> make_clfft_engine(const EngineRequest &request) {
    return std::make_unique<ClfftEngine>(request);
}

} // namespace clsp
