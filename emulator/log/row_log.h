/// emulator/log/row_log.h - writes lines from the loop to a file without ever waiting for the disk. Whole lines
/// reach the file, within about a second: a process that is killed leaves those before.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "base/result.h"
#include "drivers/write_queue.h"

namespace narpa {

class RowLog final : public QueueWriter {
public:
    /// Creates the file and writes `header` (with its line end) first. One thread appends. `wait_when_full`: a
    /// lockstep run waits for the disk where a real-time run drops the line and counts it. `lines` wait at most.
    static Result<std::unique_ptr<RowLog>> create(const std::string& path, std::string_view header,
                                                  bool wait_when_full, std::size_t lines = 4096);
    ~RowLog() override;

    /// A line with its line end; longer than kMaxLine is dropped and counted. Allocates nothing.
    void append(std::string_view line) noexcept;
    /// Lines come faster than they can be written.
    [[nodiscard]] bool crowded() const noexcept { return queue_->crowded(); }
    /// Writes out what was appended and closes the file; an Error when any line was lost.
    Status close();

    static constexpr std::size_t kMaxLine = 512;

private:
    RowLog(std::string path, std::FILE* file, std::string_view header, bool wait_when_full, std::size_t lines);
    void write(std::span<const std::uint8_t> item, const WriteQueue&) noexcept override;
    void sync() noexcept override;
    void abandon(std::span<const std::uint8_t>) noexcept override { ++lost_; }

    static constexpr std::size_t kBuffer = 64 * 1024;

    std::string path_;
    std::unique_ptr<char[]> buffer_ = std::make_unique<char[]>(kBuffer);
    std::FILE* file_;
    std::size_t buffered_ = 0;  // the queue's thread only, from here on, until it has ended
    std::uint64_t lost_ = 0;
    int reason_ = 0;  ///< errno of the first line that the file did not take
    std::unique_ptr<WriteQueue> queue_;
};

}  // namespace narpa
