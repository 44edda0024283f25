// The slcan hub against clients of every manner: the text on the wire is spelled out here.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <random>
#include <thread>

#include "drivers/can/client_hub.h"
#include "drivers/descriptor.h"
#include "tests/drivers/can_support.h"

namespace narpa {
namespace {

/// A bare socket or terminal that sends the bytes of the test.
class Wire {
public:
    explicit Wire(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        ::fcntl(fd_.get(), F_SETFL, O_NONBLOCK);
    }
    explicit Wire(const std::string& pty) : fd_(::open(pty.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
        EXPECT_TRUE(fd_);
    }
    void say(std::string_view text) {
        ASSERT_EQ(::write(fd_.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
    }
    /// Everything that has come by the time the hub has answered with `end`.
    std::string hear(CanBus& hub, std::string_view end) {
        std::string text;
        turn_until(hub, [&] {
            for (bool more = true; more;) {  // as long as reading makes room for what the hub has queued
                ReceivedFrame out;
                while (hub.receive(out)) frames.push_back(out.frame);
                std::array<char, 4096> part;
                more = false;
                for (ssize_t n = 0; (n = ::read(fd_.get(), part.data(), part.size())) > 0; more = true)
                    text.append(part.data(), static_cast<std::size_t>(n));
            }
            return text.ends_with(end);
        });
        return text;
    }
    /// The hub has hung up.
    bool hung_up(CanBus& hub) {
        return turn_until(hub, [&] {
            ReceivedFrame out;
            (void)hub.receive(out);
            char c = 0;
            return ::read(fd_.get(), &c, 1) == 0;
        });
    }
    int fd() const { return fd_.get(); }
    std::vector<CanFrame> frames{};  ///< what the hub has received meanwhile

private:
    Descriptor fd_;
};

std::uint64_t clients_left(CanBus& bus) {
    return bus.clients()->clients_left();
}

class SlcanHub : public testing::Test {
protected:
    std::unique_ptr<CanBus> hub_ = open_or_fail("slcan:0", CanRole::hub);
    std::uint16_t port_ = hub_port(*hub_);
};

TEST_F(SlcanHub, AnswersAsLawicelDoes) {
    for (const bool pty : {false, true}) {
        Wire w = pty ? Wire(hub_pty(*hub_)) : Wire(port_);
        w.say("C\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "\r");
        w.say("S6\rO\r");
        EXPECT_EQ(w.hear(*hub_, "\r\r"), "\r\r");
        w.say("V\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "V1013\r");
        w.say("N\r");
        EXPECT_EQ(w.hear(*hub_, "\r").size(), 6u);
        w.say("F\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "F00\r");
        w.say("t1232AABB\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "z\r");
        w.say("T000001232AABB\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "Z\r");
        w.say("r1232\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "z\r");
        w.say("R000001232\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "Z\r");
        w.say("nonsense\r");
        EXPECT_EQ(w.hear(*hub_, "\a"), "\a");
        w.say("C\r");
        EXPECT_EQ(w.hear(*hub_, "\r"), "\r");
        w.say("t1232AABB\r");
        EXPECT_EQ(w.hear(*hub_, "\a"), "\a") << "the channel is closed";
        EXPECT_EQ(w.frames.size(), 4u);
    }
    EXPECT_EQ(hub_->counters().malformed, 4u);
}

TEST_F(SlcanHub, AListenerHearsAndSendsNothing) {
    Wire w(port_);
    w.say("S6\rY5\rL\r");
    EXPECT_EQ(w.hear(*hub_, "\r\r\r"), "\r\r\r");
    EXPECT_TRUE(hub_->send(can_frame(0x123, {0xAA})));
    EXPECT_EQ(w.hear(*hub_, "\r"), "t1231AA\r");
    w.say("t1232AABB\r");
    EXPECT_EQ(w.hear(*hub_, "\a"), "\a");
    EXPECT_TRUE(w.frames.empty());
    w.say("O\rt1232AABB\r");
    EXPECT_EQ(w.hear(*hub_, "z\r"), "\rz\r");
}

TEST_F(SlcanHub, CanFdGoesToClientsThatTakeIt) {
    Wire sender(port_), told(port_), classic(port_);
    told.say("Y5\rO\r");
    EXPECT_EQ(told.hear(*hub_, "\r\r"), "\r\r");
    classic.say("S6\rO\r");
    EXPECT_EQ(classic.hear(*hub_, "\r\r"), "\r\r");
    const std::string eight = "d10F8" + std::string(16, '1') + "\r",
                      all = "B0000010FF" + std::string(128, 'A') + "\r";
    sender.say("O\r" + eight + all);
    EXPECT_EQ(sender.hear(*hub_, "\rz\rZ\r"), "\rz\rZ\r");
    EXPECT_EQ(told.hear(*hub_, all), eight + all);
    ASSERT_EQ(sender.frames.size(), 2u);
    EXPECT_TRUE(sender.frames[0].fd && !sender.frames[0].bit_rate_switch && !sender.frames[0].extended);
    EXPECT_TRUE(sender.frames[1].fd && sender.frames[1].bit_rate_switch && sender.frames[1].extended);
    EXPECT_EQ(sender.frames[1].size, 64);
    // A client that has sent one takes them too. The hub's own are padded to a length that CAN FD has.
    EXPECT_TRUE(hub_->send(fd_frame(0x123, std::vector<std::uint8_t>(9, 0x22), true)));
    const std::string nine = "b1239" + std::string(18, '2') + "000000\r";
    EXPECT_EQ(sender.hear(*hub_, nine), nine);
    EXPECT_EQ(told.hear(*hub_, nine), nine);
    EXPECT_TRUE(hub_->send(can_frame(0x124, {0xAA})));
    EXPECT_EQ(classic.hear(*hub_, "t1241AA\r"), "t1241AA\r") << "and no line of CAN FD before";
    EXPECT_EQ(hub_->counters().malformed + hub_->counters().not_carried + hub_->counters().send_drops, 0u);
}

TEST_F(SlcanHub, ListensAtTheAddressThatItIsGiven) {
    EXPECT_EQ(hub_->description().find("warning"), std::string::npos);
    const auto elsewhere = open_or_fail("slcan:127.0.0.2:0", CanRole::hub);
    const std::string bus = elsewhere->address().bus;
    EXPECT_TRUE(elsewhere->description().starts_with("slcan: 127.0.0.2:")) << elsewhere->description();
    // Any machine may reach it: said, because slcan has no authentication.
    const auto open = open_or_fail("slcan:0.0.0.0:0", CanRole::hub);
    EXPECT_NE(open->description().find("warning: any machine that reaches this address can send commands"),
              std::string::npos);
    const std::string port = open->address().bus.substr(6);
    std::atomic<bool> done{false};
    std::thread turn([&] {
        for (ReceivedFrame out; !done;) (void)open->receive(out);
    });
    const auto client = open_can_bus("slcan:127.0.0.3:" + port, CanRole::client);
    done = true;
    turn.join();
    ASSERT_TRUE(client) << client.error().what;
    EXPECT_TRUE((*client)->send(can_frame(0x124, {0xAA})));
    ReceivedFrame out;
    EXPECT_TRUE(turn_until(*open, [&] { return open->receive(out); }));
    EXPECT_EQ(out.frame.id, 0x124u);
}

TEST_F(SlcanHub, PythonCansOpeningSequence) {
    Wire w(port_);
    w.say("C\rS6\rO\rO\r");
    EXPECT_EQ(w.hear(*hub_, "\r\r\r\r"), "\r\r\r\r");
    EXPECT_TRUE(hub_->send(can_frame(0x123, {0xAA})));
    EXPECT_EQ(w.hear(*hub_, "\r"), "t1231AA\r");
}

TEST_F(SlcanHub, IsABusForAllOpenClients) {
    Wire a(port_), b(port_), closed(port_), terminal(hub_pty(*hub_));
    for (Wire* w : {&a, &b, &terminal}) {
        w->say("O\r");
        EXPECT_EQ(w->hear(*hub_, "\r"), "\r");
    }
    closed.say("V\r");
    EXPECT_EQ(closed.hear(*hub_, "\r"), "V1013\r");
    a.say("t1231AA\r");
    EXPECT_EQ(a.hear(*hub_, "\r"), "z\r");
    EXPECT_EQ(b.hear(*hub_, "\r"), "t1231AA\r");
    EXPECT_EQ(terminal.hear(*hub_, "\r"), "t1231AA\r");
    terminal.say("T000001231BB\r");
    EXPECT_EQ(terminal.hear(*hub_, "\r"), "Z\r");
    EXPECT_EQ(a.hear(*hub_, "\r"), "T000001231BB\r");
    EXPECT_TRUE(hub_->send(can_frame(0x7, {})));
    for (Wire* w : {&a, &b, &terminal}) EXPECT_TRUE(w->hear(*hub_, "t0070\r").ends_with("t0070\r"));
    closed.say("V\r");
    EXPECT_EQ(closed.hear(*hub_, "\r"), "V1013\r") << "nothing of the bus came here";
    EXPECT_EQ(a.frames.size() + b.frames.size() + terminal.frames.size(), 2u) << "the hub itself received both";
}

TEST_F(SlcanHub, SendingWithoutClientsIsADrop) {
    EXPECT_FALSE(hub_->send(can_frame(0x123, {1})));
    EXPECT_EQ(hub_->counters().send_drops, 1u);
    EXPECT_EQ(hub_->counters().sent, 0u);
}

TEST_F(SlcanHub, EightClientsAndNotNine) {
    std::vector<Wire> clients;
    for (int i = 0; i < 8; ++i) {
        clients.emplace_back(port_).say("O\r");
        EXPECT_EQ(clients.back().hear(*hub_, "\r"), "\r");
    }
    Wire ninth(port_);
    EXPECT_TRUE(ninth.hung_up(*hub_));
    clients.erase(clients.begin() + 3);
    EXPECT_TRUE(turn_until(*hub_, [&] {
        ReceivedFrame out;
        (void)hub_->receive(out);
        return clients_left(*hub_) == 1;
    }));
    Wire late(port_);
    late.say("V\r");
    EXPECT_EQ(late.hear(*hub_, "\r"), "V1013\r") << "a place was free again";
}

TEST_F(SlcanHub, KnowsWhenAllThatCommandedHaveLeft) {
    ClientHub& hub = *hub_->clients();
    EXPECT_FALSE(hub.has_clients());
    std::optional<Wire> one(std::in_place, port_), two(std::in_place, port_);
    Wire listener(port_);
    for (Wire* w : {&*one, &*two, &listener}) w->say("O\r"), w->hear(*hub_, "\r");
    ReceivedFrame out;
    const auto command = [&](Wire& from) {
        from.say("t1230\r");
        ASSERT_TRUE(turn_until(*hub_, [&] { return hub_->receive(out); }));
        hub.note_commander();
    };
    EXPECT_FALSE(hub.commanders_left()) << "nobody has commanded yet";
    command(*one);
    command(*two);
    one.reset();
    ASSERT_TRUE(turn_until(*hub_, [&] { return hub_->receive(out) || hub.clients_left() == 1; }));
    EXPECT_FALSE(hub.commanders_left());
    two->say("t1230\r");
    two.reset();  // its last command is still to be read
    ASSERT_TRUE(turn_until(*hub_, [&] { return hub_->receive(out); }));
    hub.note_commander();
    ASSERT_TRUE(turn_until(*hub_, [&] { return hub_->receive(out) || hub.clients_left() == 2; }));
    EXPECT_TRUE(hub.commanders_left()) << "the listener does not count";
    EXPECT_TRUE(hub.has_clients()) << "but a frame that is sent reaches it";
    EXPECT_EQ(hub_->counters().interface_down, 0u) << "that clients end is no fault";
    command(listener);
    EXPECT_FALSE(hub.commanders_left()) << "it may be commanded again";
    listener.say("C\r");
    listener.hear(*hub_, "\r");
    EXPECT_TRUE(hub.commanders_left()) << "closed is left";
}

TEST_F(SlcanHub, HalfLinesAndLongLinesAndJunk) {
    Wire w(port_);
    w.say("O\r");
    EXPECT_EQ(w.hear(*hub_, "\r"), "\r");
    for (const char c : std::string("t12341122")) {
        w.say({&c, 1});
        ReceivedFrame out;
        hub_->wait(1'000'000);
        EXPECT_FALSE(hub_->receive(out));
    }
    w.say("3344\r");
    EXPECT_EQ(w.hear(*hub_, "\r"), "z\r");
    w.say(std::string(20'000, 't') + "\r");
    EXPECT_EQ(w.hear(*hub_, "\a"), "\a");
    w.say(std::string("\0\xff\x80\r", 4));
    EXPECT_EQ(w.hear(*hub_, "\a"), "\a");
    w.say("S\rS66\rSx\rO1\rC2\rV1\rt\r");
    EXPECT_EQ(w.hear(*hub_, "\a\a\a\a\a\a\a"), "\a\a\a\a\a\a\a");
    EXPECT_EQ(hub_->counters().malformed, 9u);
    w.say("t1230\r");
    EXPECT_EQ(w.hear(*hub_, "\r"), "z\r");
    EXPECT_EQ(w.frames.size(), 2u);
}

TEST_F(SlcanHub, ClientThatStopsReadingIsLeftBehind) {
    Wire reads(port_), stuck(port_);
    for (Wire* w : {&reads, &stuck}) {
        w->say("O\r");
        EXPECT_EQ(w->hear(*hub_, "\r"), "\r");
    }
    const std::vector<std::uint8_t> data{0x00, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77};
    const std::string line = "t12380011223344556677\r";
    // In the end the lines do not fit the buffers of the one that does not read. The other one loses nothing by it.
    std::size_t sent = 0, heard = 0;
    while (hub_->counters().send_drops == 0 && sent < 1'000'000) {
        for (int k = 0; k < 100; ++k, ++sent) ASSERT_TRUE(hub_->send(can_frame(0x123, data)));
        while (heard < sent) heard += reads.hear(*hub_, line).size() / line.size();
    }
    EXPECT_GT(hub_->counters().send_drops, 0u);
    EXPECT_EQ(heard, sent);
    // When it reads again it finds whole lines, and then takes part again.
    std::string text;
    while (clients_left(*hub_) == 0) {
        const std::string part = stuck.hear(*hub_, line);
        text += part;
        if (part.size() <= line.size()) break;
        (void)hub_->send(can_frame(0x123, data));
    }
    ASSERT_EQ(text.size() % line.size(), 0u);
    for (std::size_t i = 0; i < text.size(); i += line.size())
        ASSERT_EQ(text.compare(i, line.size(), line), 0) << i;
}

TEST_F(SlcanHub, FloodBeyondItsQueueLosesNothing) {
    Wire w(port_);
    w.say("O\r");
    EXPECT_EQ(w.hear(*hub_, "\r"), "\r");
    std::string lines;
    for (int i = 0; i < 200; ++i) lines += "t1230\r";
    constexpr std::size_t n = 20'000;
    std::size_t said = 0, got = 0;
    ReceivedFrame out;
    // The client speaks whenever it can; the hub listens now and then.
    EXPECT_TRUE(turn_until(*hub_, [&] {
        while (said < n * 6) {
            const std::size_t at = said % lines.size();
            const ssize_t k = ::write(w.fd(), lines.data() + at, std::min(lines.size() - at, n * 6 - said));
            if (k <= 0) break;
            said += static_cast<std::size_t>(k);
        }
        for (int i = 0; i < 5000 && hub_->receive(out); ++i) ++got;
        return got == n;
    })) << got;
}

TEST_F(SlcanHub, PtyKeepsNothingForTheNextProgram) {
    {
        Wire first(hub_pty(*hub_));
        first.say("O\r");
        EXPECT_EQ(first.hear(*hub_, "\r"), "\r");
        for (int i = 0; i < 100; ++i) EXPECT_TRUE(hub_->send(can_frame(0x123, {1})));
    }  // it ends without reading and without C
    Wire second(hub_pty(*hub_));
    second.say("C\r");
    ReceivedFrame out;
    EXPECT_TRUE(turn_until(*hub_, [&] {
        (void)hub_->receive(out);
        return !hub_->send(can_frame(0x123, {1}));  // the channel is closed
    }));
    EXPECT_EQ(second.hear(*hub_, "\r"), "\r");
}

TEST_F(SlcanHub, SurvivesRandomTalk) {
    std::mt19937_64 rng(41);
    const std::string words = "OCSVNFtTrR0123456789ABCDEF\r\r\r\a\n \xff";
    for (int round = 0; round < 30; ++round) {
        Wire w(port_), terminal(hub_pty(*hub_));
        for (int i = 0; i < 20; ++i) {
            std::string text;
            for (std::uint64_t k = rng() % 200; k > 0; --k) text += words[rng() % words.size()];
            w.say(text);
            terminal.say(text);
            ReceivedFrame out;
            while (hub_->receive(out)) EXPECT_LE(out.frame.size, 8);
            (void)hub_->send(can_frame(0x1, {1}));
        }
        terminal.say("\rC\r");
        (void)terminal.hear(*hub_, "\r");
    }
    Wire w(port_);
    w.say("V\r");
    EXPECT_EQ(w.hear(*hub_, "\r"), "V1013\r");
}

TEST(SlcanClient, ComesBackWhenTheHubDoes) {
    auto hub = open_or_fail("slcan:0", CanRole::hub);
    const std::string spec = "slcan:" + std::to_string(hub_port(*hub));
    auto client = open_client_of(*hub);
    ASSERT_TRUE(client);
    ReceivedFrame out;
    ASSERT_TRUE(client->send(can_frame(0x1, {1})));
    ASSERT_TRUE(next_frame(*hub, out));
    hub.reset();
    EXPECT_TRUE(turn_until(*client, [&] {
        (void)client->receive(out);
        return client->counters().interface_down == 1;
    }));
    while (client->send(can_frame(0x1, {1}))) {
    }
    EXPECT_GT(client->counters().send_drops, 0u);
    hub = open_or_fail(spec, CanRole::hub);
    ASSERT_TRUE(hub);
    EXPECT_TRUE(turn_until(*client, [&] { return client->send(can_frame(0x2, {1})); }));
    ASSERT_TRUE(next_frame(*hub, out));
    EXPECT_EQ(out.frame.id, 0x2u);
}

/// A hub that a thread of its own serves; it repeats every `every`-th frame under an identifier of its own.
class ServedHub {
public:
    explicit ServedHub(std::uint32_t says_every) : says_every_(says_every), thread_([this] { serve(); }) {}
    ~ServedHub() { end(); }
    /// The hub, no longer served.
    CanBus& end() {
        done_ = true;
        if (thread_.joinable()) thread_.join();
        return *hub_;
    }
    std::string spec() const { return "slcan:" + std::to_string(hub_port(*hub_)); }

private:
    void serve() {
        std::uint32_t heard = 0;
        while (!done_) {
            for (ReceivedFrame out; hub_->receive(out);)
                if (says_every_ != 0 && ++heard % says_every_ == 0) {
                    out.frame.id = 0x700;
                    EXPECT_TRUE(hub_->send(out.frame));
                }
            hub_->wait(1'000'000);
        }
    }

    std::unique_ptr<CanBus> hub_ = open_or_fail("slcan:0", CanRole::hub);
    std::uint32_t says_every_;
    std::atomic<bool> done_{false};
    std::thread thread_;
};

CanFrame numbered(std::uint32_t id, std::uint32_t n) {
    return can_frame(id, {static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(n >> 8),
                          static_cast<std::uint8_t>(n >> 16), 0, 0, 0, 0, 0xEE});
}
std::string key(const CanFrame& f) {
    return std::to_string(f.id) + ":" + std::to_string(f.data[0] + 256u * f.data[1] + 65536u * f.data[2]);
}

TEST(SlcanBus, AllHearAllInOneOrder) {
    ServedHub hub(3);
    constexpr std::uint32_t speakers = 3, frames = 2000, total = speakers * frames + speakers * frames / 3;
    std::vector<std::unique_ptr<CanBus>> bus;
    for (std::uint32_t i = 0; i < speakers + 2; ++i) bus.push_back(open_or_fail(hub.spec(), CanRole::client));
    std::vector<std::vector<std::string>> heard(bus.size());
    std::vector<std::thread> threads;
    for (std::uint32_t i = 0; i < bus.size(); ++i)  // the last two only listen
        threads.emplace_back([&, i] {
            std::uint32_t said = i < speakers ? 0 : frames;
            const std::size_t expected = i < speakers ? total - frames : total;
            const std::int64_t until_ns = monotonic_ns() + 120 * kSecond_ns;
            for (; (said < frames || heard[i].size() < expected) && monotonic_ns() < until_ns;
                 bus[i]->wait(1'000'000)) {
                for (ReceivedFrame out; bus[i]->receive(out);) heard[i].push_back(key(out.frame));
                for (int burst = 0; burst < 50 && said < frames; ++burst, ++said)
                    EXPECT_TRUE(bus[i]->send(numbered(0x100 + i, said)));
            }
        });
    for (std::thread& t : threads) t.join();
    const std::vector<std::string>& all = heard.back();
    ASSERT_EQ(all.size(), total);
    for (std::uint32_t i = 0; i < bus.size(); ++i) {
        std::vector<std::string> expected;
        for (const std::string& frame : all)
            if (i >= speakers || !frame.starts_with(std::to_string(0x100 + i) + ":")) expected.push_back(frame);
        EXPECT_TRUE(heard[i] == expected) << "client " << i << " heard another order";
    }
}

TEST(SlcanBus, NothingIsMissedOnceAClientIsOpen) {
    ServedHub hub(0);
    auto speaker = open_or_fail(hub.spec(), CanRole::client);
    for (std::uint32_t i = 0; i < 50; ++i) {
        auto late = open_or_fail(hub.spec(), CanRole::client);
        ASSERT_TRUE(speaker->send(numbered(0x123, i)));
        ReceivedFrame out;
        ASSERT_TRUE(next_frame(*late, out)) << i;
        EXPECT_EQ(key(out.frame), key(numbered(0x123, i)));
    }
}

TEST(SlcanBus, AFastSpeakerWaitsForASlowListener) {
    ServedHub hub(0);
    auto fast = open_or_fail(hub.spec(), CanRole::client);
    Wire slow(static_cast<std::uint16_t>(std::stoi(hub.spec().substr(6))));
    const int little = 32 << 10;  // or the kernel would keep it all for him
    ::setsockopt(slow.fd(), SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
    slow.say("O\r");
    std::array<char, 1000> part;
    while (::read(slow.fd(), part.data(), 1) != 1) std::this_thread::yield();

    constexpr std::uint32_t frames = 80'000;  // 1.8 MB: more than there is room for on the way
    const std::string line = "t12380011223344556677\r";
    std::atomic<bool> done{false};
    std::thread speaker([&] {
        const CanFrame frame = can_frame(0x123, {0x00, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77});
        for (std::uint32_t said = 0; said < frames || !done;) {
            // What does not go now is the speaker's to say again; receiving also sends what is queued.
            if (said < frames && fast->send(frame))
                ++said;
            else
                fast->wait(1'000'000);
            ReceivedFrame out;
            EXPECT_FALSE(fast->receive(out)) << "nobody else speaks";
        }
    });
    std::string text;
    const std::int64_t until_ns = monotonic_ns() + 120 * kSecond_ns;
    while (text.size() < frames * line.size() && monotonic_ns() < until_ns) {
        const ssize_t n = ::read(slow.fd(), part.data(), part.size());
        if (n > 0) text.append(part.data(), static_cast<std::size_t>(n));
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    done = true;
    speaker.join();
    EXPECT_EQ(hub.end().counters().send_drops, 0U);
    ASSERT_EQ(text.size(), frames * line.size());
    for (std::size_t i = 0; i < text.size(); i += line.size())
        ASSERT_EQ(text.compare(i, line.size(), line), 0) << i;
}

TEST(SlcanClient, ErrorsNameTheFaultOfAHub) {
    ServedHub hub(0);
    std::vector<std::unique_ptr<CanBus>> all;
    for (int i = 0; i < 8; ++i) all.push_back(open_or_fail(hub.spec(), CanRole::client));
    const auto ninth = open_can_bus(hub.spec(), CanRole::client);
    ASSERT_FALSE(ninth);
    EXPECT_EQ(ninth.error().kind, ErrorKind::missing);
    EXPECT_NE(ninth.error().what.find("limit of clients"), std::string::npos) << ninth.error().what;
}

TEST(CanBusName, ASchemeWithoutItsAddressIsNoInterface) {
    for (const char* spec : {"slcan", "udp", "log"}) {
        const auto bus = open_can_bus(spec, CanRole::hub);
        ASSERT_FALSE(bus) << spec;
        EXPECT_EQ(bus.error().kind, ErrorKind::bad_input);
        EXPECT_NE(bus.error().what.find("slcan:PORT"), std::string::npos) << bus.error().what;
    }
}

}  // namespace
}  // namespace narpa
