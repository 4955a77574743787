// Memory for the arguments that a host of the wasm build passes.
#include <cstdlib>

extern "C" {

void* mr_allocate(size_t size) { return std::malloc(size); }
void mr_release(void* memory) { std::free(memory); }
}
