// The records of the form LAYERS as they lie in a file (FORMAT.md): parsed, and their streams decoded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "field_rows.h"
#include "layout.gen.h"
#include "meshreel/layers.h"
#include "scratch.h"

namespace meshreel {

// False where the bytes are not exactly one such record.
template <class Record>
bool parse(const mr_bytes& bytes, Record& record) {
    try {
        record = read_all<Record>(bytes, "record");
        return true;
    } catch (...) {  // FormatError
        return false;
    }
}
// The same of a CodedField and a ColorsLevel for each of `levels`.
bool parse(const mr_bytes& bytes, CodedField& base, std::vector<ColorsLevel>& levels);

// Contents of the streams of a CodedField.
struct FieldStreams {
    std::vector<int32_t> head;           // integers before those of the basis
    std::vector<double> vectors, means;  // means: zeros
    Array<double> differences;           // of values and what predicts them, as FieldRows takes them
    size_t columns;

    // The numbers of each row from the first-th on.
    Field over(const mr_graph& graph, size_t first = 0);
};

// Returns a status. The graph must be causal; `head` integers lie before the basis. May throw std::bad_alloc.
int decode_streams(const CodedField& record, const mr_graph& graph, size_t width, size_t head, FieldStreams& out);

}  // namespace meshreel
