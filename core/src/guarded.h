// The way out of the C ABI: nothing is thrown across it.
#pragma once

#include <new>

namespace meshreel {

#if defined(__cpp_exceptions) && !defined(__wasm__)

// Result of `body`, `no_memory` if it ran out of memory, and `failed` if it threw anything else.
template <class Body>
int guarded(int no_memory, int failed, Body body) {
    try {
        return body();
    } catch (const std::bad_alloc&) {
        return no_memory;
    } catch (...) {
        return failed;
    }
}

#else

// In wasm nothing can look at what was thrown: all of it goes on to the host's call.
template <class Body>
int guarded(int, int, Body body) {
    return body();
}

#endif

// The same of a body that can throw only for want of memory: std::bad_alloc, or std::length_error.
template <class Body>
int guarded(int no_memory, Body body) {
    return guarded(no_memory, no_memory, body);
}

}  // namespace meshreel
