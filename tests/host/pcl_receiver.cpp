/// pcl_receiver - decodes Velodyne packets with PCL's unmodified grabbers and prints every whole sweep.
///
/// Usage: pcl_receiver VLP-16|HDL-32E udp IP PORT SWEEPS SECONDS
///        pcl_receiver VLP-16|HDL-32E pcap FILE SWEEPS SECONDS
///
/// Prints "ready" once it listens, then one line "sweep x y z intensity" a point, in the order in which PCL decoded
/// them; metres, lidar frame. Ends after SWEEPS sweeps with exit 0, or after SECONDS with exit 1.
#include <pcl/io/hdl_grabber.h>
#include <pcl/io/vlp_grabber.h>
#include <pcl/point_types.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZI>;

struct Source {
    std::string kind, place;
    int port = 0;
};

/// The HDL grabber's own corrections, which it takes without a file, are those of an HDL-32E.
std::unique_ptr<pcl::HDLGrabber> open(const std::string& make, const Source& s) {
    const bool vlp = make == "VLP-16";
    if (s.kind == "pcap")
        return vlp ? std::make_unique<pcl::VLPGrabber>(s.place) : std::make_unique<pcl::HDLGrabber>("", s.place);
    const auto address = boost::asio::ip::make_address(s.place);
    const auto port = static_cast<std::uint16_t>(s.port);
    return vlp ? std::make_unique<pcl::VLPGrabber>(address, port)
               : std::make_unique<pcl::HDLGrabber>(address, port, "");
}

void print_sweep(int number, const Cloud& cloud) {
    for (const pcl::PointXYZI& p : cloud)
        std::printf("%d %.9g %.9g %.9g %g\n", number, static_cast<double>(p.x), static_cast<double>(p.y),
                    static_cast<double>(p.z), static_cast<double>(p.intensity));
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    const std::string make = argc > 1 ? argv[1] : "", kind = argc > 2 ? argv[2] : "";
    const bool known = make == "VLP-16" || make == "HDL-32E";
    if (!known || !((kind == "udp" && argc == 7) || (kind == "pcap" && argc == 6))) {
        std::fprintf(stderr, "usage: %s VLP-16|HDL-32E udp IP PORT SWEEPS SECONDS | pcap FILE SWEEPS SECONDS\n",
                     argv[0]);
        return 2;
    }
    const int sweeps_wanted = std::atoi(argv[argc - 2]);
    const auto deadline =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(std::atof(argv[argc - 1]));
    const auto grabber = open(make, {kind, argv[3], kind == "udp" ? std::atoi(argv[4]) : 0});

    std::atomic<int> sweeps{0};
    const std::function<void(const Cloud::ConstPtr&)> on_sweep = [&](const Cloud::ConstPtr& cloud) {
        if (sweeps < sweeps_wanted) print_sweep(sweeps, *cloud);
        ++sweeps;
    };
    grabber->registerCallback(on_sweep);
    grabber->start();
    std::printf("ready\n");
    std::fflush(stdout);
    while (sweeps < sweeps_wanted && std::chrono::steady_clock::now() < deadline)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    // Not by return: stop(), which the destructor calls, waits for ever for a datagram that does not come.
    _exit(sweeps < sweeps_wanted ? 1 : 0);
}
