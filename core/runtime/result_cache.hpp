// Results that are kept in a context for the next time that the same is asked: the least recently used goes first.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace clsp {

class ResultCache {
  public:
    explicit ResultCache(std::uint64_t capacity_bytes) : capacity_bytes_(capacity_bytes) {}

    // nullptr if it is not there. The key says what T is.
    template <typename T> std::shared_ptr<const T> find(const std::string &key) {
        const std::lock_guard<std::mutex> lock(mutex_);
        for (auto entry = entries_.begin(); entry != entries_.end(); ++entry)
            if (entry->key == key) {
                entries_.splice(entries_.begin(), entries_, entry);
                return std::static_pointer_cast<const T>(entries_.front().result);
            }
        return nullptr;
    }

    void keep(const std::string &key, std::shared_ptr<const void> result, std::uint64_t bytes) {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (bytes > capacity_bytes_)
            return;
        for (const Entry &entry : entries_)
            if (entry.key == key) // two threads computed it at once
                return;
        entries_.push_front({key, std::move(result), bytes});
        held_bytes_ += bytes;
        while (held_bytes_ > capacity_bytes_) {
            held_bytes_ -= entries_.back().bytes;
            entries_.pop_back();
        }
    }

  private:
    struct Entry {
        std::string key;
        std::shared_ptr<const void> result;
        std::uint64_t bytes;
    };
    std::mutex mutex_;
    std::uint64_t capacity_bytes_, held_bytes_ = 0;
    std::list<Entry> entries_;
};

} // namespace clsp
