// Lets Python mutate: libFuzzer finds LLVMFuzzerCustomMutator only in what is loaded before it starts, and calls here
// what was set.
#include <cstddef>
#include <cstdint>

extern "C" {

size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t most);

using Mutator = size_t (*)(uint8_t* data, size_t size, size_t most, unsigned seed);
static Mutator mutator = nullptr;

void set_mutator(Mutator given) { mutator = given; }

size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t most, unsigned seed) {
    return mutator ? mutator(data, size, most, seed) : LLVMFuzzerMutate(data, size, most);
}
}
