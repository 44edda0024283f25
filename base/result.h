/// base/result.h - a value or an error message that a person can act on.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <variant>

namespace narpa {

/// The kind of an error decides the exit status of the program (README, "Exit status").
enum class ErrorKind : std::uint8_t {
    failed,     ///< it ran, but a gate or a comparison failed: exit 1
    bad_input,  ///< a scene, mesh, trajectory, argument ... that cannot be used: exit 2
    missing,    ///< a device or a permission is missing: exit 3
};

/// `line` and `column` count from 1; 0 means "the file as a whole".
struct Error {
    std::string what;  ///< what is wrong and what was expected
    std::string file{};
    int line = 0, column = 0;
    ErrorKind kind = ErrorKind::bad_input;
    std::string remedy{};  ///< a command that fixes it, for `missing`

    /// `file:line:column: what`, without the parts that are unknown.
    [[nodiscard]] std::string text() const {
        std::string s;
        if (!file.empty()) {
            s = file;
            if (line > 0) s += ":" + std::to_string(line);
            if (line > 0 && column > 0) s += ":" + std::to_string(column);
            s += ": ";
        }
        s += what;
        if (!remedy.empty()) s += "\n  try: " + remedy;
        return s;
    }
};

/// The exit status of an error.
[[nodiscard]] constexpr int exit_status(ErrorKind kind) {
    switch (kind) {
        case ErrorKind::failed: return 1;
        case ErrorKind::bad_input: return 2;
        case ErrorKind::missing: return 3;
    }
    return 1;
}

/// A value or an Error; member names as in std::expected (C++23).
template <class T>
class [[nodiscard]] Result {
public:
    Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

    [[nodiscard]] bool has_value() const noexcept { return state_.index() == 0; }
    explicit operator bool() const noexcept { return has_value(); }

    T& operator*() & { return std::get<0>(state_); }
    const T& operator*() const& { return std::get<0>(state_); }
    T&& operator*() && { return std::get<0>(std::move(state_)); }
    T* operator->() { return &std::get<0>(state_); }
    const T* operator->() const { return &std::get<0>(state_); }
    [[nodiscard]] Error& error() { return std::get<1>(state_); }
    [[nodiscard]] const Error& error() const { return std::get<1>(state_); }

private:
    std::variant<T, Error> state_;
};

/// Success or an Error, where there is no value to return.
struct Ok {};
using Status = Result<Ok>;

}  // namespace narpa
