#include "emulator/log/row_log.h"

#include <fmt/format.h>

#include <cassert>
#include <cerrno>
#include <cstring>

namespace narpa {

Result<std::unique_ptr<RowLog>> RowLog::create(const std::string& path, std::string_view header,
                                               bool wait_when_full, std::size_t lines) {
    std::FILE* file = std::fopen(path.c_str(), "we");
    if (!file) return Error{fmt::format("cannot be written: {}", std::strerror(errno)), path};
    return std::unique_ptr<RowLog>(new RowLog(path, file, header, wait_when_full, lines));
}

RowLog::RowLog(std::string path, std::FILE* file, std::string_view header, bool wait_when_full, std::size_t lines)
    : path_(std::move(path)), file_(file) {
    std::setvbuf(file_, buffer_.get(), _IOFBF, kBuffer);
    std::fwrite(header.data(), 1, header.size(), file_);
    sync();
    queue_ = std::make_unique<WriteQueue>(*this, lines, kMaxLine, wait_when_full);
}

RowLog::~RowLog() {
    (void)close();
}

void RowLog::append(std::string_view line) noexcept {
    assert(line.empty() || line.back() == '\n');
    queue_->push({reinterpret_cast<const std::uint8_t*>(line.data()), line.size()});
}

void RowLog::write(std::span<const std::uint8_t> item, const WriteQueue&) noexcept {
    if (buffered_ + item.size() > kBuffer) sync();  // the library would write a part of the line
    buffered_ += item.size();
    if (std::fwrite(item.data(), 1, item.size(), file_) == item.size()) return;
    if (reason_ == 0) reason_ = errno;
    ++lost_;
}

void RowLog::sync() noexcept {
    buffered_ = 0;
    if (std::fflush(file_) != 0 && reason_ == 0) reason_ = errno;
}

Status RowLog::close() {
    if (!file_) return Ok{};
    std::uint64_t dropped = queue_->dropped();
    queue_.reset();  // ends its thread, which writes the file and `lost_`
    dropped += lost_;
    if (std::fclose(file_) != 0 && reason_ == 0) reason_ = errno;
    file_ = nullptr;
    if (reason_ != 0)
        return Error{fmt::format("cannot be written: {}", std::strerror(reason_)), path_, 0, 0, ErrorKind::failed};
    if (dropped > 0)
        return Error{fmt::format("{} lines could not be written in time", dropped), path_, 0, 0, ErrorKind::failed};
    return Ok{};
}

}  // namespace narpa
