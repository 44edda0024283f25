#include <gtest/gtest.h>

#include <atomic>
#include <numeric>

#include "drivers/video/video_sink.h"
#include "drivers/write_queue.h"
#include "tests/drivers/video_support.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes;

// Writes into memory; while `stuck`, as long as the queue lets it.
class MemoryWriter final : public QueueWriter {
public:
    void write(std::span<const std::uint8_t> item, const WriteQueue& queue) noexcept override {
        started = true;
        while (stuck && queue.time_left_ms() != 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        if (stuck) {
            ++abandoned;
            return;
        }
        items.emplace_back(item.begin(), item.end());
    }
    void abandon(std::span<const std::uint8_t>) noexcept override { ++abandoned; }

    std::vector<Bytes> items;  // read after a flush
    std::atomic<int> abandoned{0};
    std::atomic<bool> stuck{false}, started{false};
};

TEST(WriteQueue, WaitingLosesNothingAndKeepsTheOrder) {
    MemoryWriter writer;
    WriteQueue queue(writer, 3, 64, true);
    std::vector<Bytes> sent;
    for (int i = 0; i < 5000; ++i) {
        Bytes item(static_cast<std::size_t>(1 + i % 64));
        std::iota(item.begin(), item.end(), static_cast<std::uint8_t>(i));
        ASSERT_TRUE(queue.push(item));
        sent.push_back(item);
    }
    queue.flush();
    EXPECT_EQ(writer.items, sent);
    EXPECT_EQ(queue.dropped(), 0U);
}

TEST(WriteQueue, FullRingDropsAndCounts) {
    MemoryWriter writer;
    writer.stuck = true;
    WriteQueue queue(writer, 4, 8, false);
    const Bytes item(8, 1);
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.push(item));
    for (int i = 0; i < 10; ++i) EXPECT_FALSE(queue.push(item));
    EXPECT_EQ(queue.dropped(), 10U);
    writer.stuck = false;
    queue.flush();
    EXPECT_EQ(writer.items.size(), 4U);
    EXPECT_TRUE(queue.push(item));
    queue.flush();
    EXPECT_EQ(writer.items.size(), 5U);
}

TEST(WriteQueue, RefusesWhatIsLargerThanASlot) {
    MemoryWriter writer;
    WriteQueue queue(writer, 2, 8, true);
    EXPECT_FALSE(queue.push(Bytes(9)));
    EXPECT_EQ(queue.dropped(), 1U);
}

TEST(WriteQueue, FlushAndEndDoNotHangOnAStuckWriter) {
    MemoryWriter writer;
    writer.stuck = true;
    {
        WriteQueue queue(writer, 4, 8, true);
        for (int i = 0; i < 4; ++i) queue.push(Bytes(8, 1));
        queue.flush();
        EXPECT_EQ(writer.abandoned, 4);
        writer.stuck = false;  // and it works again afterwards
        queue.push(Bytes(8, 2));
        queue.flush();
        EXPECT_EQ(writer.items.size(), 1U);
        writer.stuck = true;
        queue.push(Bytes(8, 3));
    }
    EXPECT_EQ(writer.abandoned, 5);
}

TEST(WriteQueue, EndWritesWhatIsInTheRing) {
    MemoryWriter writer;
    {
        WriteQueue queue(writer, 100, 8, false);
        for (int i = 0; i < 100; ++i) EXPECT_TRUE(queue.push(Bytes(8, 1)));
    }
    EXPECT_EQ(writer.items.size(), 100U);
}

TEST(AllocationCounter, SeesTheHeap) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has its own heap";
    const test::AllocationCounter counter;
    const Bytes one(100);
    EXPECT_EQ(counter.on_this_thread(), 1U);
    std::thread([] { Bytes(200).swap(*std::make_unique<Bytes>()); }).join();
    EXPECT_GT(counter.on_all_threads(), counter.on_this_thread());
    void* block = nullptr;
    ASSERT_EQ(::posix_memalign(&block, 64, 640), 0);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(block) % 64, 0U);
    const std::uint64_t before = counter.on_this_thread();
    block = std::realloc(block, 10'000);
    EXPECT_EQ(counter.on_this_thread(), before + 1);
    std::free(block);
}

// Both the loop's thread, which sends, and the sink's own, which writes.
TEST(VideoSink, SendingAllocatesNothing) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has its own heap";
    const test::TemporaryFolder folder;
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::yuyv}) {
        const VideoFormat format{64, 48, pixel, 100'000'000};
        auto sink = open_video_sink(folder / "out.y4m", format, WhenFull::wait);
        ASSERT_TRUE(sink) << sink.error().text();
        const Bytes frame = test::noise_frame(format, 1);
        const test::AllocationCounter counter;
        for (int i = 0; i < 1000; ++i) (*sink)->send(frame);
        (*sink)->flush();
        EXPECT_EQ(counter.on_all_threads(), 0U);
        EXPECT_EQ((*sink)->counters().written, 1000U);
    }
}

}  // namespace
}  // namespace narpa
