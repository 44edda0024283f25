/// base/each_isa.h - one binary that uses the widest vector instructions the processor has.
#pragma once

/// Before the definition of a function that works on many lanes: it is compiled for AVX-512, for AVX2 and for the
/// base line of the machine, with all that it calls in header files, and the program's start chooses (GCC's
/// function multiversioning; Clang's does not combine with flatten). The same bytes come out of each: nothing is
/// contracted or reordered. The choice is made before the sanitizers are set up, so their builds have the base line
/// alone.
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && !NARPA_SANITIZED
#define NARPA_HAS_EACH_ISA
#define NARPA_EACH_ISA [[gnu::flatten, gnu::target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")]]
#else
#define NARPA_EACH_ISA
#endif
