/// renderer/mesh_reader/stored_number.h - numbers in the bytes of a file, in this machine's byte order.
#pragma once

#include <cstring>

namespace narpa {

template <class T>
double stored_number(const char* bytes) {
    T x;
    std::memcpy(&x, bytes, sizeof x);
    return static_cast<double>(x);
}

}  // namespace narpa
