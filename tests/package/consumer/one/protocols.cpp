#include <narpa/protocols/can/dbc.h>
#include <narpa/protocols/lidar/velodyne.h>
#include <cstdio>

int main() {
    const narpa::CanBody body{"chaser", 0x100};
    const std::string dbc = narpa::write_dbc({&body, 1});
    std::printf("%zu bytes of DBC\n", dbc.size());
    return dbc.find("BO_ ") != dbc.npos && &narpa::vlp16() ? 0 : 1;
}
