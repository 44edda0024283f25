// The management messages of PTP. Layouts: IEEE 1588-2008, 13.3, 15.4, 15.5; linuxptp, tlv.h.
#include "protocols/ptp/management.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <random>
#include <vector>

#include "tests/support/ptp_answer.h"

namespace narpa {
namespace {

using test::ptp_answer;
using test::PtpBytes;

constexpr PtpPortIdentity kPtpAsker{{0, 0, 0, 0, 0, 0, 0, 0}, 0x1234};

PtpAnswer decode_with_asker(const PtpBytes& bytes, PtpDataSet set, PtpStatus& status, std::uint16_t sequence = 7) {
    return decode_ptp_answer(bytes, set, sequence, kPtpAsker, status);
}

TEST(PtpManagement, AGetHasTheBytesOfTheStandard) {
    std::array<std::uint8_t, kPtpGetBytes> out{};
    encode_ptp_get(PtpDataSet::time_properties, {.domain = 24, .transport_specific = 1}, 0x0102, kPtpAsker, out);
    const PtpBytes expected{0x1D, 2,    0,    54,   24,   0,    0,    0,  // type, version, length, domain, flags
                            0,    0,    0,    0,    0,    0,    0,    0,    0,    0,
                            0,    0,                                                     // correction, reserved
                            0,    0,    0,    0,    0,    0,    0,    0,    0x12, 0x34,  // source
                            1,    2,    4,    0x7F,  // sequence, control, interval
                            0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,  // target
                            0,    0,    0,    0,                                         // hops, GET, reserved
                            0,    1,    0,    2,    0x20, 0x03};                         // TLV
    EXPECT_EQ(PtpBytes(out.begin(), out.end()), expected);
}

TEST(PtpManagement, ReadsEachDataSet) {
    PtpStatus s;
    EXPECT_EQ(decode_with_asker(ptp_answer(7, kPtpAsker, 0x2001, test::ptp_current(1, -1500, 250)),
                                PtpDataSet::current, s),
              PtpAnswer::ok);
    EXPECT_EQ(s.steps_removed, 1);
    EXPECT_EQ(s.offset_ns, -1500);
    EXPECT_EQ(s.mean_path_delay_ns, 250);
    EXPECT_EQ(
        decode_with_asker(ptp_answer(7, kPtpAsker, 0x2003, {0, 37, 0x3C, 0x20}), PtpDataSet::time_properties, s),
        PtpAnswer::ok);
    EXPECT_EQ(s.tai_less_utc_s, 37);
    EXPECT_TRUE(s.tai_less_utc_valid);
    EXPECT_TRUE(s.ptp_timescale);
    EXPECT_EQ(decode_with_asker(ptp_answer(7, kPtpAsker, 0x2004, test::ptp_port(1, 9)), PtpDataSet::port, s),
              PtpAnswer::ok);
    EXPECT_EQ(s.state, PtpPortState::slave);
    EXPECT_EQ(s.ports, 1);
    const PtpClockIdentity master{0x52, 0x54, 0, 0xFF, 0xFE, 0x12, 0x34, 0x56};
    EXPECT_EQ(decode_with_asker(ptp_answer(7, kPtpAsker, 0xC000, test::ptp_time_status(true, master)),
                                PtpDataSet::time_status_np, s),
              PtpAnswer::ok);
    EXPECT_TRUE(s.grandmaster_present);
    EXPECT_EQ(s.grandmaster, master);
}

TEST(PtpManagement, TheStateIsThatOfThePortWhichFollowsAMaster) {
    for (const std::vector<int>& order : {std::vector{6, 9, 4}, {9, 4, 6}, {4, 6, 9}}) {
        PtpStatus s;
        for (const int state : order) s.add_port(static_cast<PtpPortState>(state));
        EXPECT_EQ(s.state, PtpPortState::slave);
        EXPECT_EQ(s.ports, 3);
    }
    PtpStatus s;
    s.add_port(PtpPortState::faulty);
    EXPECT_EQ(name_of(s.state), "FAULTY");
    s.add_port(static_cast<PtpPortState>(200));
    EXPECT_EQ(name_of(static_cast<PtpPortState>(200)), "unknown");
}

TEST(PtpManagement, RefusesOtherAnswers) {
    const PtpBytes good = ptp_answer(7, kPtpAsker, 0x2003, {0, 37, 0x3C, 0x20});
    const auto with = [&](std::size_t at, std::uint8_t value) {
        PtpBytes bytes = good;
        bytes.at(at) = value;
        PtpStatus s;
        const PtpAnswer answer = decode_with_asker(bytes, PtpDataSet::time_properties, s);
        EXPECT_FALSE(s.tai_less_utc_valid);
        return answer;
    };
    EXPECT_EQ(with(0, 0x0B), PtpAnswer::malformed) << "an announce message";
    EXPECT_EQ(with(1, 1), PtpAnswer::malformed) << "version 1";
    EXPECT_EQ(with(3, 57), PtpAnswer::malformed) << "the TLV ends after the message";
    EXPECT_EQ(with(3, 59), PtpAnswer::malformed) << "longer than the datagram";
    EXPECT_EQ(with(51, 4), PtpAnswer::malformed) << "a shorter data set";
    EXPECT_EQ(with(51, 1), PtpAnswer::malformed) << "a TLV without an identifier";
    EXPECT_EQ(with(31, 8), PtpAnswer::not_mine) << "another sequence number";
    EXPECT_EQ(with(43, 0x35), PtpAnswer::not_mine) << "to another port";
    EXPECT_EQ(with(46, 0), PtpAnswer::not_mine) << "a GET";
    EXPECT_EQ(with(53, 1), PtpAnswer::not_mine) << "another data set";
    EXPECT_EQ(with(49, 3), PtpAnswer::not_mine) << "another TLV";
    PtpStatus s;
    EXPECT_EQ(decode_with_asker(good, PtpDataSet::time_properties, s, 8), PtpAnswer::not_mine);
    EXPECT_EQ(decode_with_asker(test::ptp_error(7, kPtpAsker, 0x2003), PtpDataSet::time_properties, s),
              PtpAnswer::refused);
    EXPECT_EQ(decode_with_asker(test::ptp_error(7, kPtpAsker, 0x2001), PtpDataSet::time_properties, s),
              PtpAnswer::malformed);
}

TEST(PtpManagement, EveryTruncationIsMalformed) {
    for (const PtpBytes& whole :
         {ptp_answer(7, kPtpAsker, 0x2003, {0, 37, 0x3C, 0x20}),
          ptp_answer(7, kPtpAsker, 0x2001, test::ptp_current(1, 2, 3)),
          ptp_answer(7, kPtpAsker, 0x2004, test::ptp_port(1, 9)), test::ptp_error(7, kPtpAsker, 0x2003)})
        for (std::size_t size = 0; size < whole.size(); ++size) {
            // A copy of its own size, so that the address sanitizer sees a read beyond it.
            const PtpBytes bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
            PtpStatus s;
            for (const PtpDataSet set : {PtpDataSet::current, PtpDataSet::time_properties, PtpDataSet::port})
                EXPECT_EQ(decode_with_asker(bytes, set, s), PtpAnswer::malformed) << size;
        }
}

TEST(PtpManagement, MutatedAnswersLeaveTheStatusOrChangeItsMembersOnly) {
    std::mt19937 random(5);
    const PtpBytes good = ptp_answer(7, kPtpAsker, 0xC000, test::ptp_time_status(true, {1, 2, 3, 4, 5, 6, 7, 8}));
    for (int trial = 0; trial < 20'000; ++trial) {
        PtpBytes bytes = good;
        bytes.resize(random() % (good.size() + 8));
        for (unsigned i = random() % 4; i > 0 && !bytes.empty(); --i)
            bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
        PtpStatus s;
        const PtpAnswer answer = decode_with_asker(bytes, PtpDataSet::time_status_np, s);
        EXPECT_EQ(s.ports, 0);
        EXPECT_TRUE(answer == PtpAnswer::ok || !s.grandmaster_present);
    }
}

}  // namespace
}  // namespace narpa
