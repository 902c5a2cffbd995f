// Numbers that took long to come by, kept in case they are asked for again.
#pragma once

#include "simulator/simulator.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory_resource>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace clsp {

// What they depend on, to the bit.
class MemoKey {
  public:
    // kind: what the numbers are, where others depend on the same.
    MemoKey &add_kind(char kind);
    MemoKey &add(std::uint64_t value);
    MemoKey &add(double value);
    MemoKey &add(const std::vector<EffectSetting> &effects);
    const std::string &bytes() const { return bytes_; }

  private:
    std::string bytes_;
};

// Thread-safe.
class Memo {
  public:
    // At most about that many bytes are kept; when there are more, it begins anew.
    explicit Memo(std::size_t most_bytes);
    // What make() gave when it was asked for this key before. make: gives the same for the same key; called without a
    // lock.
    std::vector<double> value(const MemoKey &key, const std::function<std::vector<double>()> &make);

  private:
    using Values = std::pmr::unordered_map<std::pmr::string, std::pmr::vector<double>>;

    const std::size_t most_bytes_;
    std::mutex mutex_;
    // Small things that stay, between large ones that come and go, would keep the heap from ever shrinking: they have
    // memory of their own, in large pieces.
    std::pmr::monotonic_buffer_resource memory_;
    std::optional<Values> values_;
    std::size_t bytes_ = 0;
};

} // namespace clsp
