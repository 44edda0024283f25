/// base/vec3.h - three numbers: a position, a direction, or linear radiance in three bands.
#pragma once

#include <cmath>

namespace narpa {

template <class T>
struct Vec {
    T x{}, y{}, z{};

    constexpr T& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
    constexpr const T& operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
    constexpr Vec operator-() const { return {-x, -y, -z}; }
    constexpr Vec& operator+=(const Vec& b) { return *this = *this + b; }
    constexpr Vec& operator-=(const Vec& b) { return *this = *this - b; }
    constexpr Vec& operator*=(T s) { return *this = *this * s; }

    friend constexpr Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend constexpr Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend constexpr Vec operator*(const Vec& a, const Vec& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
    friend constexpr Vec operator*(const Vec& a, T s) { return {a.x * s, a.y * s, a.z * s}; }
    friend constexpr Vec operator*(T s, const Vec& a) { return a * s; }
    friend constexpr Vec operator/(const Vec& a, T s) { return a * (T(1) / s); }
    friend constexpr Vec operator/(const Vec& a, const Vec& b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
    friend constexpr bool operator==(const Vec&, const Vec&) = default;
};

template <class T>
constexpr T dot(const Vec<T>& a, const Vec<T>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr Vec<T> cross(const Vec<T>& a, const Vec<T>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T norm(const Vec<T>& a) {
    return std::sqrt(dot(a, a));
}
template <class T>
Vec<T> normalized(const Vec<T>& a) {
    return a / norm(a);
}
/// Mean of the three bands, as a monochrome sensor weighs them.
template <class T>
constexpr T mean_band(const Vec<T>& a) {
    return (a.x + a.y + a.z) / 3;
}
template <class T>
bool is_finite(const Vec<T>& a) {
    return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
template <class To, class From>
constexpr Vec<To> vec_cast(const Vec<From>& a) {
    return {static_cast<To>(a.x), static_cast<To>(a.y), static_cast<To>(a.z)};
}

using Vec3 = Vec<double>;  ///< positions in metres and directions: double up to the tracer
using Vec3f = Vec<float>;  ///< inside one body's frame, where float is enough
using Rgb = Vec<float>;    ///< x, y, z = red, green, blue band

}  // namespace narpa
