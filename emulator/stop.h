/// emulator/stop.h - the one request to end, set by signals and looked at by every wait.
#pragma once

#include <atomic>

namespace narpa {

using StopFlag = std::atomic<bool>;

/// The program's flag: what SIGINT and SIGTERM set.
inline StopFlag& stop_flag() noexcept {
    static StopFlag flag{false};
    return flag;
}

}  // namespace narpa
