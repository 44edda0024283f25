#include "renderer/scene/mesh_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <utility>

#include "base/program_beside.h"
#include "renderer/scene/mesh_message.h"

namespace narpa {

namespace {

/// The process, and the end of the pipe that it writes to.
class MeshProcess {
public:
    /// 0, or the errno of why it cannot be started.
    int start(const std::string& path, const MeshReaderLimits& limits) {
        std::array<int, 2> ends{};
        if (::pipe2(ends.data(), O_CLOEXEC) != 0) return errno;
        out_ = ends[0];
        std::array<std::string, 4> line{program_beside("narpa-mesh-reader"), path,
                                        std::to_string(limits.memory_bytes), std::to_string(limits.seconds)};
        std::array<char*, 5> argv{line[0].data(), line[1].data(), line[2].data(), line[3].data(), nullptr};
        posix_spawn_file_actions_t files;
        posix_spawnattr_t attributes;
        sigset_t none;
        sigemptyset(&none);
        posix_spawn_file_actions_init(&files);
        posix_spawn_file_actions_adddup2(&files, ends[1], STDOUT_FILENO);
        posix_spawnattr_init(&attributes);
        posix_spawnattr_setsigmask(&attributes, &none);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
        const int failed = posix_spawnp(&pid_, argv[0], &files, &attributes, argv.data(), environ);
        posix_spawnattr_destroy(&attributes);
        posix_spawn_file_actions_destroy(&files);
        ::close(ends[1]);
        return failed;
    }
    MeshProcess() = default;
    MeshProcess(const MeshProcess&) = delete;
    MeshProcess& operator=(const MeshProcess&) = delete;
    ~MeshProcess() {
        end();
        if (out_ >= 0) ::close(out_);
    }

    /// Ends it; its wait status. One that had closed its pipe by ending keeps the status that it ended with.
    int end() {
        if (const pid_t pid = std::exchange(pid_, -1); pid > 0) {
            ::kill(pid, SIGKILL);
            while (::waitpid(pid, &status_, 0) < 0 && errno == EINTR) {
            }
        }
        return status_;
    }
    [[nodiscard]] int output() const { return out_; }

private:
    pid_t pid_ = -1;
    int out_ = -1, status_ = 0;
};

/// Bytes of a pipe, until a time and up to a number.
class Receiver {
public:
    static constexpr bool kReceives = true;

    Receiver(int fd, const MeshReaderLimits& limits)
        : fd_(fd), left_(limits.memory_bytes), deadline_(Clock::now() + std::chrono::seconds(limits.seconds)) {}

    bool bytes(void* data, std::size_t size) {
        if (size > left_) return false;
        left_ -= size;
        for (char* at = static_cast<char*>(data); size > 0;) {
            if (!wait()) return false;
            const ssize_t n = ::read(fd_, at, size);
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) return false;
            at += n, size -= static_cast<std::size_t>(n);
        }
        return true;
    }
    [[nodiscard]] bool timed_out() const { return timed_out_; }

private:
    using Clock = std::chrono::steady_clock;

    bool wait() {
        for (;;) {
            const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline_ - Clock::now()).count();
            pollfd end{fd_, POLLIN, 0};
            const int ready = left > 0 ? ::poll(&end, 1, static_cast<int>(left)) : 0;
            if (ready == 0) timed_out_ = true;
            if (ready >= 0 || errno != EINTR) return ready > 0;
        }
    }

    int fd_;
    std::uint64_t left_;
    Clock::time_point deadline_;
    bool timed_out_ = false;
};

MeshMaterial checked(PlainMaterial&& m) {
    const PlainMaterial::Numbers& n = m.numbers;
    MeshMaterial out;
    switch (n.kind) {
        case PlainMaterial::Kind::glass: out.material = smooth_glass(std::move(m.name), n.ior, n.emission); break;
        case PlainMaterial::Kind::metallic_roughness:
            out.material =
                metallic_roughness(std::move(m.name), n.diffuse, n.metallic, n.roughness, n.ior, n.emission);
            break;
        default: out.material = diffuse_and_lobe(std::move(m.name), n.diffuse, n.specular, n.exponent, n.emission);
    }
    out.material.normal_scale = n.normal_scale > 0 ? std::min(n.normal_scale, 100.0f) : 0.0f;
    for (MeshTexture* t : {&m.colour, &m.emission, &m.normal})
        if (t->wrap != Texture::Wrap::clamp) t->wrap = Texture::Wrap::repeat;
    out.colour = std::move(m.colour), out.emission = std::move(m.emission), out.normal = std::move(m.normal);
    return out;
}

bool indices_are_sound(const TriangleSoup& s) {
    const auto in = [](std::uint32_t index, std::size_t size) {
        return index == TriangleSoup::kNone || index < size;
    };
    for (const TriangleSoup::Triangle& t : s.triangles) {
        if (t.material >= s.materials.size()) return false;
        for (const TriangleSoup::Corner& c : t.corners)
            if (c.position >= s.positions.size() || !in(c.uv, s.uvs.size()) || !in(c.normal, s.normals.size()))
                return false;
    }
    return true;
}

/// What ended a process that had not sent a whole mesh.
std::string why_it_ended(int status, const MeshReaderLimits& limits) {
    if (WIFEXITED(status) && WEXITSTATUS(status) == kOutOfMemory)
        return fmt::format("the mesh reader ran out of memory (limit {:.3g} GiB)",
                           static_cast<double>(limits.memory_bytes) / (std::uint64_t{1} << 30));
    const std::string how = WIFSIGNALED(status) ? fmt::format("signal {}", WTERMSIG(status))
                                                : fmt::format("exit status {}", WEXITSTATUS(status));
    return fmt::format("the mesh reader crashed ({})", how);
}

}  // namespace

bool is_read_in_process(const std::string& extension) {
    constexpr std::array kAll{".gltf", ".glb", ".ply", ".stl", ".3ds", ".dae"};
    return std::find(kAll.begin(), kAll.end(), extension) != kAll.end();
}

Result<TriangleSoup> read_soup_in_process(const std::string& path, const MeshReaderLimits& limits) {
    MeshProcess process;
    if (const int failed = process.start(path, limits); failed != 0)
        return Error{
            .what = fmt::format("cannot start narpa-mesh-reader, which reads it: {}, expected it beside the "
                                "program or on PATH",
                                std::strerror(failed)),
            .file = path,
            .kind = ErrorKind::missing};
    MeshMessage message;
    Receiver receiver(process.output(), limits);
    const bool whole = mesh_message::transfer(receiver, message);
    const int status = process.end();
    const auto broken = [&](const std::string& what) {
        return Error{.what = what + "; the file is damaged or too large, expected it exported anew, or as OBJ",
                     .file = path};
    };
    if (receiver.timed_out()) return broken(fmt::format("the mesh reader took longer than {} s", limits.seconds));
    if (!whole) return broken(why_it_ended(status, limits));
    if (!message.error.empty())
        return Error{.what = message.error, .file = path, .line = message.line, .column = message.column};
    for (PlainMaterial& m : message.materials) message.soup.materials.push_back(checked(std::move(m)));
    if (message.materials.size() > kMaxMaterials || !indices_are_sound(message.soup))
        return broken("the mesh reader returned indices that are out of range");
    return std::move(message.soup);
}

}  // namespace narpa
