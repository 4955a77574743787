// Memory for what a call works on, and for what it returns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace meshreel {

// A block of memory, which may be one that was given back before: fresh pages take as long as decoding into them. May
// throw std::bad_alloc. Blocks are kept by the thread that gives them back, up to a bound.
void* take_block(size_t bytes);
void give_block(void* block) noexcept;

template <class T>
struct BlockAllocator {
    using value_type = T;
    BlockAllocator() = default;
    template <class Other>
    BlockAllocator(const BlockAllocator<Other>&) noexcept {}
    T* allocate(size_t count) {
        return static_cast<T*>(take_block(count > SIZE_MAX / sizeof(T) ? SIZE_MAX : count * sizeof(T)));
    }
    void deallocate(T* block, size_t) noexcept { give_block(block); }
    friend bool operator==(const BlockAllocator&, const BlockAllocator&) noexcept { return true; }
    friend bool operator!=(const BlockAllocator&, const BlockAllocator&) noexcept { return false; }
};

template <class T>
using Array = std::vector<T, BlockAllocator<T>>;

struct BlockReturn {
    void operator()(void* block) const noexcept { give_block(block); }
};

// An array of numbers that are not set to anything.
template <class T>
using Scratch = std::unique_ptr<T[], BlockReturn>;

template <class T>
Scratch<T> scratch(size_t count) {
    return Scratch<T>(BlockAllocator<T>().allocate(count));
}

}  // namespace meshreel
