// What the tests of stages share: calls of Enqueue functions, and what each function must refuse.
#ifndef CLSPECKLE_STAGE_SUPPORT_HPP
#define CLSPECKLE_STAGE_SUPPORT_HPP

#include "test_support.hpp"

#include <type_traits>
#include <utility>

namespace test {

// Sides that no image has.
inline const std::vector<std::uint32_t> bad_sides = {0u, 16385u, 0xffffffffu};

// Values that a member must not have, and what is no number.
inline std::vector<double> bad(std::vector<double> values = {}) {
    values.insert(values.end(), {nan_value, infinity, -infinity});
    return values;
}

// A function's name and the function.
#define CLSP_NAMED(function) #function, function

// Checks what calls of one function gave, one after the other.
class Failures {
  public:
    explicit Failures(std::string function) : function_(std::move(function)) { poison_last_error(function_); }

    void operator()(ClspStatus expected, const std::string &words, ClspStatus got) const {
        EXPECT_TRUE(failed_as(function_, got, expected, words)) << words;
        poison_last_error(function_);
    }

  private:
    std::string function_;
};

// How a function takes a struct that is valid but for one change.
template <typename Struct> class Refusals {
  public:
    // `call` runs the function on a struct; returns its status.
    Refusals(std::string function, const Struct &valid, std::function<ClspStatus(Struct *)> call)
        : function_(std::move(function)), valid_(valid), call_(std::move(call)) {}

    template <typename Change, typename = std::enable_if_t<!std::is_member_pointer_v<Change>>>
    void operator()(const std::string &words, Change change, ClspStatus expected = CLSP_ERROR_INVALID_ARGUMENT) const {
        Struct changed = valid_;
        change(changed);
        poison_last_error(function_);
        EXPECT_TRUE(failed_as(function_, call_(&changed), expected, words)) << words;
    }
    // Each of the values in one member.
    template <typename T>
    void operator()(const std::string &words, T Struct::*member, const std::vector<std::decay_t<T>> &values,
                    ClspStatus expected = CLSP_ERROR_INVALID_ARGUMENT) const {
        for (const T &value : values)
            (*this)(
                words, [&](Struct &s) { s.*member = value; }, expected);
    }
    void check_struct_size() const { test::check_struct_size<Struct>(function_, valid_, call_); }
    // One of its images, and what the message calls it.
    void check_image(const clspeckle::Context &context, const std::string &name, ClspImage Struct::*member,
                     std::uint32_t wrong_format, bool optional = true) const {
        const auto with = [&](const ClspImage *image) {
            Struct changed = valid_;
            changed.*member = *image;
            return call_(&changed);
        };
        check_image_rules(function_, context, valid_.*member, name, wrong_format, with, optional);
        check_image_size_must_match(function_, context, valid_.*member, name, with);
    }

  private:
    std::string function_;
    Struct valid_;
    std::function<ClspStatus(Struct *)> call_;
};

// The C functions that each stage has.
template <typename Handle> struct Functions;
#define CLSP_STAGE(Name, called)                                                                                       \
    template <> struct Functions<Clsp##Name> {                                                                         \
        using Desc = Clsp##Name##Desc;                                                                                 \
        static constexpr const char *word = called;                                                                    \
        static constexpr const char *init_name = "clsp" #Name "DescInit", *create_name = "clsp" #Name "Create",        \
                                    *retain_name = "clsp" #Name "Retain", *release_name = "clsp" #Name "Release";      \
        static constexpr auto init = clsp##Name##DescInit;                                                             \
        static constexpr auto create = clsp##Name##Create;                                                             \
        static constexpr auto retain = clsp##Name##Retain;                                                             \
        static constexpr auto release = clsp##Name##Release;                                                           \
    };
CLSP_STAGE(Aperture, "aperture")
CLSP_STAGE(Depth, "depth")
CLSP_STAGE(Dots, "dots")
CLSP_STAGE(Lens, "lens")
CLSP_STAGE(Motion, "motion")
CLSP_STAGE(Pattern, "pattern")
CLSP_STAGE(Phase, "phase")
CLSP_STAGE(Pipeline, "pipeline")
CLSP_STAGE(Sensor, "sensor")
#undef CLSP_STAGE

class EnqueueTest : public DeviceTest {
  protected:
    // Calls an Enqueue function, to which queue, wait list and event are added.
    template <typename... Parameters, typename First, typename... Rest>
    static ClspStatus enqueue_on(cl_command_queue queue, cl_uint count, const cl_event *events, cl_event *event,
                                 ClspStatus (*function)(Parameters...), First &&first, Rest &&...rest) {
        return function(std::forward<First>(first), queue, std::forward<Rest>(rest)..., count, events, event);
    }
    template <typename... Parameters, typename... Arguments>
    ClspStatus enqueue(ClspStatus (*function)(Parameters...), Arguments &&...arguments) {
        return enqueue_on(queue, 0, nullptr, nullptr, function, std::forward<Arguments>(arguments)...);
    }
    // check_enqueue(CLSP_NAMED(clspSomethingEnqueue), arguments without queue, wait list and event)
    template <typename Function, typename... Arguments>
    void check_enqueue(const char *name, Function function, const Arguments &...arguments) {
        check_enqueue_rules(name, context,
                            [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                return enqueue_on(q, count, events, event, function, arguments...);
                            });
    }
    // An image argument, whose size is given by the stage. `call` runs the function on an image.
    void check_image(const char *function, const std::string &name, const ClspImage &valid, std::uint32_t wrong_format,
                     const std::function<ClspStatus(const ClspImage *)> &call, bool optional = false) {
        check_image_rules(function, context, valid, name, wrong_format, call, optional);
        check_image_size_must_match(function, context, valid, name, call);
    }
    // What `call` writes into an image.
    template <typename T = float, typename Call>
    std::vector<T> written(std::uint32_t width, std::uint32_t height, std::uint32_t format, Call call) {
        auto image = make_image(width, height, format);
        call(image.view);
        return download<T>(image);
    }
    // Runs a frame once, then often: it takes no memory and builds no program.
    template <typename Frame> void check_allocates_nothing(Frame frame) {
        frame();
        const ClspContextInfo before = context.info();
        for (int i = 0; i < 20; ++i)
            frame();
        const ClspContextInfo after = context.info();
        EXPECT_EQ(before.allocation_count, after.allocation_count);
        EXPECT_EQ(before.allocated_bytes, after.allocated_bytes);
        EXPECT_EQ(before.programs_built, after.programs_built);
    }
};

// Tests of one kind of stage; valid() describes one.
template <typename Handle> class StageTest : public EnqueueTest {
  protected:
    using Calls = Functions<Handle>;
    using Desc = typename Calls::Desc;

    virtual Desc valid() const = 0;

    // Checks the Init function; gives the defaults.
    static Desc checked_defaults() {
        check_init<Desc>(Calls::init_name, Calls::init);
        Desc desc;
        EXPECT_CLSP_OK(Calls::init(&desc, sizeof(desc)));
        return desc;
    }
    // Checks what Create says to NULL and to structs of other sizes; gives what tries descriptions.
    Refusals<Desc> check_create(const Desc &desc) {
        Handle made = nullptr;
        const Failures fails(Calls::create_name);
        fails(CLSP_ERROR_INVALID_HANDLE, "context", Calls::create(nullptr, &desc, &made));
        fails(CLSP_ERROR_INVALID_ARGUMENT, "desc", Calls::create(context, nullptr, &made));
        fails(CLSP_ERROR_INVALID_ARGUMENT, Calls::word, Calls::create(context, &desc, nullptr));
        const Refusals<Desc> refuses(Calls::create_name, desc, [this](Desc *d) {
            Handle stage = nullptr;
            const ClspStatus status = Calls::create(context, d, &stage);
            EXPECT_EQ(status == CLSP_SUCCESS, stage != nullptr);
            Calls::release(stage);
            return status;
        });
        refuses.check_struct_size();
        return refuses;
    }
    // Checks how Retain and Release count. `name` and `use`: a function and a call of it that works on a live handle.
    void check_references(const char *name, const std::function<ClspStatus(Handle)> &use) {
        Handle stage = nullptr;
        const Desc desc = valid();
        ASSERT_CLSP_OK(Calls::create(context, &desc, &stage));
        EXPECT_CLSP_OK(Calls::retain(stage));
        EXPECT_CLSP_OK(Calls::release(stage));
        EXPECT_CLSP_OK(use(stage));
        queue.finish();
        EXPECT_CLSP_OK(Calls::release(stage));
        const auto fails = [](const char *function, const std::function<ClspStatus(Handle)> &call, Handle handle) {
            const Failures failures(function);
            failures(CLSP_ERROR_INVALID_HANDLE, Calls::word, call(handle));
        };
        fails(name, use, stage);
        fails(name, use, nullptr);
        fails(Calls::retain_name, Calls::retain, stage);
        fails(Calls::release_name, Calls::release, stage);
        fails(Calls::retain_name, Calls::retain, nullptr);
        fails(Calls::retain_name, Calls::retain, reinterpret_cast<Handle>(context.get())); // a handle of another kind
        EXPECT_CLSP_OK(Calls::release(nullptr));
    }
};

} // namespace test

#endif // CLSPECKLE_STAGE_SUPPORT_HPP
