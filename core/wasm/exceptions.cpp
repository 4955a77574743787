// What throwing needs, as small as the player needs it: no catch looks at what was thrown, and nothing but FormatError
// and a want of memory is thrown. The compiler's own library for wasm has no exceptions.
#if defined(__wasm__)
#include <cstdlib>

__asm__(
    ".globl __cpp_exception\n"
    ".tagtype __cpp_exception i32\n"
    "__cpp_exception:\n");

extern "C" {

void* __cxa_allocate_exception(size_t size) noexcept {
    void* thrown = std::malloc(size);
    if (!thrown) std::abort();
    return thrown;
}
void __cxa_free_exception(void* thrown) noexcept { std::free(thrown); }
[[noreturn]] void __cxa_throw(void* thrown, void*, void* (*)(void*)) { __builtin_wasm_throw(0, thrown); }
void* __cxa_begin_catch(void* thrown) noexcept {
    std::free(thrown);  // which nobody reads, and nothing destroys
    return nullptr;
}
void __cxa_end_catch() {}
[[noreturn]] void __cxa_rethrow() { std::abort(); }
}
#endif
