/// drivers/lidar/ouster_api.h - the HTTP API through which drivers query and configure an Ouster sensor: requests
/// to responses, without the network.
///
/// At start a driver reads the firmware's version and the active configuration, sets where packets go, restarts the
/// sensor, and reads the metadata. Requests that would change settings of the scene (mode, profile, window) are
/// refused with a reason. Source: Ouster, Firmware User Manual, "HTTP API Reference"; protocols/lidar/README.md
/// lists the requests.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "drivers/http/http_server.h"

namespace narpa {

/// Where a sensor sends its packets to.
struct OusterDestination {
    std::string address{};  ///< IPv4; empty: nowhere
    std::uint16_t port_lidar = 0;

    friend bool operator==(const OusterDestination&, const OusterDestination&) = default;
};

/// Used by one thread at a time.
class OusterApi {
public:
    /// `metadata`: LidarModel::metadata(). Error: not the metadata of an Ouster sensor.
    static Result<OusterApi> create(const std::string& metadata);
    OusterApi(OusterApi&&) noexcept;
    ~OusterApi();

    [[nodiscard]] HttpResponse answer(const HttpRequest& request);
    /// The destination in the active configuration.
    [[nodiscard]] OusterDestination destination() const;

private:
    struct State;
    explicit OusterApi(std::unique_ptr<State> state);

    [[nodiscard]] HttpResponse command(const std::string& name, const HttpRequest& request);
    [[nodiscard]] HttpResponse get_config(const std::string& arguments) const;
    [[nodiscard]] HttpResponse set_config(const std::string& arguments, const std::string& client);
    [[nodiscard]] HttpResponse post_config(const HttpRequest& request);

    std::unique_ptr<State> state_;
};

}  // namespace narpa
