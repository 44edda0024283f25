// What is handed over in place of a late frame. The clock is set so that it is an hour before or behind its time:
// then lateness is no matter of how fast the machine is.
#include <algorithm>

#include "emulator/camera/camera_sensor.h"
#include "protocols/video/embedded_line.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;

/// Keeps all that it is sent.
class Keeper final : public VideoSink {
public:
    Keeper(std::vector<std::string>& frames, std::vector<FrameStamp>& stamps) : frames_(frames), stamps_(stamps) {}
    bool send(std::span<const std::uint8_t> frame, const FrameStamp& stamp) noexcept override {
        frames_.emplace_back(frame.begin(), frame.end());
        stamps_.push_back(stamp);
        return true;
    }
    void flush() noexcept override {}
    VideoCounters counters() const noexcept override { return {}; }
    std::string description() const override { return "keeper"; }

private:
    std::vector<std::string>& frames_;
    std::vector<FrameStamp>& stamps_;
};

/// Is full.
class Full final : public VideoSink {
public:
    bool send(std::span<const std::uint8_t>, const FrameStamp&) noexcept override { return false; }
    void flush() noexcept override {}
    VideoCounters counters() const noexcept override { return {}; }
    std::string description() const override { return "full"; }
};

class UntakenFrames : public LoopTest {
protected:
    /// One frame to sinks that are full, and to one that is not.
    CameraStats run(bool one_takes, FrameLedger& ledger) {
        auto world = World::create(scene(small_scene()));
        if (!world) return {};
        std::vector<std::string> frames;
        std::vector<FrameStamp> stamps;
        std::vector<std::unique_ptr<VideoSink>> sinks;
        sinks.push_back(std::make_unique<Full>());
        if (one_takes) sinks.push_back(std::make_unique<Keeper>(frames, stamps));
        sinks.push_back(std::make_unique<Full>());
        CameraSensor feed(**world, 0, std::move(sinks));
        feed.keep_ledgers();
        RealTimeClock clock;
        clock.start(kHourNs);
        clock.end_at(feed.last_pose_ns() + 1);
        feed.make_next(clock);
        EXPECT_TRUE(feed.ledgers().pop(ledger));
        return feed.stats();
    }
};

TEST_F(UntakenFrames, AreNotHandedOver) {
    FrameLedger ledger;
    const CameraStats none = run(false, ledger);
    EXPECT_EQ(ledger.delivery, Delivery::nothing);
    EXPECT_EQ(ledger.t_hand_over_ns, 0);
    EXPECT_EQ(none.handed_over, 0U);
    EXPECT_EQ(none.not_taken, 1U);
    const CameraStats one = run(true, ledger);
    EXPECT_EQ(ledger.delivery, Delivery::frame);
    EXPECT_NE(ledger.t_hand_over_ns, 0);
    EXPECT_EQ(one.handed_over, 1U);
    EXPECT_EQ(one.not_taken, 0U);
}

class LatePolicies : public LoopTest, public ::testing::WithParamInterface<std::tuple<const char*, const char*>> {
protected:
    /// Frames 0 to 4, of which these come late.
    void run(const std::string& budget, std::initializer_list<std::uint32_t> late) {
        std::string text = small_scene("rate_hz = 10\nembedded_line = true\nlate_policy = \"" + policy() +
                                       "\"\nformat = \"" + format() + "\"");
        text.replace(text.find("[64, 48]"), 8, "[160, 48]");  // wide enough for the embedded line
        text.replace(text.find("spp = 2"), 7, budget);
        // So that no frame is like another.
        text.replace(text.find("can_id = 0x100"), 14, "velocity_m_s = [3, 0.4, 0]");
        auto world = World::create(scene(text));
        ASSERT_TRUE(world) << world.error().text();
        std::vector<std::unique_ptr<VideoSink>> sinks;
        sinks.push_back(std::make_unique<Keeper>(sent_, stamps_));
        CameraSensor feed(**world, 0, std::move(sinks));
        feed.keep_ledgers();
        ASSERT_TRUE(feed.log_to(folder_ / "", true));
        RealTimeClock before, behind;
        before.start(kHourNs);
        behind.start(-kHourNs);
        for (std::uint32_t frame = 0; frame < 5; ++frame) {
            const bool is_late = std::ranges::find(late, frame) != late.end();
            RealTimeClock& clock = is_late ? behind : before;
            clock.end_at(feed.last_pose_ns() + 1);  // the last frame: an hour behind, all others would be skipped
            feed.make_next(clock);
        }
        ASSERT_TRUE(feed.finish());
        stats_ = feed.stats();
        for (FrameLedger l; feed.ledgers().pop(l);) ledgers_.push_back(l);
        ASSERT_EQ(ledgers_.size(), 5U);
        for (const FrameLedger& l : ledgers_) {
            const bool is_late = std::ranges::find(late, l.frame) != late.end();
            EXPECT_EQ(l.deadline_met, !is_late) << l.frame;
            EXPECT_EQ(l.delivery, is_late ? instead() : Delivery::frame) << l.frame;
            EXPECT_EQ(l.t_hand_over_ns == 0, l.delivery == Delivery::nothing) << l.frame;
            EXPECT_NE(kStepNames[l.step], "nothing") << l.frame;  // each is whole
        }
        const auto rows = read_rows(folder_ / "nav.ledger.csv");
        ASSERT_EQ(rows.size(), 5U);
        for (std::size_t i = 0; i < 5; ++i) {
            EXPECT_EQ(rows[i].at("deadline_met"), ledgers_[i].deadline_met ? "1" : "0") << i;
            EXPECT_EQ(rows[i].at("delivery"), kDeliveries[static_cast<std::size_t>(ledgers_[i].delivery)]) << i;
        }
        EXPECT_EQ(stats_.frames, 5U);
        EXPECT_EQ(stats_.deadline_missed, late.size());
        EXPECT_EQ(stats_.skipped, 0U);
        EXPECT_EQ(stats_.handed_over, sent_.size());
        std::size_t sent = 0;  // each goes out as the frame that fell due, whatever its image
        for (const FrameLedger& l : ledgers_) {
            if (l.delivery == Delivery::nothing) continue;
            ASSERT_LT(sent, stamps_.size());
            EXPECT_EQ(stamps_[sent].number, l.frame);
            EXPECT_EQ(stamps_[sent++].t_ns, l.t_exposure_mid_ns);
        }
        EXPECT_EQ(sent, stamps_.size());
    }
    static std::string policy() { return std::get<0>(GetParam()); }
    static std::string format() { return std::get<1>(GetParam()); }
    static Delivery instead() {
        return policy() == "drop"     ? Delivery::nothing
               : policy() == "repeat" ? Delivery::repeated
               : policy() == "blank"  ? Delivery::blank
                                      : Delivery::frame;
    }
    static std::optional<FrameLedger> line_of(const std::string& frame) {
        const std::string_view row = std::string_view(frame).substr(image_size(frame));
        return decode_embedded_line({reinterpret_cast<const std::uint8_t*>(row.data()), row.size()});
    }
    /// All but the last row.
    static std::size_t image_size(const std::string& frame) { return frame.size() - frame.size() / 48; }
    static bool black(const std::string& frame) {
        const std::string pixel = format() == "YUYV" ? std::string("\x10\x80") : std::string(2, '\0');
        for (std::size_t i = 0; i < frame.size(); ++i)
            if (frame[i] != pixel[i % 2]) return false;
        return true;
    }

    std::vector<std::string> sent_;
    std::vector<FrameStamp> stamps_;
    std::vector<FrameLedger> ledgers_;
    CameraStats stats_;
};

TEST_P(LatePolicies, DecideWhatIsHandedOverForALateFrame) {
    run("spp = 2", {2, 3});
    const std::string policy = this->policy();
    ASSERT_EQ(sent_.size(), policy == "drop" ? 3U : 5U);
    EXPECT_EQ(stats_.repeated, policy == "repeat" ? 2U : 0U);
    EXPECT_EQ(stats_.blanked, policy == "blank" ? 2U : 0U);
    // Frames in time go out as they are, under their own number.
    std::vector<std::uint32_t> numbers;
    for (const std::string& frame : sent_) numbers.push_back(line_of(frame) ? line_of(frame)->frame : 99);
    if (policy == "drop") {
        EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 4}));
    } else if (policy == "repeat") {
        EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 1, 1, 4}));
        EXPECT_EQ(sent_[2], sent_[1]);  // to the last byte
        EXPECT_EQ(sent_[3], sent_[1]);
        EXPECT_TRUE(line_of(sent_[3])->deadline_met);  // as that one's line says
    } else if (policy == "blank") {
        EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 99, 99, 4}));
        EXPECT_TRUE(black(sent_[2]) && black(sent_[3]));
    } else {
        EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
        EXPECT_FALSE(line_of(sent_[2])->deadline_met);
        EXPECT_TRUE(line_of(sent_[4])->deadline_met);
    }
}

TEST_P(LatePolicies, BeforeThereWasAFrameInTimeARepetitionIsBlack) {
    run("spp = 2", {0, 1});
    if (instead() != Delivery::repeated) return;
    ASSERT_EQ(sent_.size(), 5U);
    EXPECT_TRUE(black(sent_[0]) && black(sent_[1]));
    EXPECT_EQ(line_of(sent_[2])->frame, 2U);
}

/// A budget in time whose end has passed before the frame is begun.
TEST_P(LatePolicies, AFrameWithoutAnyTimeIsLateAndWholeAllTheSame) {
    run("budget_ms = 50", {0, 1, 2, 3, 4});
    for (const FrameLedger& l : ledgers_) {
        EXPECT_EQ(l.budget_kind, BudgetKind::time);
        EXPECT_EQ(l.budget, 50'000'000U);
        EXPECT_EQ(l.t_deadline_ns, l.t_exposure_end_ns + 50'000'000);
        EXPECT_GT(l.samples, 0U);
        EXPECT_EQ(kStepNames[l.step], "coarse_4") << l.frame;
    }
    if (instead() != Delivery::frame) return;
    for (const std::string& frame : sent_) EXPECT_FALSE(black(frame.substr(0, image_size(frame))));
}

INSTANTIATE_TEST_SUITE_P(All, LatePolicies,
                         ::testing::Combine(::testing::Values("late", "drop", "repeat", "blank"),
                                            ::testing::Values("GREY", "YUYV")));

}  // namespace
}  // namespace narpa::test
