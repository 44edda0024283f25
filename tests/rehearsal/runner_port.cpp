// The port that a LiDAR's packets go to: the one of its position packets lies 5940 above and must exist.
#include <gtest/gtest.h>

#include "rehearsal/runner/free_port.h"

namespace narpa::rehearsal {
namespace {

TEST(LidarPort, LeavesRoomForPositionPackets) {
    for (int k = 0; k < 300; ++k) {  // one in twenty that the kernel offers is too high
        const auto port = free_lidar_port();
        ASSERT_TRUE(port) << port.error().text();
        EXPECT_GT(*port, 1023);
        EXPECT_LE(*port + 5940, 65535);
    }
}

}  // namespace
}  // namespace narpa::rehearsal
