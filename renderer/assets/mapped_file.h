/// renderer/assets/mapped_file.h - the bytes of a file, mapped into memory: for the processes that read untrusted
/// files, as one that is cut short meanwhile ends the process that reads it.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <string_view>
#include <utility>

#include "base/file_bytes.h"
#include "base/result.h"
#include "renderer/assets/confined_reader.h"

namespace narpa {

class MappedFile {
public:
    /// Errors: those of check_plain_file; not readable. Ends the process where memory does not suffice.
    static Result<MappedFile> open(const std::string& path) {
        if (const Status plain = check_plain_file(path); !plain) return plain.error();
        MappedFile file;
        struct stat about {};
        const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
        const bool is_known = fd >= 0 && ::fstat(fd, &about) == 0;
        file.size_ = static_cast<std::size_t>(about.st_size);
        void* at = nullptr;
        if (is_known && file.size_ > 0) at = ::mmap(nullptr, file.size_, PROT_READ, MAP_PRIVATE, fd, 0);
        const int problem = errno;
        if (fd >= 0) ::close(fd);
        if (at == MAP_FAILED && problem == ENOMEM) _exit(kOutOfMemory);
        if (!is_known || at == MAP_FAILED)
            return Error{.what = "cannot be read; check its permissions", .file = path};
        file.bytes_ = static_cast<const char*>(at);
        return file;
    }
    MappedFile(MappedFile&& other) noexcept
        : bytes_(std::exchange(other.bytes_, nullptr)), size_(std::exchange(other.size_, 0)) {}
    MappedFile& operator=(MappedFile&&) = delete;
    ~MappedFile() {
        if (bytes_ != nullptr) ::munmap(const_cast<char*>(bytes_), size_);
    }
    [[nodiscard]] std::string_view bytes() const { return {bytes_, size_}; }

private:
    MappedFile() = default;

    const char* bytes_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace narpa
