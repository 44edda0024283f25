#include "drivers/usb/faulty_device.h"

#include "protocols/little_endian.h"

namespace narpa {

std::vector<std::uint8_t> wrong_configuration(std::vector<std::uint8_t> good, std::uint64_t kind) {
    // Configuration at 0 (9 bytes), interface at 9 (9), endpoints at 18 and 25 (7 each).
    constexpr std::size_t kInterface = 9, kFirst = 18, kSecond = 25, kWhole = 32;
    if (good.size() != kWhole) return good;
    std::vector<std::uint8_t> b = std::move(good);
    const auto cut = [&](std::size_t size, std::size_t told) {
        b.resize(size);
        put_le(&b[2], static_cast<std::uint16_t>(told));
    };
    switch (kind) {
        case 1: cut(kFirst, kFirst), b[kInterface + 4] = 0; break;  // no endpoints
        case 2: cut(kFirst, kFirst); break;                         // two are promised, none is there
        case 3: cut(kSecond + 3, kWhole); break;                    // ends in the second endpoint
        case 4: cut(kWhole, 0xffff); break;                         // says that it is longer
        case 5: b[kInterface] = 0; break;                           // an interface descriptor of no length
        case 6: b[kFirst] = 3; break;                               // an endpoint's that is too short
        case 7: b[kFirst + 3] = b[kSecond + 3] = 3; break;          // interrupt endpoints
        case 8: put_le(&b[kFirst + 4], std::uint16_t{0}), put_le(&b[kSecond + 4], std::uint16_t{0}); break;
        case 9: b[kFirst + 2] = b[kSecond + 2]; break;  // both from the host, of one number
        case 10: b[4] = 0; break;                       // no interfaces are promised
        default: break;
    }
    return b;
}

}  // namespace narpa
