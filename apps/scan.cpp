// narpa scan - what one LiDAR measures during a turn (or longer), as a point cloud, a table of shots or a capture.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "apps/cli.h"
#include "apps/pose_options.h"
#include "drivers/lidar/packet_sink.h"
#include "emulator/lidar_unit.h"
#include "renderer/lidar/lidar_shot.h"

namespace narpa::cli {
namespace {

struct Options {
    std::string scene, lidar, out;
    PoseOptions pose;
    double time_s = 0, duration_s = 0;
};

struct ScanPoint {
    Vec3 position_m{};  ///< LiDAR frame
    float reflectivity = 0;
};

/// One output format. Receives every packet, then is closed.
class Writer {
public:
    virtual ~Writer() = default;
    virtual void packet(std::int64_t number, LidarUnit& unit) = 0;
    virtual Status close() = 0;
};

class File {
public:
    static Result<File> create(const std::string& path) {
        std::FILE* f = std::fopen(path.c_str(), "w");
        if (!f) return Error{"cannot be written", path};
        return File(f, path);
    }
    template <class... Args>
    void print(fmt::format_string<Args...> format, Args&&... args) {
        fmt::print(file_.get(), format, std::forward<Args>(args)...);
    }
    Status close() {
        const bool bad = std::ferror(file_.get()) != 0;
        if (std::fclose(file_.release()) != 0 || bad)
            return Error{"cannot be written to the end", path_, 0, 0, ErrorKind::failed};
        return Ok{};
    }

private:
    struct Closer {
        void operator()(std::FILE* f) const { std::fclose(f); }
    };
    File(std::FILE* f, std::string path) : file_(f), path_(std::move(path)) {}
    std::unique_ptr<std::FILE, Closer> file_;
    std::string path_;
};

/// One row per shot, with or without a return: the truth behind the packets.
class ShotTable final : public Writer {
public:
    explicit ShotTable(File file) : file_(std::move(file)) {
        file_.print("t_ns,packet,block,laser,azimuth_rad,elevation_rad,range_m,x_m,y_m,z_m,reflectivity,body\n");
    }
    void packet(std::int64_t number, LidarUnit& unit) override {
        for (std::size_t i = 0; i < unit.shots().size(); ++i) {
            const LidarShot& s = unit.shots()[i];
            const LidarReturn& r = unit.hits()[i];
            const Vec3 p = s.origin_m + r.range_m * s.direction;
            file_.print("{},{},{},{},{},{},{},{},{},{},{},{}\n", unit.packet_start_ns(number) + s.t_offset_ns,
                        number, s.block, s.beam, s.azimuth_rad, s.elevation_rad, r.range_m, p.x, p.y, p.z,
                        r.reflectivity, r.range_m > 0 ? r.body : -1);
        }
    }
    Status close() override { return file_.close(); }

private:
    File file_;
};

/// PLY or PCD, ASCII. Both start with the number of points, so the points are collected first.
class PointCloud final : public Writer {
public:
    PointCloud(File file, bool ply) : file_(std::move(file)), ply_(ply) {}
    void packet(std::int64_t, LidarUnit& unit) override {
        for (std::size_t i = 0; i < unit.shots().size(); ++i) {
            const LidarShot& s = unit.shots()[i];
            const LidarReturn& r = unit.hits()[i];
            if (r.range_m > 0) points_.push_back({s.origin_m + r.range_m * s.direction, r.reflectivity});
        }
    }
    Status close() override {
        if (ply_) {
            file_.print(
                "ply\nformat ascii 1.0\ncomment LiDAR frame, metres\nelement vertex {}\nproperty float x\n"
                "property float y\nproperty float z\nproperty float intensity\nend_header\n",
                points_.size());
        } else {
            file_.print(
                "# .PCD v0.7\n# LiDAR frame, metres\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F "
                "F\n"
                "COUNT 1 1 1 1\nWIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
                points_.size(), points_.size());
        }
        for (const ScanPoint& p : points_)
            file_.print("{} {} {} {}\n", static_cast<float>(p.position_m.x), static_cast<float>(p.position_m.y),
                        static_cast<float>(p.position_m.z), p.reflectivity);
        return file_.close();
    }

private:
    File file_;
    bool ply_;
    std::vector<ScanPoint> points_;
};

/// The packets themselves.
class Capture final : public Writer {
public:
    explicit Capture(std::unique_ptr<PacketSink> sink) : sink_(std::move(sink)) {}
    void packet(std::int64_t number, LidarUnit& unit) override {
        const std::int64_t t = unit.t_sent_ns(number);
        sink_->send(PacketKind::data, unit.bytes(), t);
        if (const auto position = unit.position(number); !position.empty())
            sink_->send(PacketKind::position, position, t);
    }
    Status close() override {
        sink_->flush();
        if (sink_->counters().dropped > 0)
            return Error{"packets could not be written", sink_->description(), 0, 0, ErrorKind::failed};
        return Ok{};
    }

private:
    std::unique_ptr<PacketSink> sink_;
};

Result<std::unique_ptr<Writer>> open_writer(const std::string& path, const LidarNetwork& network,
                                            std::int64_t epoch_unix_ns) {
    const std::string extension = path.substr(std::min(path.rfind('.'), path.size()));
    if (extension == ".pcap") {
        auto sink = open_packet_sink(path, network, epoch_unix_ns, true);
        if (!sink) return sink.error();
        return std::unique_ptr<Writer>(new Capture(*std::move(sink)));
    }
    if (extension != ".csv" && extension != ".ply" && extension != ".pcd")
        return Error{"unknown kind of file, expected .ply, .pcd, .csv or .pcap", path};
    auto file = File::create(path);
    if (!file) return file.error();
    if (extension == ".csv") return std::unique_ptr<Writer>(new ShotTable(*std::move(file)));
    return std::unique_ptr<Writer>(new PointCloud(*std::move(file), extension == ".ply"));
}

Outcome scan(const Options& o) {
    auto scene = load_scene(o.scene);
    if (!scene) return scene.error();
    auto index = sensor_named(scene->lidars, o.lidar, "LiDAR", scene->file);
    if (!index) return index.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();

    const double duration_s = o.duration_s > 0 ? o.duration_s : 1 / (*world)->scene().lidars[*index].rate_hz;
    const std::int64_t from_ns = std::llround(o.time_s * 1e9), to_ns = from_ns + std::llround(duration_s * 1e9);
    if (auto loaded = o.pose.load(**world, from_ns, to_ns); !loaded) return loaded.error();
    LidarUnit unit(**world, *index);
    auto writer = open_writer(o.out, unit.lidar().model->spec().network, (*world)->scene().epoch_unix_ns);
    if (!writer) return writer.error();

    std::size_t packets = 0, shots = 0, returns = 0;
    for (std::int64_t p = unit.first_packet_from(from_ns); unit.packet_start_ns(p) < to_ns; ++p) {
        unit.fire(p);
        ++packets;
        shots += unit.shots().size();
        returns += unit.returns();
        (*writer)->packet(p, unit);
    }
    if (auto closed = (*writer)->close(); !closed) return closed.error();
    say(fmt::format("{}: {} packets, {} shots, {} returns", o.out, packets, shots, returns));
    return nlohmann::json{{"file", o.out},
                          {"lidar", unit.lidar().name},
                          {"packets", packets},
                          {"shots", shots},
                          {"returns", returns}};
}

}  // namespace

Command add_scan(Parser app) {
    auto o = std::make_shared<Options>();
    const Parser c = app.subcommand("scan", "Scan with a LiDAR from a time on: points, shots or packets");
    c.option("SCENE", o->scene, "Scene file (TOML)").required();
    c.option("--lidar", o->lidar, "Name of the LiDAR (default: the first)");
    c.option("--time", o->time_s, "Simulation time in seconds of the first packet").range(0.0, 9e9).shows_default();
    c.option("--duration", o->duration_s, "Seconds (default: one turn)").range(0.0, 3600.0);
    o->pose.add_to(c);
    c.option("-o,--output", o->out,
             "FILE.ply or .pcd (points), .csv (one row a shot, ranges unquantised), .pcap (packets)")
        .required();
    return [o] { return scan(*o); };
}

}  // namespace narpa::cli
