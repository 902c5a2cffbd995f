// Large arrays that are handed on instead of freed: between small things that stay, they would leave the heap full of
// holes, and every new one would be filled with zeros first.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>

namespace clsp {

// Thread-safe. Outlives its buffers.
template <typename T> class SpareBuffers {
  public:
    class Buffer {
      public:
        Buffer() = default;
        Buffer(Buffer &&other) noexcept { swap(other); }
        Buffer &operator=(Buffer &&other) noexcept {
            swap(other);
            return *this;
        }
        ~Buffer() {
            if (values_)
                owner_->give(std::move(*this));
        }
        T *data() { return values_.get(); }
        const T *data() const { return values_.get(); }
        std::size_t size() const { return size_; }
        bool empty() const { return size_ == 0; }

      private:
        friend class SpareBuffers;
        void swap(Buffer &other) noexcept {
            std::swap(owner_, other.owner_);
            std::swap(values_, other.values_);
            std::swap(size_, other.size_);
            std::swap(capacity_, other.capacity_);
        }
        SpareBuffers *owner_ = nullptr;
        std::unique_ptr<T[]> values_;
        std::size_t size_ = 0, capacity_ = 0;
    };

    // The values are whatever they are.
    Buffer take(std::size_t count) {
        Buffer buffer;
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            for (Spare &spare : spare_)
                if (spare.capacity >= count && (!buffer.values_ || spare.capacity < buffer.capacity_)) {
                    std::swap(buffer.values_, spare.values);
                    std::swap(buffer.capacity_, spare.capacity);
                }
        }
        if (!buffer.values_) {
            buffer.values_.reset(new T[count]);
            buffer.capacity_ = count;
        }
        buffer.owner_ = this;
        buffer.size_ = count;
        return buffer;
    }

  private:
    static constexpr std::size_t kMost = 8; // as many as workers
    struct Spare {
        std::unique_ptr<T[]> values;
        std::size_t capacity = 0;
    };
    // The smallest one goes where there are too many.
    void give(Buffer &&buffer) noexcept {
        Spare own{std::move(buffer.values_), buffer.capacity_};
        const std::lock_guard<std::mutex> lock(mutex_);
        for (Spare &spare : spare_)
            if (spare.capacity < own.capacity)
                std::swap(spare, own);
    }

    std::mutex mutex_;
    Spare spare_[kMost]; // the largest in front; empty: no values
};

} // namespace clsp
