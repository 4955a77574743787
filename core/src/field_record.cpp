#include "field_record.h"

#include <algorithm>
#include <cmath>

#include "escape.h"
#include "field_coder.h"
#include "meshreel/entropy.h"

namespace meshreel {
namespace {

constexpr int kStepLevels = 200;  // of the ladder of steps (src/meshreel/coding/steps.py)
constexpr uint8_t kLayers = 2;    // Form.LAYERS of src/meshreel/format/layout.py

// Fields of a record in turn. Beyond the end, or after a number that is not in its shortest form, all of them are 0.
class Fields {
public:
    explicit Fields(const mr_bytes& bytes) : at_(bytes.data), left_(bytes.size) {}

    bool is_done() const { return good_ && left_ == 0; }

    uint8_t u8() {
        const uint8_t* byte = take(1);
        return byte ? *byte : 0;
    }
    uint8_t at_most(uint8_t largest) {
        const uint8_t value = u8();
        good_ = good_ && value <= largest;
        return value;
    }
    bool one_of_two() { return at_most(1) == 1; }
    uint64_t varint() {
        uint64_t value = 0;
        for (int shift = 0; shift < 70; shift += 7) {
            const uint8_t byte = u8();
            if (shift == 63 && byte > 1) good_ = false;  // beyond 64 bits
            if (!good_) return 0;
            value |= static_cast<uint64_t>(byte & 0x7F) << shift;
            if (byte & 0x80) continue;
            good_ = shift == 0 || byte != 0;
            return value;
        }
        return 0;
    }
    mr_bytes blob() {
        const uint64_t size = varint();
        const uint8_t* data = take(size);
        return {data, data ? static_cast<size_t>(size) : 0};
    }
    void skip(size_t size) { take(size); }

    CodedField field() {
        CodedField out{};
        out.columns = varint();
        out.step_level = u8();
        out.basis = blob();
        out.symbols = blob();
        return out;
    }

private:
    const uint8_t* take(uint64_t size) {
        good_ = good_ && size <= left_;
        if (!good_) return nullptr;
        const uint8_t* from = at_;
        at_ += size;
        left_ -= static_cast<size_t>(size);
        return from;
    }

    const uint8_t* at_;
    size_t left_;
    bool good_ = true;
};

// 2^(-level / 8), exactly as src/meshreel/coding/steps.py has it: the eighths are rounded to 32 bits.
double step_of(int level) {
    constexpr double kEighths[8] = {4294967296.0, 3938502376.0, 3611622603.0, 3311872529.0,
                                    3037000500.0, 2784941738.0, 2553802834.0, 2341847524.0};
    return std::ldexp(kEighths[level % 8], -32 - level / 8);
}

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

bool parse(const mr_bytes& bytes, CodedField& record) {
    Fields fields(bytes);
    record = fields.field();
    return fields.is_done();
}

bool parse(const mr_bytes& bytes, LayersGroup& record) {
    Fields fields(bytes);
    if (fields.u8() != kLayers) return false;
    fields.one_of_two();  // origin
    record.frames = fields.u8();
    fields.skip(1 + 8);  // levels and step
    fields.blob();       // the base mesh
    record.shared = static_cast<Shared>(fields.at_most(2));
    record.motion = fields.field();
    return fields.is_done();
}

bool parse(const mr_bytes& bytes, LayersLevel& record) {
    Fields fields(bytes);
    record.follows = fields.one_of_two();
    record.curvature = fields.u8();
    record.sibling_weight = fields.u8();
    record.scalars = fields.field();
    return fields.is_done();
}

bool parse(const mr_bytes& bytes, CodedField& base, std::vector<ColorsLevel>& levels) {
    Fields fields(bytes);
    base = fields.field();
    for (ColorsLevel& level : levels) {
        level.sibling_weight = fields.u8();
        level.values = fields.field();
    }
    return fields.is_done();
}

Field FieldStreams::over(const mr_graph& graph, size_t first) {
    const size_t width = means.size();
    return {graph,  columns, width - first, width, vectors.data() + first, means.data() + first, differences.data(),
            nullptr};
}

int decode_streams(const CodedField& record, const mr_graph& graph, size_t width, size_t head, FieldStreams& out) {
    if (record.columns > width || record.step_level >= kStepLevels) return MR_BAD_COLUMNS;
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
