// The records of the form LAYERS as they lie in a file (FORMAT.md): parsed, and their streams decoded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "field_rows.h"
#include "meshreel/layers.h"
#include "rigid3.h"
#include "scratch.h"

namespace meshreel {

struct CodedField {
    uint64_t columns;
    uint8_t step_level;
    mr_bytes basis, symbols;
};

// Motion that all vertices share, coded before the basis: Common of src/meshreel/format/layout.py.
enum class Common : uint8_t { kNone, kShifts, kPoses };

struct LayersGroup {
    uint8_t frames;
    Common common;
    CodedField motion;
};

struct LayersLevel {
    bool follows;  // its scalars are counted from the last frame of the group before
    int curvature, sibling_weight;
    CodedField scalars;
};

// Colours of the vertices that a subdivision adds.
struct ColorsLevel {
    int sibling_weight;
    CodedField values;
};

// False where the bytes are not exactly one such record.
bool parse(const mr_bytes& bytes, CodedField& record);
bool parse(const mr_bytes& bytes, LayersGroup& record);
bool parse(const mr_bytes& bytes, LayersLevel& record);
// The same of a CodedField and a ColorsLevel for each of `levels`.
bool parse(const mr_bytes& bytes, CodedField& base, std::vector<ColorsLevel>& levels);

// A turn about the middle of a base mesh, then a shift.
struct Pose {
    Matrix turn;
    Vec shift;
};

// What the streams of a CodedField hold.
struct FieldStreams {
    std::vector<double> vectors, means;
    std::vector<Pose> poses;  // of every frame, if that is what is common
    Array<double> differences;  // of values and what predicts them, as FieldRows takes them
    size_t columns;

    // The numbers of each row from the first-th on.
    Field over(const mr_graph& graph, size_t first = 0);
};

// Returns a status. The graph must be causal; poses take three numbers of `width` a frame. May throw std::bad_alloc.
int decode_streams(const CodedField& record, const mr_graph& graph, size_t width, Common common, FieldStreams& out);

}  // namespace meshreel
