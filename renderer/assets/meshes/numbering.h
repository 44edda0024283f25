/// renderer/assets/meshes/numbering.h - numbers for distinct keys.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

namespace narpa {

/// Gives equal keys the same number, counting from 0 in the order in which they first appear.
template <std::size_t N>
class Numbering {
public:
    using Key = std::array<std::uint32_t, N>;
    explicit Numbering(std::size_t expected) : slots_(std::bit_ceil(2 * expected + 16), kFree) {
        keys_.reserve(expected);
    }
    std::uint32_t number(const Key& key) {
        if (2 * (keys_.size() + 1) > slots_.size()) grow();
        std::uint32_t& slot = slots_[find(key)];
        if (slot == kFree) {
            slot = static_cast<std::uint32_t>(keys_.size());
            keys_.push_back(key);
        }
        return slot;
    }
    [[nodiscard]] const std::vector<Key>& keys() const { return keys_; }

private:
    static constexpr std::uint32_t kFree = 0xffff'ffffu;

    [[nodiscard]] std::size_t find(const Key& key) const {
        std::uint64_t h = 0x9e37'79b9'7f4a'7c15ull;
        for (const std::uint32_t word : key) h = (h ^ word) * 0xff51'afd7'ed55'8ccdull, h ^= h >> 32;
        std::size_t i = h & (slots_.size() - 1);
        while (slots_[i] != kFree && keys_[slots_[i]] != key) i = (i + 1) & (slots_.size() - 1);
        return i;
    }
    void grow() {
        slots_.assign(2 * slots_.size(), kFree);
        for (std::size_t k = 0; k < keys_.size(); ++k) slots_[find(keys_[k])] = static_cast<std::uint32_t>(k);
    }
    std::vector<std::uint32_t> slots_;
    std::vector<Key> keys_;
};

}  // namespace narpa
