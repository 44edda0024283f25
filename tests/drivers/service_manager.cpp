// The service manager's protocol, against a socket of the test's own.
#include "drivers/service_manager.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>

#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

/// Sets variables for one test.
class ServiceEnvironment : public testing::Test {
protected:
    ~ServiceEnvironment() override {
        for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(name);
    }
    static void set(const char* name, const std::string& value) { ::setenv(name, value.c_str(), 1); }
    /// A socket bound to this name, as a manager has it.
    static Descriptor listener(const std::string& name) {
        Descriptor fd(::socket(AF_UNIX, SOCK_DGRAM, 0));
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::memcpy(address.sun_path, name.data(), name.size());
        if (name.front() == '@') address.sun_path[0] = '\0';
        const auto bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
        EXPECT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), bytes), 0) << std::strerror(errno);
        return fd;
    }
    static std::string received(const Descriptor& fd) {
        char text[256];
        const ssize_t n = ::recv(fd.get(), text, sizeof text, MSG_DONTWAIT);
        return n < 0 ? "nothing" : std::string(text, static_cast<std::size_t>(n));
    }
};

TEST_F(ServiceEnvironment, WithoutAManagerNothingIsSent) {
    const auto manager = ServiceManager::from_environment();
    ASSERT_TRUE(manager);
    EXPECT_FALSE(manager->watchdog_ns());
    manager->notify("READY=1");
}

TEST_F(ServiceEnvironment, TellsAManagerByAFileAndByAName) {
    const test::TemporaryFolder folder;
    for (const std::string& name : {std::string(folder / "notify"), "@narpa-test-" + std::to_string(::getpid())}) {
        const Descriptor manager_end = listener(name);
        set("NOTIFY_SOCKET", name);
        const auto manager = ServiceManager::from_environment();
        ASSERT_TRUE(manager);
        manager->notify("READY=1");
        manager->notify("STATUS=t = 1.0 s");
        EXPECT_EQ(received(manager_end), "READY=1") << name;
        EXPECT_EQ(received(manager_end), "STATUS=t = 1.0 s");
        EXPECT_EQ(received(manager_end), "nothing");
    }
}

TEST_F(ServiceEnvironment, AManagerThatIsGoneHoldsNobodyUp) {
    const std::string name = "@narpa-gone-" + std::to_string(::getpid());
    set("NOTIFY_SOCKET", name);
    const auto manager = ServiceManager::from_environment();
    ASSERT_TRUE(manager);
    manager->notify("READY=1");
    const Descriptor full = listener(name);
    for (int i = 0; i < 10'000; ++i) manager->notify("WATCHDOG=1");  // more than its queue holds
    EXPECT_EQ(received(full), "WATCHDOG=1");
}

TEST_F(ServiceEnvironment, TheWatchdogIsThatOfThisProcess) {
    const Descriptor end = listener("@narpa-watchdog-" + std::to_string(::getpid()));
    set("NOTIFY_SOCKET", "@narpa-watchdog-" + std::to_string(::getpid()));
    set("WATCHDOG_USEC", "2500000");
    EXPECT_EQ(ServiceManager::from_environment()->watchdog_ns(), 2'500'000'000);
    set("WATCHDOG_PID", std::to_string(::getpid()));
    EXPECT_EQ(ServiceManager::from_environment()->watchdog_ns(), 2'500'000'000);
    set("WATCHDOG_PID", std::to_string(::getppid()));
    EXPECT_FALSE(ServiceManager::from_environment()->watchdog_ns());
    set("WATCHDOG_PID", "");
    for (const char* bad : {"", "0", "-5", "soon", "5s"}) {
        set("WATCHDOG_USEC", bad);
        EXPECT_FALSE(ServiceManager::from_environment()->watchdog_ns()) << bad;
    }
}

TEST_F(ServiceEnvironment, RefusesASocketThatIsNone) {
    for (const std::string& bad : {std::string("relative"), "/" + std::string(200, 'x')}) {
        set("NOTIFY_SOCKET", bad);
        const auto manager = ServiceManager::from_environment();
        ASSERT_FALSE(manager);
        EXPECT_NE(manager.error().what.find("expected the path of a socket, or @NAME"), std::string::npos);
    }
}

}  // namespace
}  // namespace narpa
