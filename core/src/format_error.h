// What the decoder throws within the library; what is called from elsewhere turns it into a status.
#pragma once

#include <new>
#include <stdexcept>
#include <string>

#include "meshreel/status.h"

namespace meshreel {

#if defined(__wasm__)

// Why bytes were refused, in words; empty before.
inline std::string& last_refusal() {
    static std::string message;
    return message;
}

// Bytes that no encoder wrote. What catches it cannot look at it (wasm/exceptions.cpp): its message is put down.
struct FormatError {
    explicit FormatError(const std::string& message) { last_refusal() = message; }
};

#else

// Bytes that no encoder wrote.
struct FormatError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

#endif

// A source of bytes that fails.
struct SourceError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

inline void require(bool holds, const char* what) {
    if (!holds) throw FormatError(what);
}

// Throws what a status of the core tells.
inline void check(int status, const char* what = "") {
    if (status == MR_OK) return;
    if (status == MR_NO_MEMORY) throw std::bad_alloc();
    throw FormatError(std::string(what) + mr_message(status));
}

}  // namespace meshreel
