// The reader of ptp4l's state, against a socket of the test's own and, where it is installed, against ptp4l.
#include "drivers/ptp/ptp4l_client.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <thread>

#include "base/time.h"
#include "drivers/descriptor.h"
#include "protocols/big_endian.h"
#include "tests/support/ptp_answer.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::ptp_answer;
using test::PtpBytes;
using Reached = Ptp4lReading::Result;

/// A process that listens as ptp4l does. `answers`: those to a request with this sequence number for this data set.
class FakePtp4l {
public:
    using Answers = std::function<std::vector<PtpBytes>(std::uint16_t sequence, PtpPortIdentity asker, PtpDataSet)>;

    FakePtp4l(const std::string& path, std::uint8_t first_byte, Answers answers) {
        fd_ = Descriptor(::socket(AF_UNIX, SOCK_DGRAM, 0));
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::memcpy(address.sun_path, path.data(), path.size());
        EXPECT_EQ(::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        thread_ = std::thread([this, first_byte, a = std::move(answers)] { serve(first_byte, a); });
    }
    ~FakePtp4l() {
        end_ = true;
        thread_.join();
    }

private:
    void serve(std::uint8_t first_byte, const Answers& answers) {
        while (!end_) {
            pollfd wait{fd_.get(), POLLIN, 0};
            wait_ready({&wait, 1}, 20'000'000);
            std::uint8_t request[200];
            sockaddr_un from{};
            socklen_t size = sizeof from;
            if (::recvfrom(fd_.get(), request, sizeof request, MSG_DONTWAIT, reinterpret_cast<sockaddr*>(&from),
                           &size) != static_cast<ssize_t>(kPtpGetBytes) ||
                request[0] != first_byte)
                continue;
            PtpPortIdentity asker;
            std::memcpy(asker.clock.data(), request + 20, 8);
            asker.port = get_be<std::uint16_t>(request + 28);
            for (const PtpBytes& b : answers(get_be<std::uint16_t>(request + 30), asker,
                                             static_cast<PtpDataSet>(get_be<std::uint16_t>(request + 52))))
                ::sendto(fd_.get(), b.data(), b.size(), 0, reinterpret_cast<const sockaddr*>(&from), size);
        }
    }

    Descriptor fd_;
    std::atomic<bool> end_{false};
    std::thread thread_;
};

/// As a clock with two ports, one of which follows a master.
std::vector<PtpBytes> slave_answers(std::uint16_t sequence, PtpPortIdentity asker, PtpDataSet set) {
    switch (set) {
        case PtpDataSet::port:
            return {ptp_answer(sequence, asker, 0x2004, test::ptp_port(1, 9)),
                    ptp_answer(sequence, asker, 0x2004, test::ptp_port(2, 6))};
        case PtpDataSet::current: return {ptp_answer(sequence, asker, 0x2001, test::ptp_current(1, -321, 4567))};
        case PtpDataSet::time_properties: return {ptp_answer(sequence, asker, 0x2003, {0, 37, 0x0C, 0x20})};
        case PtpDataSet::time_status_np:
            return {ptp_answer(sequence, asker, 0xC000, test::ptp_time_status(true, {1, 2, 3, 4, 5, 6, 7, 8}))};
    }
    return {};
}

class Ptp4lSocket : public testing::Test {
protected:
    test::TemporaryFolder folder_;
    std::string path_ = folder_ / "ptp4l";
};

TEST_F(Ptp4lSocket, GivesTheStateOfAllItsPorts) {
    const FakePtp4l ptp4l(path_, 0x0D, slave_answers);
    Ptp4lClient client(path_, 0);
    for (int i = 0; i < 3; ++i) {
        const Ptp4lReading reading = client.read();
        ASSERT_EQ(reading.result, Reached::answered);
        EXPECT_EQ(reading.status.state, PtpPortState::slave);
        EXPECT_EQ(reading.status.ports, 2);
        EXPECT_EQ(reading.status.offset_ns, -321);
        EXPECT_EQ(reading.status.mean_path_delay_ns, 4567);
        EXPECT_EQ(reading.status.tai_less_utc_s, 37);
        EXPECT_EQ(reading.status.grandmaster, (PtpClockIdentity{1, 2, 3, 4, 5, 6, 7, 8}));
        EXPECT_EQ(reading.malformed, 0u);
    }
}

TEST_F(Ptp4lSocket, FindsTheTransportSpecificNumberOfGptp) {
    const FakePtp4l ptp4l(path_, 0x1D, slave_answers);
    Ptp4lClient client(path_, 0);
    EXPECT_EQ(client.read().result, Reached::no_answer);
    EXPECT_EQ(client.read().result, Reached::answered);
    EXPECT_EQ(client.read().result, Reached::answered);
}

TEST_F(Ptp4lSocket, IgnoresAndCountsWhatIsNoAnswer) {
    const FakePtp4l ptp4l(path_, 0x0D, [](std::uint16_t sequence, PtpPortIdentity asker, PtpDataSet set) {
        std::vector<PtpBytes> all{{}, {1, 2, 3}, PtpBytes(1500, 0xFF)};
        const auto good = slave_answers(sequence, asker, set);
        all.push_back(good[0]);
        all.back().pop_back();  // truncated
        const auto later = slave_answers(static_cast<std::uint16_t>(sequence + 50), asker, set);
        all.insert(all.end(), later.begin(), later.end());
        all.insert(all.end(), good.begin(), good.end());
        return all;
    });
    Ptp4lClient client(path_, 0);
    const Ptp4lReading reading = client.read();
    ASSERT_EQ(reading.result, Reached::answered);
    EXPECT_EQ(reading.status.ports, 2);
    EXPECT_GE(reading.malformed, 3u * 4) << "those after the last answer are not read";
}

TEST_F(Ptp4lSocket, AnErrorStatusIsCounted) {
    const FakePtp4l ptp4l(path_, 0x0D, [](std::uint16_t sequence, PtpPortIdentity asker, PtpDataSet set) {
        if (set != PtpDataSet::time_status_np) return slave_answers(sequence, asker, set);
        return std::vector<PtpBytes>(1, test::ptp_error(sequence, asker, 0xC000));
    });
    const Ptp4lReading reading = Ptp4lClient(path_, 0).read();
    EXPECT_EQ(reading.result, Reached::no_answer);
    EXPECT_EQ(reading.refused, 1u);
}

TEST_F(Ptp4lSocket, WhereNoneRunsNothingIsWaitedFor) {
    EXPECT_EQ(Ptp4lClient(path_, 0).read().result, Reached::no_socket);
    EXPECT_EQ(Ptp4lClient(std::string(500, 'x'), 0).read().result, Reached::no_socket);
    { const FakePtp4l ptp4l(path_, 0x0D, slave_answers); }
    EXPECT_EQ(Ptp4lClient(path_, 0).read().result, Reached::no_socket) << "its file is left behind";
    std::ofstream(folder_ / "file") << "no socket";
    EXPECT_EQ(Ptp4lClient(folder_ / "file", 0).read().result, Reached::no_socket);
}

TEST_F(Ptp4lSocket, ReadsTheRealOne) {
    const std::string config = folder_ / "ptp4l.conf", log = folder_ / "log";
    std::ofstream(config) << "[global]\nuds_address " << path_ << "\ndomainNumber 24\nfree_running 1\n";
    const pid_t child = ::fork();
    if (child == 0) {
        const int out = ::open(log.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600);
        ::dup2(out, 1), ::dup2(out, 2);
        ::execlp("ptp4l", "ptp4l", "-f", config.c_str(), "-i", "lo", "-S", "-m", nullptr);
        ::execl("/usr/sbin/ptp4l", "ptp4l", "-f", config.c_str(), "-i", "lo", "-S", "-m", nullptr);
        ::_exit(127);
    }
    Ptp4lClient client(path_, 24);
    Ptp4lReading reading;
    int status = 0;
    bool ended = false;
    while (!ended && reading.result != Reached::answered) {
        reading = client.read();
        ended = ::waitpid(child, &status, WNOHANG) == child;
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    const Ptp4lReading other_domain = ended ? Ptp4lReading{} : Ptp4lClient(path_, 3).read();
    if (!ended) {
        ::kill(child, SIGTERM);
        ::waitpid(child, &status, 0);
    }
    if (ended) {
        std::ifstream text(log);
        GTEST_SKIP() << "ptp4l is not installed or cannot run here: "
                     << std::string(std::istreambuf_iterator<char>(text), {});
    }
    EXPECT_EQ(reading.status.ports, 1);
    EXPECT_TRUE(reading.status.state == PtpPortState::initializing ||
                reading.status.state == PtpPortState::listening || reading.status.state == PtpPortState::master)
        << name_of(reading.status.state);
    EXPECT_FALSE(reading.status.grandmaster_present);
    EXPECT_EQ(reading.status.offset_ns, 0);
    EXPECT_EQ(reading.malformed, 0u);
    EXPECT_EQ(other_domain.result, Reached::no_answer) << "it ignores requests of another domain";
}

}  // namespace
}  // namespace narpa
