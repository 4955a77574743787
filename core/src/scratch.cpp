#include "scratch.h"

#include <algorithm>
#include <cstdlib>
#include <new>

namespace meshreel {
namespace {

constexpr size_t kLine = 64;  // bytes of a cache line: no register of a block's numbers lies in two

// Lies right before a block.
struct Head {
    size_t bytes;  // of the block
    void* memory;  // which holds both
};

[[noreturn]] void refuse() {
#if defined(__cpp_exceptions)
    throw std::bad_alloc();
#else
    std::abort();  // as a want of memory does in a build without exceptions
#endif
}

Head* make(size_t bytes) {
    if (bytes > SIZE_MAX - 2 * kLine) refuse();
    void* memory = ::operator new(bytes + 2 * kLine);
    const uintptr_t block = (reinterpret_cast<uintptr_t>(memory) + sizeof(Head) + kLine - 1) / kLine * kLine;
    Head* head = reinterpret_cast<Head*>(block) - 1;
    *head = {bytes, memory};
    return head;
}

void destroy(Head* head) noexcept { ::operator delete(head->memory); }

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define MR_WATCHED
#endif
#endif

#if defined(__wasm__) || defined(__SANITIZE_ADDRESS__) || defined(MR_WATCHED)

// Memory here has no pages to wait for, or a sanitizer that watches it.
Head* take(size_t bytes) { return make(bytes); }
void give(Head* head) noexcept { destroy(head); }

#else

constexpr size_t kMostKept = 16 << 20;  // bytes of a thread (guess): two groups of 10 frames of 12,000 vertices
constexpr size_t kLeastKept = 1 << 14;  // bytes; smaller ones take few pages (guess)
constexpr size_t kSlots = 32;           // blocks of a thread (guess)

// The blocks that a thread has given back, the oldest first. They outlive `emptied`: arrays may be freed after it.
struct Kept {
    Head* heads[kSlots];
    size_t count, bytes;
    bool closed;

    Head* remove(size_t k) {
        Head* head = heads[k];
        std::copy(heads + k + 1, heads + count, heads + k);
        --count;
        bytes -= head->bytes;
        return head;
    }
};
thread_local Kept kept;

struct Emptied {  // where the thread ends
    ~Emptied() {
        while (kept.count > 0) destroy(kept.remove(0));
        kept.closed = true;
    }
};
thread_local Emptied emptied;

// The last one given back that has room and is not much too large, for it is the nearest in the caches; or a new one.
Head* take(size_t bytes) {
    for (size_t k = kept.count; k-- > 0;) {
        const size_t room = kept.heads[k]->bytes;
        if (room >= bytes && room / 2 <= bytes) return kept.remove(k);
    }
    return make(bytes);
}

void give(Head* head) noexcept {
    (void)&emptied;  // made where it is first named
    if (kept.closed || head->bytes < kLeastKept || head->bytes > kMostKept) return destroy(head);
    while (kept.count == kSlots || kept.bytes + head->bytes > kMostKept) destroy(kept.remove(0));
    kept.heads[kept.count++] = head;
    kept.bytes += head->bytes;
}

#endif

}  // namespace

void* take_block(size_t bytes) { return take(bytes) + 1; }

void give_block(void* block) noexcept { give(static_cast<Head*>(block) - 1); }

}  // namespace meshreel
