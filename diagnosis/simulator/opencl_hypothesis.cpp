#include "simulator/opencl_hypothesis.hpp"

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "simulator/source_includes.hpp"

#include <algorithm>
#include <cstddef>
#include <fmt/core.h>
#include <set>
#include <string>
#include <utility>

namespace clsp {
namespace {

constexpr const char *kRoot = "hypothesis_source.cl"; // generated
constexpr std::size_t kMostValues = 4;                // of the kernel's float4

// Of C99 and OpenCL C 1.2, as far as a parameter may be called so.
const std::set<std::string> kReserved = {
    "auto",    "bool",      "break",      "case",      "char",     "const",   "constant",  "continue", "default",
    "do",      "double",    "else",       "enum",      "event_t",  "extern",  "float",     "for",      "global",
    "goto",    "half",      "if",         "image2d_t", "inline",   "int",     "kernel",    "local",    "long",
    "private", "read_only", "read_write", "register",  "restrict", "return",  "sampler_t", "short",    "signed",
    "size_t",  "sizeof",    "static",     "struct",    "switch",   "typedef", "uchar",     "uint",     "ulong",
    "union",   "unsigned",  "ushort",     "void",      "volatile", "while",   "write_only"};

bool is_identifier(const std::string &name) {
    const auto letter = [](unsigned char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
    const auto digit = [](unsigned char c) { return c >= '0' && c <= '9'; };
    return !name.empty() && letter(static_cast<unsigned char>(name.front())) &&
           std::all_of(name.begin(), name.end(), [&](unsigned char c) { return letter(c) || digit(c); });
}

// The caller's text comes last: its macros change nothing of ours, and a function with other arguments than declared is
// reported in its own line.
std::string program_of(const Hypothesis &hypothesis) {
    std::string members, places;
    for (std::size_t i = 0; i < hypothesis.parameters.size(); ++i) {
        members += fmt::format(" float {};", hypothesis.parameters[i].name);
        places += fmt::format("{}(values).s{}", i ? ", " : "", i);
    }
    constexpr const char *kByteOrderMark = "\xef\xbb\xbf";
    const std::string &source = hypothesis.opencl_source;
    return fmt::format("#include \"diagnosis/hypothesis.h\"\n"
                       "#line 1 \"parameters of {0}\"\n"
                       "typedef struct {{{1} }} hypothesis_values;\n"
                       "#define HYPOTHESIS_VALUES(values) {{{2}}}\n"
                       "#include \"diagnosis/hypothesis.cl\"\n"
                       "#line 1 \"{0}\"\n{3}\n",
                       hypothesis.id, members, places,
                       source.compare(0, 3, kByteOrderMark) == 0 ? source.substr(3) : source);
}

// FNV-1a, folded to 16 bits: random numbers of a hypothesis do not depend on which others are there.
std::uint32_t number_of(const std::string &id) {
    std::uint32_t hash = 0x811c9dc5u;
    for (const unsigned char c : id)
        hash = (hash ^ c) * 0x01000193u;
    return (hash >> 16) ^ (hash & 0xffffu);
}

// A frame's two images on the device, and the kernel between them.
class Pass {
  public:
    Pass(std::shared_ptr<Context> context, const Hypothesis &hypothesis)
        : context_(std::move(context)), queue_(context_->cl_context(), context_->device()),
          source_(context_, hypothesis) {}

    void run(const HypothesisFrame &frame) {
        const CaptureLayout &layout = *frame.layout;
        const SequenceLayout &sequence = layout.sequences[frame.sequence];
        const std::size_t bytes = layout.pixel_count() * sizeof(float);
        if (!after_) { // a simulator's frames are all of one size
            before_ = DeviceBuffer(context_, bytes);
            after_ = DeviceBuffer(context_, bytes);
        }
        const HypothesisPlace place{layout.width,
                                    layout.height,
                                    layout.bits,
                                    static_cast<std::uint32_t>(frame.sequence),
                                    static_cast<std::uint32_t>(sequence.scene),
                                    sequence.moving,
                                    frame.frame_index,
                                    frame.seed,
                                    sequence.f_number > 0.0 ? sequence.f_number : layout.f_number,
                                    layout.pixel_pitch_m,
                                    layout.wavelength_m};
        check_opencl(
            clEnqueueWriteBuffer(queue_(), before_.get()(), CL_TRUE, 0, bytes, frame.pixels, 0, nullptr, nullptr),
            "clEnqueueWriteBuffer");
        CommandChain chain(queue_(), 0, nullptr);
        source_.enqueue(chain, before_.get(), after_.get(), place, frame.values);
        check_opencl(
            clEnqueueReadBuffer(queue_(), after_.get()(), CL_TRUE, 0, bytes, frame.pixels, 0, nullptr, nullptr),
            "clEnqueueReadBuffer");
    }

  private:
    std::shared_ptr<Context> context_;
    cl::CommandQueue queue_;
    OpenclHypothesis source_;
    DeviceBuffer before_, after_;
};

} // namespace

void check_opencl_hypothesis(const Hypothesis &hypothesis) {
    const auto complain = [&](const std::string &what) {
        throw Error(Status::kInvalidArgument, fmt::format("the hypothesis \"{}\" {}", hypothesis.id, what));
    };
    if (hypothesis.opencl_source.find_first_not_of(" \t\r\n") == std::string::npos)
        complain("has OpenCL source without anything in it; it must define float hypothesis(hypothesis_frame frame, "
                 "hypothesis_values values, uint x, uint y)");
    if (hypothesis.parameters.size() > kMostValues)
        complain(
            fmt::format("has {} parameters, OpenCL source can have {}", hypothesis.parameters.size(), kMostValues));
    if (const std::string word = word_that_reads_files(hypothesis.opencl_source); !word.empty())
        complain(fmt::format(
            "has OpenCL source with {}; it must stand alone. Put the text of files into it, write names out that ## "
            "would make, and leave out assembler and pragmas other than OPENCL, STDC and unroll",
            word));
    std::set<std::string> names;
    for (const HypothesisParameter &parameter : hypothesis.parameters) {
        if (!is_identifier(parameter.name))
            complain(fmt::format("has the parameter \"{}\"; in OpenCL source it must be a name of letters, digits and "
                                 "'_' that begins with no digit",
                                 parameter.name));
        if (kReserved.count(parameter.name))
            complain(fmt::format("has the parameter \"{}\", a word of OpenCL C's own; give it another name",
                                 parameter.name));
        if (!names.insert(parameter.name).second)
            complain(fmt::format("has two parameters with the name \"{}\"; give each its own", parameter.name));
    }
}

OpenclHypothesis::OpenclHypothesis(std::shared_ptr<Context> context, const Hypothesis &hypothesis)
    : number_(number_of(hypothesis.id)), value_count_(std::min(hypothesis.parameters.size(), kMostValues)) {
    const ProgramCache::GeneratedHeader program{kRoot, program_of(hypothesis)};
    try {
        kernel_ = context->kernel(kRoot, "hypothesis_apply", {}, &program);
    } catch (const Error &error) {
        if (error.status() != Status::kBuild)
            throw;
        throw Error(
            Status::kBuild,
            fmt::format("the OpenCL source of the hypothesis \"{}\" does not build{}; it must define "
                        "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y)",
                        hypothesis.id,
                        error.build_log().empty() ? std::string(": ") + error.what() : "; the build log tells where"),
            error.opencl_code(), error.build_log());
    }
}

void OpenclHypothesis::enqueue(CommandChain &chain, const cl::Buffer &before, const cl::Buffer &after,
                               const HypothesisPlace &place, const double *values) {
    cl_float4 numbers{};
    for (std::size_t i = 0; i < value_count_; ++i)
        numbers.s[i] = static_cast<cl_float>(values[i]);
    KernelArguments(kernel_)
        .add(before)
        .add(after)
        .add(cl_uint{place.width})
        .add(cl_uint{place.height})
        .add(cl_uint{place.bits})
        .add(cl_uint{place.sequence})
        .add(cl_uint{place.scene})
        .add(cl_uint{place.moving ? 1u : 0u})
        .add(cl_uint{place.frame_index})
        .add(cl_ulong{place.seed})
        .add(cl_uint{number_})
        .add(static_cast<cl_float>(place.f_number))
        .add(static_cast<cl_float>(place.pixel_pitch_m))
        .add(static_cast<cl_float>(place.wavelength_m))
        .add(numbers);
    chain.run("own_effect", kernel_, place.width, place.height);
}

std::function<void(const HypothesisFrame &)> opencl_hypothesis(std::shared_ptr<Context> context,
                                                               const Hypothesis &hypothesis) {
    const auto pass = std::make_shared<Pass>(std::move(context), hypothesis);
    return [pass](const HypothesisFrame &frame) { pass->run(frame); };
}

} // namespace clsp
