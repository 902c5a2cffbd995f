#include "status.hpp"

namespace clsp::capi {
namespace {

static_assert(static_cast<int>(Status::kInternal) == CLSP_ERROR_INTERNAL, "Status and CLSP_ERROR_* must agree");
static_assert(static_cast<int>(Status::kNoDevice) == CLSP_ERROR_NO_DEVICE, "Status and CLSP_ERROR_* must agree");
static_assert(static_cast<int>(Status::kCancelled) == CLSP_ERROR_CANCELLED, "Status and CLSP_ERROR_* must agree");

} // namespace

LastError &last_error() noexcept {
    thread_local LastError error;
    return error;
}

ClspStatus record(const char *function, const Error &error) noexcept {
    LastError &last = last_error();
    last.status = static_cast<std::int32_t>(error.status());
    last.opencl_code = error.opencl_code();
    last.function = function;
    try {
        last.message = error.what();
        last.build_log = error.build_log();
    } catch (...) {
        last.message.clear(); // no memory for the words; status and function still tell
        last.build_log.clear();
    }
    return last.status;
}

} // namespace clsp::capi
