#include "stages/motion.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/pose.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

constexpr std::size_t kTableColumns = 5; // see kernels/stages/motion.cl
constexpr std::size_t kBodyFloats = 16;

// 1 / value in single precision; 0 for infinity, infinity for 0.
float reciprocal(double value) {
    return static_cast<float>(1.0 / value);
}

// R - I, t and the angle of R, as kernels take a rigid transform. Throws unless R is a rotation.
std::array<float, kBodyFloats> body_of(const double *pose, std::uint32_t index) {
    check_pose(pose, fmt::format("previous_from_current[{}]", index).c_str());
    const auto row = [&](int i) { return pose + 4 * i; };
    const double *a = row(0), *b = row(1), *c = row(2);
    std::array<float, kBodyFloats> body{};
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
            body[std::size_t(3 * i + j)] = static_cast<float>(row(i)[j] - (i == j ? 1.0 : 0.0));
        body[std::size_t(9 + i)] = static_cast<float>(row(i)[3]);
    }
    // sin and cos of the angle from the skew part and the trace: accurate for small angles, where the arc cosine is
    // not.
    const double sine = 0.5 * std::hypot(c[1] - b[2], a[2] - c[0], b[0] - a[1]);
    body[12] = static_cast<float>(std::atan2(sine, 0.5 * (a[0] + b[1] + c[2] - 1.0)));
    return body;
}

} // namespace

Motion::Motion(std::shared_ptr<Context> context, const MotionParameters &p)
    : context_(std::move(context)), parameters_(p), bad_pixels_(context_), bad_materials_(context_) {
    check_image_size(p.width, p.height, "the image");
    if (p.fx_px != 0.0 || p.fy_px != 0.0) {
        check_positive(p.fx_px, "fx_px");
        check_positive(p.fy_px, "fy_px");
    }
    if (!(std::abs(p.cx_px) <= kLargestNumber && std::abs(p.cy_px) <= kLargestNumber))
        throw Error(Status::kInvalidArgument,
                    fmt::format("cx_px is {} and cy_px is {}, they must be finite", p.cx_px, p.cy_px));
    check_not_negative(p.replace_threshold, "replace_threshold");
    check_not_negative(p.occlusion_tolerance, "occlusion_tolerance");
    if (p.materials && p.materials->context()->cl_context()() != context_->cl_context()())
        throw Error(Status::kWrongContext, "materials belongs to another context than the motion");
    const std::vector<Material> materials = p.materials ? p.materials->materials() : std::vector<Material>(1);
    material_count_ = static_cast<cl_uint>(materials.size());
    std::vector<float> table;
    table.reserve(materials.size() * kTableColumns);
    for (const Material &m : materials) {
        table.insert(table.end(),
                     {reciprocal(m.lateral_correlation_length_m), reciprocal(m.axial_correlation_length_m),
                      reciprocal(m.rotation_correlation_angle_rad), reciprocal(m.correlation_time_s), 0.0f});
        lives_ = lives_ || m.correlation_time_s < std::numeric_limits<double>::infinity();
    }
    table_ = DeviceBuffer(context_, table.size() * sizeof(float), table.data());
}

Motion::Views Motion::resolve(const MotionInput &input, bool with_shift) const {
    const ::cl_context cl_context = context_->cl_context()();
    const ImageSize size{parameters_.width, parameters_.height};
    const auto take = [&](const ImageDescription &image, const char *name, std::initializer_list<Format> formats) {
        return image ? check_image(image, name, cl_context, size, formats) : ImageView{};
    };
    const auto fail = [](const char *message) { throw Error(Status::kInvalidArgument, message); };
    const auto vectors = {Format::kFloat32x3, Format::kFloat32x4};
    check_not_negative(input.frame_time_s, "frame_time_s");
    if (static_cast<bool>(input.position) == static_cast<bool>(input.depth))
        fail(input.position ? "input has both position and depth; give one of them"
                            : "input has neither position nor depth; one of them is needed");
    if (input.previous_position && input.previous_depth)
        fail("input has both previous_position and previous_depth; give one of them");
    if ((input.transform_count == 0) != (input.previous_from_current == nullptr))
        fail(input.previous_from_current
                 ? "transform_count is 0 but previous_from_current is not NULL; give both or neither"
                 : "previous_from_current is NULL but transform_count is not 0; give both or neither");
    if (input.transform_count > 0 && input.motion)
        fail("input has both previous_from_current and motion; give one of them");
    Views in{};
    const bool has_history = input.previous_position || input.previous_depth;
    if (input.motion) {
        if (!has_history)
            fail("motion needs the previous frame's previous_depth or previous_position, to find how far points moved "
                 "and what "
                 "was hidden");
        in.mode = Mode::kMotionVectors;
    } else if (input.transform_count > 0) {
        if (input.transform_count != 1 && input.transform_count != material_count_)
            throw Error(Status::kInvalidArgument,
                        fmt::format("transform_count is {}, expected 1 (one rigid motion) or {} (one for "
                                    "each material of the table)",
                                    input.transform_count, material_count_));
        in.mode = input.transform_count == 1 ? Mode::kOneTransform : Mode::kTransforms;
        if (in.mode == Mode::kTransforms && !input.material)
            fail("transform_count is that of the materials, but input has no material image to choose by");
        if (input.previous_normal)
            fail("input has both previous_from_current, which says how surfaces turned, and previous_normal; leave out "
                 "the latter");
    } else if (input.previous_position) {
        in.mode = Mode::kPreviousPosition;
        if (input.previous_material)
            fail("previous_material is the previous frame's own image, but previous_position without motion goes with "
                 "the point; "
                 "leave it out");
    } else {
        fail("input does not say how surfaces moved: give previous_position, previous_from_current, or motion with the "
             "previous "
             "frame's depth");
    }
    in.has_position = static_cast<bool>(input.position);
    in.point = in.has_position ? take(input.position, "input->position", vectors)
                               : take(input.depth, "input->depth", {Format::kFloat32});
    in.material = take(input.material, "input->material", {Format::kUint8});
    in.motion = take(input.motion, "input->motion", {Format::kFloat32x2});
    if (in.mode == Mode::kPreviousPosition) {
        in.previous = take(input.previous_position, "input->previous_position", vectors);
    } else if (has_history) {
        in.history_position = static_cast<bool>(input.previous_position);
        in.history = in.history_position ? take(input.previous_position, "input->previous_position", vectors)
                                         : take(input.previous_depth, "input->previous_depth", {Format::kFloat32});
    }
    if (input.previous_material) {
        if (!in.history || !in.material)
            fail("previous_material needs material, and the previous frame's previous_depth or previous_position");
        in.old_material = take(input.previous_material, "input->previous_material", {Format::kUint8});
    }
    // Transforms say how a surface turned; a normal of the pattern's G-buffers may lie along.
    if (input.normal)
        in.normal = take(input.normal, "input->normal", vectors);
    if (input.previous_normal) {
        if (!in.normal)
            fail("previous_normal needs normal");
        in.old_normal = take(input.previous_normal, "input->previous_normal", vectors);
    } else {
        in.normal = {};
    }
    in.roll = input.roll_from_motion;
    if (in.roll && in.mode != Mode::kMotionVectors)
        fail("roll_from_motion needs motion");
    if (parameters_.fx_px == 0.0 && (!in.has_position || with_shift || in.history))
        fail("fx_px and fy_px are 0; depth images, motion vectors, shifts and the previous frame's images need the "
             "focal "
             "length in pixels (fx_px, fy_px, cx_px, cy_px of ClspMotionDesc)");
    if (in.mode == Mode::kOneTransform || in.mode == Mode::kTransforms)
        for (std::uint32_t i = 0; i < input.transform_count; ++i)
            body_of(input.previous_from_current + std::size_t{12} * i, i);
    return in;
}

cl::Kernel &Motion::kernel_for(const Views &in, const OutputViews &out) {
    const auto flag = [](bool value) { return value ? 1 : 0; };
    std::string options = fmt::format(
        "-DMODE={} -DHAS_POSITION={} -DDEPTH_ALONG_RAY={} -DHAS_MATERIAL={} -DHAS_HISTORY={} -DHISTORY_POSITION={} "
        "-DHISTORY_MATERIAL={} -DHAS_NORMALS={} -DROLL={} -DOUT_PATH={} -DOUT_CORRELATION={} -DOUT_SHIFT={} "
        "-DOUT_DISPLACEMENT={} -DOUT_MASK={}",
        static_cast<int>(in.mode), flag(in.has_position), flag(parameters_.depth_kind == DepthKind::kAlongRay),
        flag(static_cast<bool>(in.material)), flag(static_cast<bool>(in.history)), flag(in.history_position),
        flag(static_cast<bool>(in.old_material)), flag(static_cast<bool>(in.old_normal)), flag(in.roll),
        flag(static_cast<bool>(out.path)), flag(static_cast<bool>(out.correlation)), flag(static_cast<bool>(out.shift)),
        flag(static_cast<bool>(out.displacement)), flag(static_cast<bool>(out.mask)));
    const auto found = kernels_.find(options);
    if (found != kernels_.end())
        return found->second;
    cl::Kernel kernel = context_->kernel("stages/motion.cl", "motion_compute", options);
    return kernels_.emplace(std::move(options), std::move(kernel)).first->second;
}

void Motion::upload_transforms(CommandChain &chain, const MotionInput &input) {
    // The caller's memory is free after the call, and nothing waits: the copy lives until the device has it.
    auto bodies = std::make_unique<std::vector<float>>();
    bodies->reserve(input.transform_count * kBodyFloats);
    for (std::uint32_t i = 0; i < input.transform_count; ++i) {
        const auto body = body_of(input.previous_from_current + std::size_t{12} * i, i);
        bodies->insert(bodies->end(), body.begin(), body.end());
    }
    chain.run_foreign("motion", [&](cl_uint num_waits, const cl_event *waits, cl_event *event) {
        cl_event written = nullptr;
        check_opencl(clEnqueueWriteBuffer(chain.queue(), transforms_.get()(), CL_FALSE, 0,
                                          bodies->size() * sizeof(float), bodies->data(), num_waits, waits, &written),
                     "clEnqueueWriteBuffer");
        const auto free_copy = [](cl_event, cl_int, void *copy) { delete static_cast<std::vector<float> *>(copy); };
        const cl_int code = clSetEventCallback(written, CL_COMPLETE, free_copy, bodies.get());
        if (code == CL_SUCCESS)
            bodies.release();
        else
            clWaitForEvents(1, &written);
        if (event)
            *event = written;
        else
            clReleaseEvent(written);
        check_opencl(code, "clSetEventCallback");
    });
}

void Motion::run(CommandChain &chain, const MotionInput &input, const Views &in, const OutputViews &out) {
    cl::Kernel &kernel = kernel_for(in, out);
    if (in.mode == Mode::kTransforms)
        upload_transforms(chain, input);
    KernelArguments arguments(kernel);
    arguments.add(cl_uint{parameters_.width}).add(cl_uint{parameters_.height});
    arguments.add(cl_float4{{static_cast<float>(parameters_.fx_px), static_cast<float>(parameters_.fy_px),
                             static_cast<float>(parameters_.cx_px), static_cast<float>(parameters_.cy_px)}});
    arguments.add(static_cast<cl_float>(input.frame_time_s))
        .add(static_cast<cl_float>(parameters_.replace_threshold))
        .add(static_cast<cl_float>(parameters_.occlusion_tolerance));
    const auto add_point = [&](const ImageView &view, bool is_vector) {
        arguments.add(view);
        if (is_vector)
            arguments.add(cl_uint{component_count(view.format)});
    };
    add_point(in.point, in.has_position);
    if (in.material)
        arguments.add(in.material);
    arguments.add(table_.get()).add(material_count_);
    if (in.mode == Mode::kOneTransform) {
        const auto body = body_of(input.previous_from_current, 0);
        cl_float16 argument{};
        std::copy(body.begin(), body.end(), argument.s);
        arguments.add(argument);
    } else if (in.mode == Mode::kTransforms) {
        arguments.add(transforms_.get());
    } else if (in.mode == Mode::kMotionVectors) {
        arguments.add(in.motion);
    } else {
        add_point(in.previous, true);
    }
    if (in.history)
        add_point(in.history, in.history_position);
    if (in.old_material)
        arguments.add(in.old_material);
    if (in.old_normal) {
        add_point(in.normal, true);
        add_point(in.old_normal, true);
    }
    for (const ImageView *image : {&out.path, &out.correlation, &out.shift, &out.displacement, &out.mask})
        if (*image)
            arguments.add(*image);
    arguments.add(bad_pixels_.buffer()).add(bad_materials_.buffer());
    chain.run("motion", kernel, parameters_.width, parameters_.height);
}

void Motion::make_own_images() {
    const std::size_t pixels = std::size_t{parameters_.width} * parameters_.height;
    const auto make = [&](DeviceBuffer &buffer, bool wanted, std::size_t bytes) {
        if (wanted && !buffer)
            buffer = DeviceBuffer(context_, pixels * bytes);
    };
    const bool correlates = parameters_.rule == MotionRule::kCorrelate;
    make(path_, correlates, sizeof(cl_float));
    make(correlation_, correlates && lives_, sizeof(cl_float));
    make(mask_, !correlates, sizeof(cl_uchar));
    make(shift_, parameters_.translate, sizeof(cl_float2));
}

Motion::OutputViews Motion::own_images() const {
    const auto view = [&](const DeviceBuffer &buffer, Format format, const char *name) {
        if (!buffer)
            return ImageView{};
        return check_image({buffer.get()(), 0, 0, parameters_.width, parameters_.height, format}, name,
                           context_->cl_context()(), {0, 0}, {format});
    };
    OutputViews out;
    out.path = view(path_, Format::kFloat32, "path");
    out.correlation = view(correlation_, Format::kFloat32, "correlation");
    out.shift = view(shift_, Format::kFloat32x2, "shift");
    out.mask = view(mask_, Format::kUint8, "mask");
    return out;
}

void Motion::check(const MotionInput &input) {
    const Views in = resolve(input, parameters_.translate);
    make_own_images();
    if (in.mode == Mode::kTransforms && !transforms_)
        transforms_ = DeviceBuffer(context_, material_count_ * kBodyFloats * sizeof(float));
    kernel_for(in, own_images());
}

PhaseAdvance Motion::enqueue_compute(CommandChain &chain, const MotionInput &input) {
    check(input);
    run(chain, input, resolve(input, parameters_.translate), own_images());
    return advance();
}

PhaseAdvance Motion::advance() const {
    const OutputViews out = own_images();
    PhaseAdvance advance;
    advance.path = out.path;
    advance.correlation = out.correlation;
    advance.shift = out.shift;
    advance.mask = out.mask;
    return advance;
}

void Motion::enqueue_compute(CommandChain &chain, const MotionInput &input, const MotionOutput &output) {
    const Views in = resolve(input, static_cast<bool>(output.shift));
    struct Named {
        ImageView view;
        const char *name;
    };
    const auto take = [&](const ImageDescription &image, const char *name, Format format) {
        if (!image)
            return Named{{}, name};
        const ImageView view =
            check_image(image, name, context_->cl_context()(), {parameters_.width, parameters_.height}, {format});
        check_writable(view, name);
        return Named{view, name};
    };
    const std::array<Named, 5> outputs{take(output.path, "output->path", Format::kFloat32),
                                       take(output.correlation, "output->correlation", Format::kFloat32),
                                       take(output.shift, "output->shift", Format::kFloat32x2),
                                       take(output.displacement, "output->displacement", Format::kFloat32x3),
                                       take(output.mask, "output->mask", Format::kUint8)};
    if (std::none_of(outputs.begin(), outputs.end(), [](const Named &out) { return static_cast<bool>(out.view); }))
        throw Error(Status::kInvalidArgument,
                    "output has no image; give at least one of path, correlation, shift, displacement and mask");
    const std::array<Named, 8> inputs{{{in.point, "the position or depth of the input"},
                                       {in.normal, "input->normal"},
                                       {in.material, "input->material"},
                                       {in.motion, "input->motion"},
                                       {in.previous, "input->previous_position"},
                                       {in.history, "the previous position or depth of the input"},
                                       {in.old_material, "input->previous_material"},
                                       {in.old_normal, "input->previous_normal"}}};
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        for (const Named &image : inputs)
            refuse_overlap(outputs[i].view, outputs[i].name, image.view, image.name);
        for (std::size_t j = 0; j < i; ++j)
            refuse_overlap(outputs[i].view, outputs[i].name, outputs[j].view, outputs[j].name);
    }
    if (in.mode == Mode::kTransforms && !transforms_)
        transforms_ = DeviceBuffer(context_, material_count_ * kBodyFloats * sizeof(float));
    run(chain, input, in, {outputs[0].view, outputs[1].view, outputs[2].view, outputs[3].view, outputs[4].view});
}

void Motion::check_bad_pixels(cl_command_queue queue) {
    context_->check_queue(queue);
    check_opencl(clFinish(queue), "clFinish");
    const std::uint32_t width = parameters_.width;
    std::string message;
    if (const BadPixels bad = bad_pixels_.take(queue); bad.not_finite > 0)
        message = fmt::format(
            "{} surface pixels whose previous position, motion or normal is not a finite number since the last "
            "check, the first at x = {}, y = {}; they were taken as moved",
            bad.not_finite, bad.first_index % width, bad.first_index / width);
    if (const BadPixels bad = bad_materials_.take(queue); bad.negative > 0)
        message += fmt::format(
            "{}{} pixels with a material id outside of the table (it has {}) since the last check, the first at "
            "x = {}, y = {}; they took the first entry",
            message.empty() ? "" : "; ", bad.negative, material_count_, bad.first_index % width,
            bad.first_index / width);
    if (!message.empty())
        throw Error(Status::kInvalidData, message);
}

} // namespace clsp
