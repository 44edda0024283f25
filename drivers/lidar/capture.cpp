#include "drivers/lidar/capture.h"

#include "drivers/lidar/backends.h"

#ifdef NARPA_WITH_PCAP

#include <pcap/pcap.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <string_view>

#include "base/time.h"

namespace narpa {
namespace {

/// Of a file that is compressed by gzip, or not at all. Does not own `gz`.
std::FILE* stream_of(gzFile gz) {
    const cookie_io_functions_t functions{.read = [](void* from, char* to, std::size_t size) -> ssize_t {
                                              const int n = ::gzread(static_cast<gzFile>(from), to,
                                                                     static_cast<unsigned>(size));
                                              if (n < 0) errno = EIO;
                                              return n;
                                          },
                                          .write = nullptr,
                                          .seek = nullptr,
                                          .close = nullptr};
    return ::fopencookie(gz, "r", functions);
}

/// What compressed the file, other than gzip; empty: nothing that is known.
std::string_view compression_of(const std::string& path) {
    constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kMagic{{{"\x28\xB5\x2F\xFD", "zstd"},
                                                                                   {"\x04\x22\x4D\x18", "lz4"},
                                                                                   {"\xFD\x37zXZ", "xz"},
                                                                                   {"BZh", "bzip2"},
                                                                                   {"PK\x03\x04", "zip"}}};
    std::array<char, 8> head{};
    std::ifstream(path, std::ios::binary).read(head.data(), head.size());
    for (const auto& [magic, name] : kMagic)
        if (std::string_view(head.data(), head.size()).starts_with(magic)) return name;
    return {};
}

Error not_a_capture(const std::string& path, std::string_view why) {
    if (const auto name = compression_of(path); !name.empty())
        return {"is compressed by " + std::string(name) + ", expected a capture (pcap), plain or by gzip", path};
    return {std::string(why) + "; expected a capture (pcap)", path};
}

std::string link_name(int link_type) {
    const char* name = ::pcap_datalink_val_to_name(link_type);
    return name != nullptr ? name : "number " + std::to_string(link_type);
}

/// Reads frames up to the end of the file or to the first that is not whole.
Capture read_frames(pcap_t* file, gzFile gz) {
    Capture capture;
    DatagramReader reader(::pcap_datalink(file));
    pcap_pkthdr* header = nullptr;
    const u_char* bytes = nullptr;
    int read = 0;
    while ((read = ::pcap_next_ex(file, &header, &bytes)) == 1) {
        // With nanosecond precision libpcap keeps nanoseconds in tv_usec. Far dates of damaged files are clamped.
        const std::int64_t seconds = std::clamp<std::int64_t>(header->ts.tv_sec, 0, 9'000'000'000);
        const std::int64_t ns = std::clamp<std::int64_t>(header->ts.tv_usec, 0, kSecond_ns - 1);
        reader.take(seconds * kSecond_ns + ns, {bytes, header->caplen}, header->len);
    }
    int error = Z_OK;
    ::gzerror(gz, &error);
    if (read == PCAP_ERROR)
        capture.cut = ::pcap_geterr(file);
    else if (error == Z_BUF_ERROR)
        capture.cut = "unexpected end of the gzip stream";
    capture.datagrams = reader.finish();
    capture.counters = reader.counters();
    return capture;
}

}  // namespace

Result<Capture> read_capture(const std::string& path) {
    const std::unique_ptr<gzFile_s, int (*)(gzFile)> gz(::gzopen(path.c_str(), "rb"), ::gzclose_r);
    if (!gz) return Error{std::string(std::strerror(errno)) + "; expected a capture (pcap)", path};
    std::FILE* stream = stream_of(gz.get());
    if (stream == nullptr) return Error{std::strerror(errno), path, 0, 0, ErrorKind::missing};
    std::array<char, PCAP_ERRBUF_SIZE> why{};
    const std::unique_ptr<pcap_t, void (*)(pcap_t*)> file(
        ::pcap_fopen_offline_with_tstamp_precision(stream, PCAP_TSTAMP_PRECISION_NANO, why.data()), ::pcap_close);
    if (!file) {
        std::fclose(stream);
        return not_a_capture(path, why.data());
    }
    if (const int link = ::pcap_datalink(file.get()); !DatagramReader::reads_link(link))
        return Error{"link type " + link_name(link) +
                         ", expected Ethernet, Linux cooked (SLL, SLL2), raw IP or BSD loopback (NULL, LOOP)",
                     path};
    return read_frames(file.get(), gz.get());
}

}  // namespace narpa

#else

namespace narpa {

Error built_without_captures(const std::string& path) {
    return {"this narpa was built without captures",
            path,
            0,
            0,
            ErrorKind::missing,
            "cmake -DNARPA_WITH_PCAP=ON ... (needs libpcap-dev), and build again"};
}

Result<Capture> read_capture(const std::string& path) {
    return built_without_captures(path);
}

}  // namespace narpa

#endif
