#include "renderer/dem_reader/one_folder.h"

#include <cpl_vsi.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <string_view>

namespace narpa {
namespace {

struct OneFolder {
    std::string path;

    /// The path of a file by its plain name; empty for a name with a slash.
    [[nodiscard]] std::string file(const char* name) const {
        const std::string_view plain(name);
        return plain.empty() || plain.find('/') != plain.npos ? "" : path + "/" + std::string(plain);
    }
};

int stat_file(void* folder, const char* name, VSIStatBufL* out, int) {
    const std::string file = static_cast<const OneFolder*>(folder)->file(name);
    if (!file.empty() && VSIStatL(file.c_str(), out) == 0 && S_ISREG(out->st_mode)) return 0;
    errno = ENOENT;  // GDAL's message says why
    return -1;
}

void* open_file(void* folder, const char* name, const char* access) {
    VSIStatBufL found{};
    const bool reads = std::string_view(access).find_first_of("wa+") == std::string_view::npos;
    if (!reads || stat_file(folder, name, &found, 0) != 0) return nullptr;
    return std::fopen(static_cast<const OneFolder*>(folder)->file(name).c_str(), "rbe");
}

FILE* handle(void* file) {
    return static_cast<FILE*>(file);
}

}  // namespace

std::string open_in_one_folder(const std::string& path) {
    const std::filesystem::path whole(path);
    static OneFolder folder;
    folder.path = whole.has_parent_path() ? whole.parent_path().string() : ".";
    VSIFilesystemPluginCallbacksStruct* calls = VSIAllocFilesystemPluginCallbacksStruct();
    calls->pUserData = &folder;
    calls->stat = stat_file;
    calls->open = open_file;
    calls->tell = [](void* f) { return static_cast<vsi_l_offset>(::ftello(handle(f))); };
    calls->seek = [](void* f, vsi_l_offset to, int whence) {
        return ::fseeko(handle(f), static_cast<off_t>(to), whence);
    };
    calls->read = [](void* f, void* to, std::size_t size, std::size_t count) {
        return std::fread(to, size, count, handle(f));
    };
    calls->eof = [](void* f) { return std::feof(handle(f)); };
    calls->close = [](void* f) { return std::fclose(handle(f)); };
    static_cast<void>(VSIInstallPluginHandler(kOneFolder, calls));
    VSIFreeFilesystemPluginCallbacksStruct(calls);
    return kOneFolder + whole.filename().string();
}

}  // namespace narpa
