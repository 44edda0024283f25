// The HTTP server of emulated devices: requests in pieces, bad ones, slow and huge ones.
#include "drivers/http/http_server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <atomic>
#include <random>
#include <string>

namespace narpa {
namespace {

using ReadState = HttpRequestReader::State;

struct ReadRequest {
    ReadState state;
    HttpRequest request;
    int status;
};

/// In pieces of so many bytes.
ReadRequest read_in_pieces(const std::string& text, std::size_t piece) {
    HttpRequestReader reader;
    ReadState state = ReadState::more;
    for (std::size_t at = 0; at < text.size(); at += piece)
        state = reader.take(std::string_view(text).substr(at, piece));
    return {state, reader.request(), reader.status()};
}

TEST(HttpRequest, IsReadHoweverItArrives) {
    const std::string text =
        "POST /api/v1%2Fsensor/config?args=a+b%20c HTTP/1.1\r\nHost: x\r\ncontent-LENGTH:  11 \r\n\r\nhello world";
    for (std::size_t piece = 1; piece <= text.size() + 1; ++piece) {
        const ReadRequest read = read_in_pieces(text, piece);
        ASSERT_EQ(read.state, ReadState::complete) << piece;
        EXPECT_EQ(read.request.method, "POST");
        EXPECT_EQ(read.request.path, "/api/v1/sensor/config");
        EXPECT_EQ(read.request.query, "args=a+b%20c");
        EXPECT_EQ(read.request.body, "hello world");
        EXPECT_EQ(read_in_pieces(text.substr(0, text.size() - 1), piece).state, ReadState::more) << piece;
    }
    EXPECT_EQ(decode_query("a+b%20c%zz%2"), "a b c%zz%2");
    EXPECT_EQ(read_in_pieces("GET / HTTP/1.0\r\n\r\nand more", 4).state, ReadState::complete);
}

TEST(HttpRequest, BadOnesAreRefusedWithTheirStatus) {
    const std::pair<std::string, int> cases[] = {
        {"\r\n\r\n", 400},
        {"GET\r\n\r\n", 400},
        {"GET /\r\n\r\n", 400},
        {"GET / HTTQ/1.1\r\n\r\n", 400},
        {"GET http://x/ HTTP/1.1\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nno colon\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nContent-Length: 99999999999999999999999\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nContent-Length: 65537\r\n\r\n", 413},
        {"GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", 501},
        {"GET /" + std::string(HttpRequestReader::kHeadBytesMost, 'a'), 431},
        {std::string(HttpRequestReader::kHeadBytesMost + 1, '\0'), 431},
    };
    for (const auto& [text, status] : cases)
        for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{4096}}) {
            const ReadRequest read = read_in_pieces(text, piece);
            EXPECT_EQ(read.state, ReadState::refused) << text.substr(0, 60);
            EXPECT_EQ(read.status, status) << text.substr(0, 60);
        }
}

TEST(HttpRequest, MutatedOnesAreBounded) {
    const std::string good =
        "POST /api?x=%41 HTTP/1.1\r\nContent-Length: 20\r\nExpect: 100-continue\r\n\r\n" + std::string(20, 'b');
    std::mt19937 random(5);
    std::size_t complete = 0, refused = 0;
    for (int round = 0; round < 20'000; ++round) {
        std::string text = good;
        for (std::size_t n = 1 + random() % 3; n > 0; --n)
            text[random() % text.size()] = static_cast<char>(random());
        const ReadRequest read = read_in_pieces(text, 1 + random() % 64);
        complete += read.state == ReadState::complete ? 1 : 0;
        refused += read.state == ReadState::refused ? 1 : 0;
        ASSERT_LE(read.request.body.size(), HttpRequestReader::kBodyBytesMost);
    }
    EXPECT_GT(complete, 1000u);
    EXPECT_GT(refused, 1000u);
}

class HttpServerTest : public ::testing::Test {
protected:
    void SetUp() override {
        for (std::uint16_t port = 21'000; port < 21'400 && !server_; ++port) {
            auto server = HttpServer::start("127.0.0.1", port, [this](const HttpRequest& r) {
                ++handled_;
                if (r.path == "/throw") throw std::runtime_error("on purpose");
                return HttpResponse{.body = r.method + " " + r.path + " from " + r.client + " " +
                                            std::to_string(r.body.size())};
            });
            port_ = port;
            if (server) server_ = *std::move(server);
        }
        ASSERT_TRUE(server_);
    }

    [[nodiscard]] Descriptor connected() const {
        Descriptor fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_port = htons(port_);
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::connect(fd.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
        return fd;
    }
    static void send(const Descriptor& fd, std::string_view text) {
        while (!text.empty()) {
            const ssize_t n = ::send(fd.get(), text.data(), text.size(), MSG_NOSIGNAL);
            if (n <= 0) return;
            text.remove_prefix(static_cast<std::size_t>(n));
        }
    }
    static std::string rest(const Descriptor& fd) {
        std::string all;
        char bytes[512];
        for (ssize_t n = 0; (n = ::recv(fd.get(), bytes, sizeof bytes, 0)) > 0;)
            all.append(bytes, static_cast<std::size_t>(n));
        return all;
    }
    [[nodiscard]] std::string exchanged(std::string_view text) const {
        const Descriptor fd = connected();
        send(fd, text);
        return rest(fd);
    }

    std::uint16_t port_ = 0;
    std::atomic<int> handled_{0};
    std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, AnswersAndCloses) {
    const std::string answer = exchanged("GET /a/b?c HTTP/1.1\r\n\r\n");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n")) << answer;
    EXPECT_TRUE(answer.ends_with("\r\n\r\nGET /a/b from 127.0.0.1 0")) << answer;
    EXPECT_NE(answer.find("Content-Length: 25\r\n"), std::string::npos) << answer;
    EXPECT_TRUE(exchanged("GET /throw HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 500")) << "and the server goes on";
    EXPECT_TRUE(exchanged("GET / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 200"));
    EXPECT_EQ(handled_, 3);
}

TEST_F(HttpServerTest, SendsContinueToThoseThatWaitForIt) {
    const Descriptor fd = connected();
    send(fd, "POST / HTTP/1.1\r\nContent-Length: 3\r\nExpect: 100-continue\r\n\r\n");
    std::string first(25, '\0');
    ASSERT_EQ(::recv(fd.get(), first.data(), first.size(), MSG_WAITALL), 25);
    EXPECT_EQ(first, "HTTP/1.1 100 Continue\r\n\r\n");
    send(fd, "abc");
    EXPECT_TRUE(rest(fd).ends_with("POST / from 127.0.0.1 3"));
}

TEST_F(HttpServerTest, RefusesHugeRequestsAndTheirSendersGetTheAnswer) {
    const std::string huge = "POST / HTTP/1.1\r\nContent-Length: 100000000\r\n\r\n" + std::string(1'000'000, 'x');
    EXPECT_TRUE(exchanged(huge).starts_with("HTTP/1.1 413"));
    EXPECT_TRUE(exchanged("GET /" + std::string(1'000'000, 'a') + " HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 431"));
    EXPECT_EQ(handled_, 0);
}

/// Clients that hold all connections and send nothing are dropped after a time; then the next one is served.
TEST_F(HttpServerTest, SilentClientsDoNotHoldItForever) {
    std::vector<Descriptor> silent;
    for (std::size_t i = 0; i < HttpServer::kConnections; ++i) silent.push_back(connected());
    EXPECT_TRUE(exchanged("GET / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 200"));
    for (const Descriptor& fd : silent) EXPECT_TRUE(rest(fd).starts_with("HTTP/1.1 408"));
}

TEST_F(HttpServerTest, SlowOnesDoNotDelayOthers) {
    const Descriptor slow = connected();
    send(slow, "GET / HT");
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(exchanged("GET / HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 200"));
    send(slow, "TP/1.1\r\n\r\n");
    EXPECT_TRUE(rest(slow).starts_with("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, SaysWhatIsWrongWithItsAddress) {
    const auto handler = [](const HttpRequest&) { return HttpResponse{}; };
    const auto taken = HttpServer::start("127.0.0.1", port_, handler);
    ASSERT_FALSE(taken);
    EXPECT_NE(taken.error().what.find("Address already in use"), std::string::npos) << taken.error().what;
    const auto name = HttpServer::start("sensor.local", port_, handler);
    ASSERT_FALSE(name);
    EXPECT_NE(name.error().what.find("expected an IPv4 address"), std::string::npos) << name.error().what;
}

}  // namespace
}  // namespace narpa
