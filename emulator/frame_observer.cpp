#include "emulator/frame_observer.h"

#include <algorithm>
#include <cassert>

namespace narpa {

FrameFeed::FrameFeed(std::unique_ptr<FrameObserver> observer, const World& world, bool lockstep)
    : observer_(std::move(observer)), lockstep_(lockstep), at_(world.scene().bodies.size()) {
    assert(observer_->camera() < world.scene().cameras.size());
    const Camera& c = world.scene().cameras[observer_->camera()];
    if (!lockstep) bytes_.resize(frame_bytes({c.width, c.height, c.format, c.period_ns}));
}

void FrameFeed::take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) {
    assert(ledger.camera == observer_->camera());
    if (lockstep_) return observer_->observe(ledger, bytes, at);
    if (slot_.load(std::memory_order_acquire) != empty) {
        ++skipped_;
        return;
    }
    assert(bytes.size() == bytes_.size());
    ledger_ = ledger;
    std::copy(bytes.begin(), bytes.end(), bytes_.begin());
    at_ = at;  // allocates nothing: of as many bodies
    slot_.store(full, std::memory_order_release);
    slot_.notify_one();
}

void FrameFeed::run(const StopFlag& stop) {
    while (!stop.load(std::memory_order_acquire)) {
        slot_.wait(empty, std::memory_order_acquire);
        if (stop.load(std::memory_order_acquire)) return;
        observer_->observe(ledger_, bytes_, at_);
        // A `wake` meanwhile is lost, but `stop` was set before it and is checked next.
        (void)slot_.exchange(empty, std::memory_order_acq_rel);
    }
}

void FrameFeed::wake() noexcept {
    slot_.store(full, std::memory_order_release);
    slot_.notify_one();
}

}  // namespace narpa
