#include <narpa/drivers/can/can_bus.h>
#include <cstdio>

int main() {
    const auto bus = narpa::open_can_bus("log:/does/not/exist", narpa::CanRole::hub);
    return bus ? 1 : std::puts(bus.error().text().c_str()) < 0;
}
