/// renderer/geometry/flush_denormals.h - flushes denormal floats to zero during its lifetime, as Embree advises.
#pragma once

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace narpa {

class FlushDenormals {
public:
    FlushDenormals(const FlushDenormals&) = delete;
    FlushDenormals& operator=(const FlushDenormals&) = delete;
#if defined(__SSE2__)
    FlushDenormals() noexcept : before_(_mm_getcsr()) {
        _mm_setcsr(before_ | 0x8040u);
    }  // FTZ | DAZ
    ~FlushDenormals() {
        _mm_setcsr(before_);
    }

private:
    unsigned before_;
#else
    FlushDenormals() noexcept {}
    ~FlushDenormals() {}
#endif
};

}  // namespace narpa
