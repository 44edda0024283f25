/// pcl_vlp_receiver - decodes VLP-16 packets with PCL's unmodified VLP grabber and prints every whole sweep.
///
/// Usage: pcl_vlp_receiver udp IP PORT SWEEPS SECONDS
///        pcl_vlp_receiver pcap FILE SWEEPS SECONDS
///
/// Prints "ready" once it listens, then one line "sweep x y z intensity" a point, in the order in which PCL decoded
/// them; metres, lidar frame. Ends after SWEEPS sweeps with exit 0, or after SECONDS with exit 1.
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

void print_sweep(int number, const Cloud& cloud) {
    for (const pcl::PointXYZI& p : cloud)
        std::printf("%d %.9g %.9g %.9g %g\n", number, static_cast<double>(p.x), static_cast<double>(p.y),
                    static_cast<double>(p.z), static_cast<double>(p.intensity));
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    const std::string source = argc > 1 ? argv[1] : "";
    const bool live = source == "udp" && argc == 6;
    if (!live && !(source == "pcap" && argc == 5)) {
        std::fprintf(stderr, "usage: %s udp IP PORT SWEEPS SECONDS | pcap FILE SWEEPS SECONDS\n", argv[0]);
        return 2;
    }
    const int sweeps_wanted = std::atoi(argv[argc - 2]);
    const auto deadline =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(std::atof(argv[argc - 1]));

    std::unique_ptr<pcl::VLPGrabber> grabber;
    if (live)
        grabber = std::make_unique<pcl::VLPGrabber>(boost::asio::ip::make_address(argv[2]),
                                                    static_cast<std::uint16_t>(std::atoi(argv[3])));
    else
        grabber = std::make_unique<pcl::VLPGrabber>(std::string(argv[2]));

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
