// Device memory of the library's own, counted in its context.
#pragma once

#include "runtime/buffer_memory.hpp"
#include "runtime/context.hpp"

#include <memory>
#include <utility>

namespace clsp {

class DeviceBuffer {
  public:
    DeviceBuffer() = default;
    // host_data: initial content, copied; nullptr leaves the memory uninitialised.
    DeviceBuffer(std::shared_ptr<Context> context, std::size_t bytes, const void *host_data = nullptr)
        : context_(std::move(context)), bytes_(bytes),
          buffer_(allocate_buffer(*context_, bytes, host_data)) {
        ++context_->memory_use().allocation_count;
        context_->memory_use().allocated_bytes += bytes_;
    }
    DeviceBuffer(DeviceBuffer &&other) noexcept { swap(other); }
    DeviceBuffer &operator=(DeviceBuffer &&other) noexcept {
        DeviceBuffer(std::move(other)).swap(*this);
        return *this;
    }
    DeviceBuffer(const DeviceBuffer &) = delete;
    DeviceBuffer &operator=(const DeviceBuffer &) = delete;
    ~DeviceBuffer() {
        if (context_) {
            --context_->memory_use().allocation_count;
            context_->memory_use().allocated_bytes -= bytes_;
        }
    }

    const cl::Buffer &get() const { return buffer_; }
    std::size_t bytes() const { return bytes_; }
    explicit operator bool() const { return context_ != nullptr; }

  private:
    void swap(DeviceBuffer &other) noexcept {
        std::swap(context_, other.context_);
        std::swap(bytes_, other.bytes_);
        std::swap(buffer_, other.buffer_);
    }

    std::shared_ptr<Context> context_;
    std::size_t bytes_ = 0;
    cl::Buffer buffer_;
};

} // namespace clsp
