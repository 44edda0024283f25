#include "emulator/log/zstd_frame.h"

#include <zstd.h>

#include <cassert>
#include <memory>

namespace narpa {

std::function<void(std::span<const std::uint8_t> from, std::vector<std::uint8_t>& to)> zstd_frames(int level) {
    const std::shared_ptr<ZSTD_CCtx> context(ZSTD_createCCtx(), ZSTD_freeCCtx);
    return [context, level](std::span<const std::uint8_t> from, std::vector<std::uint8_t>& to) {
        to.resize(ZSTD_compressBound(from.size()));
        const std::size_t size =
            ZSTD_compressCCtx(context.get(), to.data(), to.size(), from.data(), from.size(), level);
        assert(!ZSTD_isError(size) && "the buffer is as large as the bound");
        to.resize(size);
    };
}

}  // namespace narpa
