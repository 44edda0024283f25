/// renderer/assets/meshes/equal_keys.h - finds equal keys among many.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

namespace narpa {

/// For each of the items 0 to n - 1, the least item that has the same key. `key(i)`: std::array of std::uint32_t;
/// n is below 2^32.
///
/// Items are first sorted by the upper bits of a hash of their key into buckets of a few thousand, whose tables
/// stay in the processor's cache; the buckets are then done in parallel. The result does not depend on the number
/// of threads.
template <class KeyOf>
class EqualKeys {
public:
    EqualKeys(std::size_t n, const KeyOf& key)
        : n_(n),
          key_(key),
          bits_(static_cast<unsigned>(std::bit_width(n / kBucket))),
          buckets_(std::size_t{1} << bits_),
          block_((n + kBlocks - 1) / kBlocks),
          blocks_(block_ == 0 ? 0 : (n + block_ - 1) / block_),
          starts_(blocks_ * buckets_ + 1, 0),
          items_(n) {}

    std::vector<std::uint32_t> least_of_each() {
        for_blocks([&](std::size_t block, std::size_t i) { ++start(block, bucket_of(hash(i))); });
        std::uint32_t sum = 0;
        for (std::size_t bucket = 0; bucket < buckets_; ++bucket)
            for (std::size_t block = 0; block < blocks_; ++block) {
                const std::uint32_t count = start(block, bucket);
                start(block, bucket) = sum;
                sum += count;
            }
        for_blocks([&](std::size_t block, std::size_t i) {
            const std::uint64_t h = hash(i);
            items_[start(block, bucket_of(h))++] = {static_cast<std::uint32_t>(h), static_cast<std::uint32_t>(i)};
        });
        // Now start(last block, bucket) is the bucket's end.
        std::vector<std::uint32_t> least(n_);
        tbb::parallel_for(std::size_t{0}, n_ == 0 ? 0 : buckets_, [&](std::size_t bucket) {
            const std::size_t begin = bucket == 0 ? 0 : start(blocks_ - 1, bucket - 1);
            match(begin, start(blocks_ - 1, bucket), least);
        });
        return least;
    }

private:
    static constexpr std::size_t kBucket = 4096, kBlocks = 64;
    static constexpr std::uint32_t kFree = 0xffff'ffffu;
    struct Item {
        std::uint32_t hash, index;
    };

    [[nodiscard]] std::uint64_t hash(std::size_t i) const {
        std::uint64_t h = 0x9e37'79b9'7f4a'7c15ull;
        for (const std::uint32_t word : key_(i)) h = (h ^ word) * 0xff51'afd7'ed55'8ccdull, h ^= h >> 32;
        return h;
    }
    /// By the upper bits; the lower ones are of the bucket's table.
    [[nodiscard]] std::size_t bucket_of(std::uint64_t h) const { return bits_ == 0 ? 0 : h >> (64 - bits_); }
    std::uint32_t& start(std::size_t block, std::size_t bucket) { return starts_[block * buckets_ + bucket]; }

    void for_blocks(const auto& f) {
        tbb::parallel_for(std::size_t{0}, blocks_, [&](std::size_t block) {
            for (std::size_t i = block * block_, end = std::min(n_, i + block_); i < end; ++i) f(block, i);
        });
    }

    /// Items of a bucket are in increasing order.
    void match(std::size_t begin, std::size_t end, std::vector<std::uint32_t>& least) const {
        std::vector<std::uint32_t> slots(std::bit_ceil(2 * (end - begin) + 16), kFree);
        for (std::size_t at = begin; at < end; ++at) {
            const auto [h, index] = items_[at];
            std::size_t slot = h & (slots.size() - 1);
            while (slots[slot] != kFree && !is_equal(items_[slots[slot] + begin], items_[at]))
                slot = (slot + 1) & (slots.size() - 1);
            if (slots[slot] == kFree) slots[slot] = static_cast<std::uint32_t>(at - begin);
            least[index] = items_[slots[slot] + begin].index;
        }
    }
    [[nodiscard]] bool is_equal(const Item& a, const Item& b) const {
        return a.hash == b.hash && key_(a.index) == key_(b.index);
    }

    std::size_t n_;
    const KeyOf& key_;
    unsigned bits_;
    std::size_t buckets_, block_, blocks_;
    std::vector<std::uint32_t> starts_;
    std::vector<Item> items_;
};

template <class KeyOf>
std::vector<std::uint32_t> least_equal(std::size_t n, const KeyOf& key) {
    return EqualKeys<KeyOf>(n, key).least_of_each();
}

}  // namespace narpa
