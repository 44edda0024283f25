#include "drivers/lidar/ouster_api.h"

#include <arpa/inet.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>

#include "base/text/read_number.h"

namespace narpa {
namespace {

using nlohmann::json;

constexpr std::string_view kMetadata = "/api/v1/sensor/metadata", kConfig = "/api/v1/sensor/config",
                           kCommand = "/api/v1/sensor/cmd/", kFirmware = "/api/v1/system/firmware";
/// Answers of firmware 2.4: drivers compare some of them verbatim.
const json kDone = json::object(), kWasSet = "set_config_param";

HttpResponse ok(const json& document) {
    return {.status = 200, .body = document.dump()};
}

HttpResponse refused(int status, const std::string& words) {
    // What a client sent need not be UTF-8.
    return {.status = status, .body = json{{"error", words}}.dump(-1, ' ', false, json::error_handler_t::replace)};
}

std::string_view without_slash(std::string_view path) {
    while (path.size() > 1 && path.ends_with('/')) path.remove_suffix(1);
    return path;
}

/// "args=active" of a query.
std::string argument_of(const std::string& query) {
    constexpr std::string_view key = "args=";
    for (std::size_t at = 0; at < query.size();) {
        const std::size_t end = std::min(query.find('&', at), query.size());
        const std::string_view part = std::string_view(query).substr(at, end - at);
        if (part.starts_with(key)) return decode_query(part.substr(key.size()));
        at = end + 1;
    }
    return {};
}

bool is_ipv4(const std::string& text) {
    in_addr ignored{};
    return ::inet_pton(AF_INET, text.c_str(), &ignored) == 1;
}

/// The value in the text of a request: parsed as JSON if it is JSON, else the text itself.
json value_of(const std::string& text) {
    json value = json::parse(text, nullptr, false);
    return value.is_discarded() ? json(text) : value;
}

/// Sets a parameter. Returns what is wrong with it.
std::optional<std::string> set(json& config, std::string key, const json& value, const std::string& client) {
    if (key == "udp_ip") key = "udp_dest";  // its name before firmware 2
    if (!config.contains(key)) return "parameter '" + key + "' is unknown";
    if (key == "udp_dest") {
        if (value == "@auto") {
            config[key] = client;
            return std::nullopt;
        }
        if (!value.is_string() || !(value.get_ref<const std::string&>().empty() || is_ipv4(value)))
            return "udp_dest: expected an IPv4 address, or an empty text";
        config[key] = value;
        return std::nullopt;
    }
    if (key == "udp_port_lidar" || key == "udp_port_imu") {
        if (!value.is_number_integer() || value < 1 || value > 65535) return key + ": expected a port, 1 to 65535";
        config[key] = value.get<int>();
        return std::nullopt;
    }
    if (config[key] != value) return key + ": the emulated scene sets it to " + config[key].dump();
    return std::nullopt;
}

/// Sets all parameters of an object, or none.
std::optional<std::string> set_all(json& config, const json& values, const std::string& client) {
    if (!values.is_object()) return "expected a JSON object of parameters";
    json changed = config;
    for (const auto& [key, value] : values.items())
        if (auto wrong = set(changed, key, value, client)) return wrong;
    config = std::move(changed);
    return std::nullopt;
}

}  // namespace

struct OusterApi::State {
    json metadata;
    json staged;  ///< configuration that takes effect when the sensor restarts
    [[nodiscard]] json& active() { return metadata.at("config_params"); }
};

OusterApi::OusterApi(std::unique_ptr<State> state) : state_(std::move(state)) {}
OusterApi::OusterApi(OusterApi&&) noexcept = default;
OusterApi::~OusterApi() = default;

Result<OusterApi> OusterApi::create(const std::string& metadata) {
    auto state = std::make_unique<State>();
    state->metadata = json::parse(metadata, nullptr, false);
    const json& m = state->metadata;
    const auto has = [&](const char* section, const char* key) {
        return m.is_object() && m.contains(section) && m[section].is_object() && m[section].contains(key);
    };
    if (!has("config_params", "udp_dest") || !has("config_params", "udp_port_lidar") ||
        !has("config_params", "udp_port_imu") || !has("sensor_info", "image_rev"))
        return Error{"the LiDAR has no metadata of an Ouster sensor, expected a model os1-..."};
    state->staged = state->active();
    return OusterApi(std::move(state));
}

OusterDestination OusterApi::destination() const {
    const json& config = state_->active();
    return {config.at("udp_dest"), config.at("udp_port_lidar")};
}

HttpResponse OusterApi::answer(const HttpRequest& request) {
    const std::string_view path = without_slash(request.path);
    if (path == kConfig && request.method == "POST") return post_config(request);
    if (request.method != "GET") return refused(405, "expected GET, or POST of " + std::string(kConfig));
    if (path == kFirmware) return ok({{"fw", state_->metadata["sensor_info"]["image_rev"]}});
    if (path == kConfig) return ok(request.query == "staged" ? state_->staged : state_->active());
    if (path == kMetadata) return ok(state_->metadata);
    if (path.starts_with(kMetadata) && path[kMetadata.size()] == '/') {
        const std::string section(path.substr(kMetadata.size() + 1));
        if (state_->metadata.contains(section)) return ok(state_->metadata[section]);
    }
    if (path.starts_with(kCommand)) return command(std::string(path.substr(kCommand.size())), request);
    return refused(404, "no such resource: " + std::string(path));
}

HttpResponse OusterApi::command(const std::string& name, const HttpRequest& request) {
    constexpr std::string_view get = "get_";
    if (name == "get_config_param") return get_config(argument_of(request.query));
    if (name == "set_config_param") return set_config(argument_of(request.query), request.client);
    if (name == "set_udp_dest_auto") {
        state_->staged["udp_dest"] = request.client;
        return ok(kDone);
    }
    if (name == "reinitialize" || name == "save_config_params") {
        if (name == "reinitialize") state_->active() = state_->staged;
        return ok(kDone);
    }
    // Firmware before 2.4 has one command for each part of the metadata.
    if (name.starts_with(get) && state_->metadata.contains(name.substr(get.size())))
        return ok(state_->metadata[name.substr(get.size())]);
    return refused(404, "no such command: " + name);
}

/// "active", "staged", "active udp_dest"
HttpResponse OusterApi::get_config(const std::string& arguments) const {
    const std::size_t space = std::min(arguments.find(' '), arguments.size());
    const std::string which = arguments.substr(0, space),
                      key = arguments.substr(std::min(space + 1, arguments.size()));
    if (which != "active" && which != "staged") return refused(400, "args: expected active or staged");
    const json& config = which == "active" ? state_->active() : state_->staged;
    if (key.empty()) return ok(config);
    return config.contains(key) ? ok(config[key]) : refused(400, "parameter '" + key + "' is unknown");
}

/// "udp_port_lidar 7502", or ". {...}" for several
HttpResponse OusterApi::set_config(const std::string& arguments, const std::string& client) {
    const std::size_t space = arguments.find(' ');
    if (space == arguments.npos) return refused(400, "args: expected a parameter, a space or + and its value");
    const std::string key = arguments.substr(0, space);
    const json value = value_of(arguments.substr(space + 1));
    const auto wrong = set_all(state_->staged, key == "." ? value : json{{key, value}}, client);
    return wrong ? refused(400, *wrong) : ok(kWasSet);
}

HttpResponse OusterApi::post_config(const HttpRequest& request) {
    const json values = json::parse(request.body, nullptr, false);
    if (values.is_discarded()) return refused(400, "the request's body is not JSON");
    if (const auto wrong = set_all(state_->staged, values, request.client)) return refused(400, *wrong);
    state_->active() = state_->staged;
    return ok(state_->active());
}

}  // namespace narpa
