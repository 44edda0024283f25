// narpa-mesh-reader FILE MEMORY_BYTES SECONDS - reads a mesh file with Assimp, within limits of memory and time,
// and writes the triangles and materials to standard output as a MeshMessage. narpa starts it for each mesh file of
// a scene.
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>

#include "renderer/mesh_reader/assimp_reader.h"

namespace {

constexpr bool kSanitized = NARPA_SANITIZED;  // sanitizers reserve terabytes of addresses, and report on stderr

void limit(decltype(RLIMIT_AS) what, rlim_t most) {
    const rlimit both{most, most};
    setrlimit(what, &both);
}

void confine(rlim_t memory_bytes, rlim_t seconds) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    std::set_new_handler([] { _exit(narpa::kOutOfMemory); });
    if (!kSanitized) limit(RLIMIT_AS, memory_bytes);
    limit(RLIMIT_CPU, seconds + 1);  // narpa ends it before, unless that is gone
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_FSIZE, 0);
    // A crash is reported by narpa; the C library's words about it would stand among those of narpa.
    if (const int nothing = open("/dev/null", O_WRONLY); !kSanitized && nothing >= 0) dup2(nothing, STDERR_FILENO);
}

struct Sender {
    static constexpr bool kReceives = false;
    static bool bytes(const void* data, std::size_t size) {
        for (const auto* at = static_cast<const char*>(data); size > 0;) {
            const ssize_t n = write(STDOUT_FILENO, at, size);
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) return false;
            at += n, size -= static_cast<std::size_t>(n);
        }
        return true;
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fputs("narpa-mesh-reader is started by narpa for each mesh file: FILE MEMORY_BYTES SECONDS\n", stderr);
        return 2;
    }
    confine(std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10));
    narpa::MeshMessage message = narpa::read_with_assimp(argv[1]);
    Sender out;
    // Without destructors: Assimp's may crash on what a damaged file left behind.
    _exit(narpa::mesh_message::transfer(out, message) ? 0 : 1);
}
