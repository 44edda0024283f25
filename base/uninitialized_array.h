/// base/uninitialized_array.h - a fixed-size array without initialisation: elements must be written before they are
/// read.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>

namespace narpa {

template <class T, std::size_t N>
class UninitializedArray {
public:
    T& operator[](std::size_t i) { return reinterpret_cast<T*>(bytes_)[i]; }
    const T& operator[](std::size_t i) const { return reinterpret_cast<const T*>(bytes_)[i]; }
    std::span<T> first(std::size_t n) { return {&(*this)[0], n}; }

private:
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
    alignas(64) std::byte bytes_[N * sizeof(T)];
};

}  // namespace narpa
