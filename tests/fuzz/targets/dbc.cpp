// A DBC file of a user's bus, and a frame of its first message.
#include "protocols/can/dbc_reader.h"

#include <array>

#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    const auto all = read_dbc({reinterpret_cast<const char*>(data), size}, "bus.dbc");
    if (!fuzz::count(static_cast<bool>(all))) return 0;
    const std::array<std::uint8_t, 64> frame{0x5A, 0xC3};
    for (const DbcMessage& m : *all)
        for (const DbcSignal& s : m.signals) (void)s.value(std::span(frame).first(m.size));
    return 0;
}
