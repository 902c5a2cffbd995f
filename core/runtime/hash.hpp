// Keys of what is kept. They tell things apart and find damage; against a forger helps who may write
// (cache_folder.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>

namespace clsp {

constexpr std::uint64_t kFnvBasis = 0xcbf29ce484222325u;

// FNV-1a of 64 bits, of what is also compared in full. Each value is added whole, whatever its size. hash: of what
// comes before.
template <typename T> std::uint64_t fnv1a(const T *values, std::size_t count, std::uint64_t hash = kFnvBasis) {
    for (std::size_t i = 0; i < count; ++i)
        hash = (hash ^ static_cast<std::make_unsigned_t<T>>(values[i])) * 0x100000001b3u;
    return hash;
}
inline std::uint64_t fnv1a(const std::string &text, std::uint64_t hash = kFnvBasis) {
    return fnv1a(text.data(), text.size(), hash);
}

// Two FNV-1a hashes of 64 bits over 8-byte words, from different bases, each finished by the mixer of splitmix64
// (Steele, Lea, Flood 2014).
class WideHash {
  public:
    void add(const void *data, std::size_t bytes) {
        const auto *from = static_cast<const unsigned char *>(data);
        add_word(bytes);
        for (; bytes >= sizeof(std::uint64_t); bytes -= sizeof(std::uint64_t), from += sizeof(std::uint64_t)) {
            std::uint64_t word;
            std::memcpy(&word, from, sizeof word);
            add_word(word);
        }
        std::uint64_t last = 0;
        if (bytes > 0) // nothing may be at nullptr
            std::memcpy(&last, from, bytes);
        add_word(last);
    }
    void add(double value) {
        static_assert(sizeof value == sizeof(std::uint64_t), "a word");
        add(&value, sizeof value);
    }
    std::array<std::uint64_t, 2> digest() const { return {mixed(a_), mixed(b_)}; }

  private:
    static std::uint64_t mixed(std::uint64_t z) {
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    void add_word(std::uint64_t word) {
        a_ = (a_ ^ word) * 0x100000001b3u;
        a_ ^= a_ >> 32; // words are added whole: the upper bits must come down
        b_ = (b_ ^ mixed(word)) * 0x100000001b3u;
        b_ ^= b_ >> 29;
    }
    std::uint64_t a_ = 0xcbf29ce484222325u, b_ = 0x9ae16a3b2f90404fu;
};

} // namespace clsp
