/// drivers/http/http_request.h - a request of HTTP/1.1 (RFC 9112) as it arrives, piece by piece.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace narpa {

struct HttpRequest {
    std::string method{};  ///< "GET"
    std::string path{};    ///< "/api/v1/sensor/metadata"; %xx decoded
    std::string query{};   ///< what follows the question mark, as sent
    std::string body{};
    std::string client{};  ///< the sender's IPv4 address, "192.0.2.7"
};

/// Decodes %xx and + in a query. A malformed %xx stays as it is.
[[nodiscard]] std::string decode_query(std::string_view text);

/// Collects the bytes of one request. Memory is bounded: kHeadBytesMost and kBodyBytesMost.
class HttpRequestReader {
public:
    static constexpr std::size_t kHeadBytesMost = 16 << 10, kBodyBytesMost = 64 << 10;

    enum class State : unsigned char { more, complete, refused };

    /// Takes the next bytes; those after a whole request are dropped.
    State take(std::string_view bytes);
    [[nodiscard]] const HttpRequest& request() const noexcept { return request_; }
    /// HTTP status code of a refused request, and a sentence for its sender.
    [[nodiscard]] int status() const noexcept { return status_; }
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }
    /// True, once, when the head has arrived and the client waits for "100 Continue" before it sends the body.
    [[nodiscard]] bool wants_continue() noexcept;

private:
    State refuse(int status, std::string reason);
    State read_head(std::size_t end);
    State read_field(std::string_view line);

    HttpRequest request_;
    std::string text_;  ///< the head until it is whole
    bool has_head_ = false, continue_ = false;
    std::size_t body_bytes_ = 0;
    State state_ = State::more;
    int status_ = 0;
    std::string reason_;
};

}  // namespace narpa
