// The engine for GPUs in work-groups of a given shape: the field is clFFT's in every one of them; kernels that leave
// their work-groups less than they take get smaller ones, or the aperture falls back when it is made.
#include "stages/engines/engine.hpp"
#include "fft/gpu/codelets.hpp"
#include "runtime/context.hpp"
#include "stages/aperture.hpp"
#include "stages/phase.hpp"
#include "tuning/tuning.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <dlfcn.h>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace {

// What kernels say of themselves: no more work-items than that, and so many bytes of local memory of their own.
std::size_t most_work_items = ~std::size_t{0};
cl_ulong own_local_bytes = 0;

} // namespace

// In the place of the driver's, which it calls.
extern "C" cl_int clGetKernelWorkGroupInfo(cl_kernel kernel, cl_device_id device, cl_kernel_work_group_info what,
                                           size_t size, void *value, size_t *size_ret) {
    using Function = cl_int (*)(cl_kernel, cl_device_id, cl_kernel_work_group_info, size_t, void *, size_t *);
    static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "clGetKernelWorkGroupInfo"));
    const cl_int code = real(kernel, device, what, size, value, size_ret);
    if (code == CL_SUCCESS && value && what == CL_KERNEL_WORK_GROUP_SIZE)
        *static_cast<size_t *>(value) = std::min(*static_cast<size_t *>(value), most_work_items);
    if (code == CL_SUCCESS && value && what == CL_KERNEL_LOCAL_MEM_SIZE)
        *static_cast<cl_ulong *>(value) += own_local_bytes;
    return code;
}

namespace {

using namespace clsp;

std::vector<std::string> log_lines;

class WorkGroups : public ::testing::Test {
  protected:
    void SetUp() override {
        if (!context) {
            ContextParameters parameters;
            parameters.log = [](LogLevel, const std::string &line) { log_lines.push_back(line); };
            context = Context::create(parameters);
        }
        log_lines.clear();
    }
    void TearDown() override {
        most_work_items = ~std::size_t{0};
        own_local_bytes = 0;
    }
    static void TearDownTestSuite() { context.reset(); }

    static ApertureParameters parameters(std::uint32_t width, std::uint32_t height, const EngineSpec &spec) {
        ApertureParameters p;
        p.width = width;
        p.height = height;
        p.relative_diameter = 0.6;
        p.engine = spec;
        return p;
    }

    std::vector<float> picture(Aperture &aperture) {
        const std::uint32_t width = aperture.grid().width, height = aperture.grid().height;
        PhaseParameters p;
        p.width = width;
        p.height = height;
        p.seed = 5;
        Phase phase(context, p);
        const cl::CommandQueue queue(context->cl_context(), context->device());
        std::vector<float> pixels(std::size_t{width} * height);
        std::mt19937 random(1);
        for (float &pixel : pixels)
            pixel = std::uniform_real_distribution<float>(0.0f, 2.0f)(random);
        const DeviceBuffer image(context, pixels.size() * sizeof(float), pixels.data());
        const ImageView view = check_image({image.get()(), 0, 0, width, height, Format::kFloat32}, "image",
                                           context->cl_context()(), {width, height}, {Format::kFloat32});
        CommandChain chain(queue(), 0, nullptr);
        phase.enqueue_refresh(chain, 0, {});
        aperture.prepare(phase, {});
        aperture.enqueue_intensity(chain, phase, view, view);
        queue.enqueueReadBuffer(image.get(), CL_TRUE, 0, pixels.size() * sizeof(float), pixels.data());
        return pixels;
    }
    std::vector<float> picture(std::uint32_t width, std::uint32_t height, const EngineSpec &spec) {
        Aperture aperture(context, parameters(width, height, spec));
        EXPECT_EQ(spec.kind, aperture.engine().kind) << aperture.clfft_reason();
        for (const auto &[wanted, got] :
             {std::pair{spec.columns, aperture.engine().columns}, std::pair{spec.rows, aperture.engine().rows}})
            if (wanted) {
                EXPECT_TRUE(wanted == got) << describe(aperture.engine());
            }
        return picture(aperture);
    }
    static double relative_error(const std::vector<float> &got, const std::vector<float> &expected) {
        double difference = 0.0, norm = 0.0;
        for (std::size_t i = 0; i < got.size(); ++i) {
            difference += std::pow(double{got[i]} - expected[i], 2);
            norm += std::pow(double{expected[i]}, 2);
        }
        return std::sqrt(difference / norm);
    }

    static inline std::shared_ptr<Context> context;
};

constexpr double kBound = 2e-6;
constexpr EngineSpec kGpu{EngineKind::kGpu, {}, {}}, kClfft{EngineKind::kClfft, {}, {}};

TEST_F(WorkGroups, EveryCandidateMakesTheFieldOfClfft) {
    constexpr std::uint32_t width = 96, height = 60;
    const WorkGroupLimits limits{256, 49152};
    const std::vector<float> expected = picture(width, height, kClfft);
    const auto columns = work_groups_to_try(make_gpu_plan(height), limits, true),
               rows = work_groups_to_try(make_gpu_plan(width), limits, false);
    EXPECT_GE(columns.size(), 6u);
    EXPECT_GE(rows.size(), 6u);
    for (const WorkGroup &pick : columns)
        EXPECT_LT(relative_error(picture(width, height, {EngineKind::kGpu, pick, {}}), expected), kBound)
            << pick.lines << " x " << pick.items;
    for (const WorkGroup &pick : rows)
        EXPECT_LT(relative_error(picture(width, height, {EngineKind::kGpu, {}, pick}), expected), kBound)
            << pick.lines << " x " << pick.items;
}

TEST_F(WorkGroups, LinesAloneGetTheirWorkItems) {
    Aperture aperture(context, parameters(96, 60, {EngineKind::kGpu, WorkGroup{4, 0}, WorkGroup{2, 0}}));
    EXPECT_EQ(4u, aperture.engine().columns->lines);
    EXPECT_GT(aperture.engine().columns->items, 1u);
    EXPECT_EQ(2u, aperture.engine().rows->lines);
    EXPECT_LT(relative_error(picture(aperture), picture(96, 60, kClfft)), kBound);
}

TEST_F(WorkGroups, WhatDoesNotFitGoesToClfftWithALineThatSaysWhy) {
    // More work-items than there is work, more lines than a work-group holds.
    for (const WorkGroup pick : {WorkGroup{1, 4000}, WorkGroup{64, 60}}) {
        log_lines.clear();
        const std::uint32_t height = pick.lines == 64 ? 8192 / 8 : 60;
        const WorkGroup asked = pick.lines == 64 ? WorkGroup{64, 128} : pick;
        const Aperture aperture(context, parameters(8, height, {EngineKind::kGpu, asked, {}}));
        EXPECT_EQ(EngineKind::kClfft, aperture.engine().kind);
        EXPECT_NE(std::string::npos, aperture.clfft_reason().find("do not go in work-groups of"))
            << aperture.clfft_reason();
        ASSERT_FALSE(log_lines.empty());
        EXPECT_NE(std::string::npos, log_lines[0].find("is not used for a field grid of 8 x")) << log_lines[0];
        EXPECT_NE(std::string::npos, log_lines[0].find("do not go in work-groups of")) << log_lines[0];
    }
}

TEST_F(WorkGroups, KernelsWithFewerWorkItemsThanTheirGroup) {
    const std::vector<float> expected = picture(96, 60, kClfft);
    for (const std::size_t most : {48, 7, 3, 1}) {
        most_work_items = most;
        EXPECT_LT(relative_error(picture(96, 60, kGpu), expected), kBound) << most;
    }
}

TEST_F(WorkGroups, KernelsWithLocalMemoryOfTheirOwn) {
    const std::vector<float> expected = picture(96, 60, kClfft);
    const cl_ulong local = context->device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    // Room for a line or two.
    own_local_bytes = local - 1200;
    EXPECT_LT(relative_error(picture(96, 60, kGpu), expected), kBound);
}

TEST_F(WorkGroups, NoRoomIsFoundWhenTheApertureIsMade) {
    own_local_bytes = context->device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    const Aperture aperture(context, parameters(96, 60, kGpu));
    EXPECT_EQ(EngineKind::kClfft, aperture.engine().kind);
    EXPECT_NE(std::string::npos, aperture.clfft_reason().find("has 0 bytes of local memory left"))
        << aperture.clfft_reason();
    ASSERT_FALSE(log_lines.empty());
    EXPECT_NE(std::string::npos, log_lines[0].find(aperture.clfft_reason())) << log_lines[0];
}

TEST_F(WorkGroups, OversampledPixelsStayInOneGroup) {
    // rows_inverse sums a pixel's samples, which are in two rows: groups of one would not hold them.
    ApertureParameters p = parameters(48, 30, kGpu);
    p.oversampling = 2;
    most_work_items = 1;
    const Aperture aperture(context, p);
    EXPECT_EQ(EngineKind::kClfft, aperture.engine().kind);
    EXPECT_NE(std::string::npos, aperture.clfft_reason().find("need at least 2")) << aperture.clfft_reason();
}

TuneParameters quick() {
    TuneParameters p;
    p.sizes = {{24, 16}};
    p.frames = 2;
    p.keep = false;
    return p;
}

TEST_F(WorkGroups, TuningMeasuresEveryShapeOnce) {
    TuneParameters p = quick();
    p.work_group_shapes = true;
    const TunedSize size = tune(context, p).measured.sizes.at(0);
    // The work-groups that the rule takes count once, under no shape of their own.
    Aperture automatic(context, parameters(24, 16, kGpu));
    std::size_t columns = 0, rows = 0;
    for (std::size_t i = 0; i < size.candidates.size(); ++i) {
        const TunedCandidate &candidate = size.candidates[i];
        EXPECT_EQ("", candidate.refusal) << describe(candidate.spec);
        EXPECT_GT(candidate.median_ms, 0.0) << describe(candidate.spec);
        EXPECT_FALSE(candidate.spec.columns == automatic.engine().columns &&
                     (!candidate.spec.rows || candidate.spec.rows == automatic.engine().rows))
            << describe(candidate.spec);
        for (std::size_t k = 0; k < i; ++k)
            EXPECT_FALSE(candidate.spec == size.candidates[k].spec) << describe(candidate.spec);
        if (candidate.spec.rows) {
            EXPECT_TRUE(candidate.spec.columns); // those that were the best
        }
        columns += candidate.spec.columns && !candidate.spec.rows;
        rows += candidate.spec.columns && candidate.spec.rows;
    }
    const WorkGroupLimits limits = work_group_limits(*context);
    EXPECT_GE(columns + 1, work_groups_to_try(make_gpu_plan(16), limits, true).size());
    EXPECT_GE(rows + 1, work_groups_to_try(make_gpu_plan(24), limits, false).size());
    EXPECT_EQ(default_engine(context->device()), size.candidates[0].spec.kind); // the default is the first
}

TEST_F(WorkGroups, AnEngineWithAnotherPictureIsNotChosen) {
    // Lanes with a third of the light: fast, but wrong.
    namespace fs = std::filesystem;
    const fs::path folder = fs::temp_directory_path() / "clspeckle_test_group_shapes";
    fs::create_directories(folder / "fft/cpu");
    std::ifstream original(fs::path(CLSP_KERNEL_SOURCE_DIR) / "fft/cpu/rows_inverse.cl");
    std::string text{std::istreambuf_iterator<char>(original), {}};
    const std::string name = " float weight,";
    const std::size_t at = text.find(name, text.find("__kernel"));
    ASSERT_NE(std::string::npos, at);
    text.replace(at, name.size(), " float whole_weight,");
    const std::size_t body = text.find("{\n", at);
    text.insert(body + 2, "    const float weight = whole_weight / 3.0f;\n");
    std::ofstream(folder / "fft/cpu/rows_inverse.cl") << text;
    ContextParameters wrong;
    wrong.kernel_dir = folder.string();
    const TunedSize size = tune(Context::create(wrong), quick()).measured.sizes.at(0);
    fs::remove_all(folder);
    EXPECT_NE(EngineKind::kCpu, size.chosen.kind);
    for (const TunedCandidate &candidate : size.candidates) {
        EXPECT_EQ(candidate.spec.kind == EngineKind::kCpu, !candidate.counts()) << candidate.refusal;
        if (!candidate.counts()) {
            EXPECT_EQ("its picture differs from clfft's by 0.67 (relative L2)", candidate.refusal);
        }
    }
}

TEST(WorkGroupsAlone, SmallerOnesGetSmaller) {
    for (const std::uint32_t length : {60u, 512u, 1080u, 8192u}) {
        const LinePlan plan = make_gpu_plan(length);
        for (const bool across : {false, true}) {
            const auto first = choose_shape(plan, {512, 49152}, across);
            ASSERT_TRUE(first);
            std::optional<WorkGroupShape> shape = first;
            int steps = 0;
            for (std::uint32_t most = first->work_items(); shape; ++steps) {
                most = shape->work_items() - 1;
                const auto smaller = smaller_shape(plan, *shape, {most, 49152}, 1);
                if (smaller) {
                    EXPECT_LE(smaller->work_items(), most);
                    EXPECT_LE(gpu_tile_bytes(plan, *smaller), gpu_tile_bytes(plan, *shape));
                }
                shape = smaller;
            }
            EXPECT_LT(steps, 600);
            EXPECT_GT(steps, 1);
            // Memory, too: half of it, and none.
            const auto half = smaller_shape(plan, *first, {512, gpu_tile_bytes(plan, *first) / 2}, 1);
            if (half) {
                EXPECT_LE(gpu_tile_bytes(plan, *half), gpu_tile_bytes(plan, *first) / 2);
            }
            EXPECT_FALSE(smaller_shape(plan, *first, {512, 0}, 1));
        }
    }
}

// A line's points all in one work-item would waste no slot, and no compiler would ever be done with them.
TEST(WorkGroupsAlone, NobodyHoldsMoreThanMustBe) {
    for (std::uint32_t length = 64; length <= 4096; ++length) {
        std::uint32_t left = length;
        for (const std::uint32_t prime : {2u, 3u, 5u, 7u})
            while (left % prime == 0)
                left /= prime;
        if (left != 1)
            continue;
        const LinePlan plan = make_gpu_plan(length);
        // NVIDIA's driver gives a kernel 256 work-items where its device has 1024.
        const auto smaller = smaller_shape(plan, {8, 120, true, true}, {256, 49152}, 1);
        ASSERT_TRUE(smaller) << length;
        EXPECT_LE(points_per_item(plan, smaller->items), kMostPointsPerItem) << length;
        // Four rows that belong together have 64 each, and cannot do with fewer lines.
        const auto quarters = picked_shape(plan, {1024, 1 << 17}, false, {4, 0});
        ASSERT_TRUE(quarters) << length;
        EXPECT_LE(quarters->work_items(), kMostWorkItems);
        EXPECT_LE(points_per_item(plan, quarters->items), std::max(kMostPointsPerItem, length / 64 + 16)) << length;
        for (const bool across : {false, true}) {
            const auto chosen = choose_shape(plan, {1024, 49152}, across);
            ASSERT_TRUE(chosen) << length;
            EXPECT_LE(chosen->work_items(), kMostWorkItems);
            EXPECT_LE(points_per_item(plan, chosen->items), kMostPointsPerItem) << length;
        }
    }
}

} // namespace
