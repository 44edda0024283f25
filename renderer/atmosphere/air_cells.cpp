#include "renderer/atmosphere/air_cells.h"

#include <cstring>
#include <type_traits>

namespace narpa {
namespace {

constexpr auto kRelaxed = std::memory_order_relaxed;

/// Cheaper than mixed(); like it, it depends on the order of the words.
std::uint64_t chained(std::uint64_t hash, std::uint64_t word) {
    return (hash ^ word) * 0x9e3779b97f4a7c15u + (hash >> 29);
}

std::size_t words_of(const AirCell& cell) {
    return cell.differs != 0 ? 0 : cell.layers * AirCell::kLayer * sizeof(AirLight) / sizeof(std::uint64_t);
}
template <class Cell>
auto* bytes_of(Cell& cell) {
    using Byte = std::conditional_t<std::is_const_v<Cell>, const std::byte, std::byte>;
    return reinterpret_cast<Byte*>(&cell.nodes);
}

}  // namespace

bool AirCache::find(std::uint64_t key, AirCell& cell) const noexcept {
    const Entry& entry = entries_[key % kEntries];
    const std::uint64_t check = entry.check.load(kRelaxed), head = entry.head.load(kRelaxed);
    cell.layers = static_cast<std::uint32_t>(head);
    cell.differs = static_cast<std::uint32_t>(head >> 32);
    if (check == 0 || words_of(cell) > entry.words.size()) return false;
    std::uint64_t hash = chained(key, head);
    for (std::size_t i = 0; i < words_of(cell); ++i) {
        const std::uint64_t word = entry.words[i].load(kRelaxed);
        std::memcpy(bytes_of(cell) + i * sizeof word, &word, sizeof word);
        hash = chained(hash, word);
    }
    return hash == check;
}

void AirCache::store(std::uint64_t key, const AirCell& cell) noexcept {
    Entry& entry = entries_[key % kEntries];
    const std::uint64_t head = cell.layers | static_cast<std::uint64_t>(cell.differs) << 32;
    std::uint64_t hash = chained(key, head);
    entry.head.store(head, kRelaxed);
    for (std::size_t i = 0; i < words_of(cell); ++i) {
        std::uint64_t word;
        std::memcpy(&word, bytes_of(cell) + i * sizeof word, sizeof word);
        entry.words[i].store(word, kRelaxed);
        hash = chained(hash, word);
    }
    entry.check.store(hash, kRelaxed);
}

}  // namespace narpa
