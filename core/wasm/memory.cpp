// What a host of the wasm build needs besides the C ABI: memory to put arguments in.
#include <cstdlib>

extern "C" {

void* mr_allocate(size_t size) { return std::malloc(size); }
void mr_release(void* memory) { std::free(memory); }
}
