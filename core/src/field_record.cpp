#include "field_record.h"

#include <algorithm>

#include "escape.h"
#include "field_coder.h"
#include "meshreel/entropy.h"

namespace meshreel {
namespace {

int decode_basis(const CodedField& record, size_t width, size_t head, FieldStreams& out) {
    const size_t columns = static_cast<size_t>(record.columns);
    const size_t count = head + columns * width - columns * (columns > 0 ? columns - 1 : 0) / 2;
    if (!is_plausible(count, record.basis.size)) return MR_BAD_BASIS;
    std::vector<int32_t> values(count);
    if (mr_decode_integers(record.basis.data, record.basis.size, count, values.data()) != MR_OK) return MR_BAD_BASIS;
    out.head.assign(values.begin(), values.begin() + static_cast<ptrdiff_t>(head));
    out.means.assign(width, 0.0);
    out.vectors.resize(std::max(columns, size_t{1}) * width);  // room for one, so that pointers can be counted from it
    return mr_orthonormal_inverse(values.data() + head, columns, width, out.vectors.data());
}

}  // namespace

bool parse(const mr_bytes& bytes, CodedField& base, std::vector<ColorsLevel>& levels) {
    try {
        Records in(bytes);
        base = CodedField::read(in);
        for (ColorsLevel& level : levels) level = ColorsLevel::read(in);
        return in.left() == 0;
    } catch (...) {  // FormatError
        return false;
    }
}

Field FieldStreams::over(const mr_graph& graph, size_t first) {
    const size_t width = means.size();
    return {graph,  columns, width - first, width, vectors.data() + first, means.data() + first, differences.data(),
            nullptr};
}

int decode_streams(const CodedField& record, const mr_graph& graph, size_t width, size_t head, FieldStreams& out) {
    if (record.columns > width || record.step_level >= kRungs) return MR_BAD_COLUMNS;
    const int status = decode_basis(record, width, head, out);
    if (status != MR_OK) return status;
    out.columns = static_cast<size_t>(record.columns);
    const uint64_t count = uint64_t{out.columns} * graph.count;
    if ((count > 0) != (record.symbols.size > 0) || !is_plausible(count, record.symbols.size)) return MR_BAD_SYMBOLS;
    const size_t stride = stride_of(out.columns);
    if (uint64_t{stride} * (graph.count + 1) > SIZE_MAX / sizeof(double)) return MR_NO_MEMORY;
    out.differences.assign(stride * (graph.count + 1), 0.0);
    const mr_weights shape{nullptr, graph.count, out.columns, graph.starts, graph.near, 0};
    const FieldTable table{out.differences.data(), stride};
    return decode_symbols(shape, record.symbols, step_of(record.step_level), table) ? MR_OK : MR_BAD_SYMBOLS;
}

}  // namespace meshreel
