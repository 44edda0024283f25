/// base/each_isa.h - one binary that uses the widest vector instructions the processor has.
#pragma once

/// Attribute for the definition of a function that works on many lanes: compiles it, with all that it calls in
/// header files, for AVX-512, AVX2 and the baseline of the architecture; the version is chosen at program start
/// (GCC's function multiversioning; Clang's does not combine with flatten). All versions give the same bytes:
/// floating-point operations are neither contracted nor reordered. The choice is made before the sanitizers are
/// initialised, so sanitizer builds have the baseline alone.
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && !NARPA_SANITIZED
#define NARPA_HAS_EACH_ISA
#define NARPA_EACH_ISA [[gnu::flatten, gnu::target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")]]
#else
#define NARPA_EACH_ISA
#endif
