#include "inference/memo.hpp"

namespace clsp {
namespace {

constexpr std::size_t kFirstPiece = std::size_t{1} << 20;

template <typename Value> void append(std::string &bytes, const Value &value) {
    bytes.append(reinterpret_cast<const char *>(&value), sizeof value);
}

} // namespace

MemoKey &MemoKey::add_kind(char kind) {
    bytes_ += kind;
    return *this;
}

MemoKey &MemoKey::add(std::uint64_t value) {
    append(bytes_, value);
    return *this;
}

MemoKey &MemoKey::add(double value) {
    append(bytes_, value);
    return *this;
}

MemoKey &MemoKey::add(const std::vector<EffectSetting> &effects) {
    add(std::uint64_t{effects.size()});
    for (const EffectSetting &effect : effects) {
        add(std::uint64_t{effect.id.size()});
        bytes_ += effect.id;
        add(std::uint64_t{effect.values.size()});
        for (const double value : effect.values)
            add(value);
    }
    return *this;
}

Memo::Memo(std::size_t most_bytes) : most_bytes_(most_bytes), memory_(kFirstPiece) {
    values_.emplace(&memory_);
}

std::vector<double> Memo::value(const MemoKey &key, const std::function<std::vector<double>()> &make) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        const auto known = values_->find(std::pmr::string(key.bytes()));
        if (known != values_->end())
            return {known->second.begin(), known->second.end()};
    }
    const std::vector<double> made = make();
    const std::size_t bytes = key.bytes().size() + made.size() * sizeof(double) + 128; // and what the map needs
    const std::lock_guard<std::mutex> lock(mutex_);
    if (bytes_ + bytes > most_bytes_) {
        values_.reset();
        memory_.release();
        values_.emplace(&memory_);
        bytes_ = 0;
    }
    if (values_->try_emplace(std::pmr::string(key.bytes()), made.begin(), made.end()).second)
        bytes_ += bytes;
    return made;
}

} // namespace clsp
