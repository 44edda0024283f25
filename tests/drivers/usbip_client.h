/// tests/drivers/usbip_client.h - the host's end of USB/IP, for tests of devices without a kernel.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <string>
#include <vector>

#include "drivers/descriptor.h"
#include "protocols/big_endian.h"
#include "protocols/usb/usbip.h"

namespace narpa {

class UsbIpClient {
public:
    using Bytes = std::vector<std::uint8_t>;

    explicit UsbIpClient(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_port = htons(port);
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
        const timeval patience{60, 0};  // a broken server fails its test instead of hanging it
        ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    }

    void send(std::span<const std::uint8_t> bytes) {
        ASSERT_EQ(::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
    }
    /// Fewer where the server has ended the connection.
    Bytes receive(std::size_t n) {
        Bytes bytes(n);
        std::size_t got = 0;
        while (got < n) {
            const ssize_t more = ::recv(fd_.get(), bytes.data() + got, n - got, 0);
            if (more <= 0) break;
            got += static_cast<std::size_t>(more);
        }
        bytes.resize(got);
        return bytes;
    }
    [[nodiscard]] bool is_over() { return receive(1).empty(); }

    /// The status of the answer.
    std::uint32_t import(const std::string& bus_id = "1-1") {
        send(encode_usbip_op({UsbIpOp::import_request, 0}));
        Bytes id(kUsbIpBusIdBytes);
        std::copy(bus_id.begin(), bus_id.end(), id.begin());
        send(id);
        const Bytes header = receive(kUsbIpOpBytes);
        if (header.size() != kUsbIpOpBytes) return 999;
        const std::uint32_t status = get_be<std::uint32_t>(&header[4]);
        if (status == 0) (void)receive(kUsbIpDeviceBytes);
        return status;
    }

    /// Begins a transfer and returns its number.
    std::uint32_t begin(int endpoint, bool to_host, std::uint32_t length, const UsbSetup& setup = {},
                        std::span<const std::uint8_t> data = {}) {
        Bytes bytes(kUsbIpHeaderBytes);
        encode_usbip_request(UsbIpSubmit{++sequence_, static_cast<std::uint8_t>(endpoint), to_host, length, setup},
                             std::span(bytes).first<kUsbIpHeaderBytes>());
        bytes.insert(bytes.end(), data.begin(), data.end());
        send(bytes);
        return sequence_;
    }
    std::uint32_t unlink(std::uint32_t victim) {
        Bytes bytes(kUsbIpHeaderBytes);
        encode_usbip_request(UsbIpUnlink{++sequence_, victim}, std::span(bytes).first<kUsbIpHeaderBytes>());
        send(bytes);
        return sequence_;
    }
    struct Done {
        UsbIpReply reply{};
        Bytes data{};
    };
    /// The next answer. `to_host`: its transfer was.
    Done next(bool to_host) {
        const Bytes header = receive(kUsbIpHeaderBytes);
        if (header.size() != kUsbIpHeaderBytes) return {{false, 0, -999, 0}};
        const auto reply = decode_usbip_reply(std::span(header).first<kUsbIpHeaderBytes>());
        EXPECT_TRUE(reply);
        if (!reply) return {};
        return {*reply, to_host && !reply->to_unlink ? receive(reply->length) : Bytes{}};
    }
    Done ask(const UsbSetup& setup) {
        begin(0, true, setup.length, setup);
        return next(true);
    }
    Done tell(const UsbSetup& setup, std::span<const std::uint8_t> data) {
        begin(0, false, static_cast<std::uint32_t>(data.size()), setup, data);
        return next(false);
    }
    void hang_up() { fd_.reset(); }

private:
    Descriptor fd_;
    std::uint32_t sequence_ = 0;
};

}  // namespace narpa
