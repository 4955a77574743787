// Speed without change of results: wide registers, and memory prefetched in time.
#pragma once

namespace meshreel {

// Has memory brought near that is soon written.
inline void will_write(const void* memory) {
#if defined(__GNUC__)
    __builtin_prefetch(memory, 1);
#else
    (void)memory;
#endif
}

#if defined(__x86_64__) && defined(__GNUC__)

template <class Body>
__attribute__((target("avx2"), flatten)) auto in_wide_registers(Body& body) {
    return body();
}

// Result of `body`, in registers as wide as the machine has: the compiler makes it twice. Each number comes about by
// the same operations in the same order, only more of them side by side, and none is fused: no bit depends on the
// machine.
template <class Body>
auto wide(Body body) {
    return __builtin_cpu_supports("avx2") ? in_wide_registers(body) : body();
}

#else

template <class Body>
auto wide(Body body) {
    return body();
}

#endif

}  // namespace meshreel
