// The requests of an Ouster driver at start, as the sensor answers them.
#include "drivers/lidar/ouster_api.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "protocols/lidar/lidar_model.h"

namespace narpa {
namespace {

using nlohmann::json;

class OusterApiTest : public ::testing::Test {
protected:
    OusterApi api_ = *OusterApi::create(find_lidar_make("os1-32")->configure_default()->metadata());

    HttpResponse get(const std::string& path, const std::string& query = "") {
        return api_.answer({.method = "GET", .path = "/api/v1/" + path, .query = query, .client = "192.0.2.7"});
    }
    HttpResponse post(const std::string& body) {
        return api_.answer(
            {.method = "POST", .path = "/api/v1/sensor/config", .body = body, .client = "192.0.2.7"});
    }
    json document(const std::string& path, const std::string& query = "") {
        const HttpResponse response = get(path, query);
        EXPECT_EQ(response.status, 200) << path << "?" << query << ": " << response.body;
        return json::parse(response.body);
    }
    void refuses(const HttpResponse& response, int status, const std::string& words) {
        EXPECT_EQ(response.status, status) << response.body;
        EXPECT_NE(json::parse(response.body)["error"].get<std::string>().find(words), std::string::npos)
            << response.body;
    }
};

TEST_F(OusterApiTest, StatesTheMetadataWholeAndInParts) {
    const json whole = document("sensor/metadata");
    EXPECT_EQ(whole["sensor_info"]["prod_line"], "OS-1-32");
    for (const char* part : {"sensor_info", "beam_intrinsics", "imu_intrinsics", "lidar_intrinsics",
                             "lidar_data_format", "calibration_status"}) {
        EXPECT_EQ(document(std::string("sensor/metadata/") + part), whole[part]);
        EXPECT_EQ(document(std::string("sensor/cmd/get_") + part), whole[part]) << "firmware before 2.4";
    }
    EXPECT_EQ(document("system/firmware")["fw"], whole["sensor_info"]["image_rev"]);
    EXPECT_EQ(document("sensor/config"), whole["config_params"]);
}

TEST_F(OusterApiTest, StagesAConfigurationUntilItStartsAnew) {
    EXPECT_EQ(api_.destination(), (OusterDestination{"", 7502}));
    EXPECT_EQ(get("sensor/cmd/set_udp_dest_auto").body, "{}");
    EXPECT_EQ(get("sensor/cmd/set_config_param", "args=udp_port_lidar+17502").body, "\"set_config_param\"");
    EXPECT_EQ(document("sensor/cmd/get_config_param", "args=staged+udp_dest"), "192.0.2.7");
    EXPECT_EQ(document("sensor/cmd/get_config_param", "args=active")["udp_dest"], "");
    EXPECT_EQ(api_.destination(), (OusterDestination{"", 7502}));
    EXPECT_EQ(get("sensor/cmd/reinitialize").body, "{}");
    EXPECT_EQ(api_.destination(), (OusterDestination{"192.0.2.7", 17502}));
    EXPECT_EQ(get("sensor/cmd/save_config_params").body, "{}");
    EXPECT_EQ(document("sensor/metadata")["config_params"]["udp_port_lidar"], 17502);
}

TEST_F(OusterApiTest, TakesAWholeConfigurationAtOnce) {
    json wanted = document("sensor/cmd/get_config_param", "args=active");
    wanted["udp_dest"] = "192.0.2.9";
    std::string encoded;  // as a driver does
    for (const char c : wanted.dump()) encoded += c == '"' ? "%22" : c == '{' ? "%7B" : std::string(1, c);
    EXPECT_EQ(get("sensor/cmd/set_config_param", "args=.+" + encoded).status, 200);
    EXPECT_EQ(get("sensor/cmd/reinitialize").status, 200);
    EXPECT_EQ(api_.destination(), (OusterDestination{"192.0.2.9", 7502}));

    EXPECT_EQ(post(R"({"udp_dest": "@auto", "udp_port_lidar": 9000, "lidar_mode": "1024x10"})").status, 200);
    EXPECT_EQ(api_.destination(), (OusterDestination{"192.0.2.7", 9000}));
    EXPECT_EQ(post(R"({"udp_dest": ""})").status, 200);
    EXPECT_EQ(api_.destination(), (OusterDestination{"", 9000}));
}

TEST_F(OusterApiTest, RefusesWhatTheSceneDecidesOnAndWhatIsWrong) {
    refuses(post(R"({"lidar_mode": "512x20"})"), 400, "lidar_mode: the emulated scene sets it to \"1024x10\"");
    refuses(post(R"({"udp_dest": "192.0.2.9", "operating_mode": "STANDBY"})"), 400, "operating_mode");
    EXPECT_EQ(api_.destination().address, "") << "all or none";
    refuses(post(R"({"udp_dest": "sensor.local"})"), 400, "udp_dest: expected an IPv4 address");
    refuses(post(R"({"udp_dest": 7})"), 400, "udp_dest: expected an IPv4 address");
    refuses(post(R"({"udp_port_lidar": 0})"), 400, "udp_port_lidar: expected a port");
    refuses(post(R"({"udp_port_lidar": 70000})"), 400, "udp_port_lidar: expected a port");
    refuses(post(R"({"udp_port_lidar": 99999999999999999999})"), 400, "udp_port_lidar: expected a port");
    refuses(post(R"({"color": "red"})"), 400, "'color' is unknown");
    refuses(post("[1]"), 400, "a JSON object");
    refuses(post("{"), 400, "not JSON");
    refuses(post(std::string(60'000, '[')), 400, "not JSON");
    refuses(get("sensor/cmd/set_config_param", "args=udp_dest"), 400, "a parameter, a space or + and its value");
    refuses(get("sensor/cmd/get_config_param", "args=last"), 400, "active or staged");
    refuses(get("sensor/cmd/get_config_param"), 400, "active or staged");
    refuses(get("sensor/cmd/fly"), 404, "no such command: fly");
    refuses(get("sensor/\xFF"), 404, "no such resource");
    refuses(api_.answer({.method = "DELETE", .path = "/api/v1/sensor/config"}), 405, "expected GET");
    refuses(api_.answer({.method = "GET", .path = ""}), 404, "no such resource");
}

TEST_F(OusterApiTest, MutatedRequestsAreAnswered) {
    const std::string good = R"({"udp_dest": "192.0.2.9", "udp_port_lidar": 9000, "azimuth_window": [0, 360000]})";
    std::mt19937 random(3);
    int taken = 0, refused = 0;
    for (int round = 0; round < 20'000; ++round) {
        std::string text = good;
        for (std::size_t n = 1 + random() % 3; n > 0; --n)
            text[random() % text.size()] = static_cast<char>(random());
        ++(post(text).status == 200 ? taken : refused);
        const int status = get("sensor/cmd/set_config_param", "args=" + text).status;
        ASSERT_TRUE(status == 200 || status == 400);
        const OusterDestination to = api_.destination();
        ASSERT_TRUE(to.port_lidar > 0 && to.address.size() < 16) << to.address;
    }
    EXPECT_GT(taken, 20);
    EXPECT_GT(refused, 1000);
}

TEST(OusterApi, NeedsTheMetadataOfSuchASensor) {
    for (const char* text : {"", "7", "{}", R"({"config_params": []})"})
        EXPECT_FALSE(OusterApi::create(text)) << text;
}

}  // namespace
}  // namespace narpa
