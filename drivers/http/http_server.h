/// drivers/http/http_server.h - a small HTTP server on a thread of its own, as embedded devices have one.
///
/// One request a connection. All is bounded: kConnections at once (more wait in the kernel), the size of a request,
/// and kExchange_ns from accepting a connection to its end, however slowly its client sends or reads.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "base/result.h"
#include "drivers/descriptor.h"
#include "drivers/http/http_request.h"

namespace narpa {

struct HttpResponse {
    int status = 200;
    std::string body{};
    const char* type = "application/json";
};

/// Called on the server's thread, one request after the other.
using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

class HttpServer {
public:
    static constexpr std::size_t kConnections = 16;
    static constexpr std::int64_t kExchange_ns = 5'000'000'000;

    /// Listens at an IPv4 address. Errors: not an address; in use; not permitted.
    static Result<std::unique_ptr<HttpServer>> start(const std::string& address, std::uint16_t port,
                                                     HttpHandler handler);
    ~HttpServer();
    HttpServer(const HttpServer&) = delete;
    HttpServer& operator=(const HttpServer&) = delete;

private:
    class Connection;

    HttpServer(Descriptor listening, Descriptor end, HttpHandler handler);
    void run() noexcept;
    void accept_one();

    Descriptor listening_, end_;
    HttpHandler handler_;
    std::vector<Connection> connections_;
    std::thread thread_;
};

}  // namespace narpa
