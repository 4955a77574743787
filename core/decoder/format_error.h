// What the decoder throws within the library; api.cpp turns it into a status.
#pragma once

#include <new>
#include <stdexcept>
#include <string>

#include "meshreel/status.h"

namespace meshreel {

// Bytes that no encoder wrote.
struct FormatError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

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
