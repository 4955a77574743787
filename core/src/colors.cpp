#include "meshreel/colors.h"

#include <algorithm>
#include <memory>
#include <vector>

#include "arrays.h"
#include "field_record.h"
#include "guarded.h"
#include "meshreel/layers.h"
#include "wide.h"

namespace meshreel {
namespace {

// ITU-R BT.709: luma of red and of blue, and what a full colour difference is of blue and of red.
constexpr double kRed = 0.2126, kBlue = 0.0722, kGreen = 1.0 - kRed - kBlue;
constexpr double kBlueDifference = 2.0 * (1.0 - kBlue), kRedDifference = 2.0 * (1.0 - kRed);

// Edges and faces of a subdivision, and each edge's siblings.
struct Subdivision {
    std::vector<int32_t> edges, faces, near;
    std::vector<int64_t> starts;
    size_t edge_count = 0;

    int make(const int32_t* coarse, size_t face_count, size_t vertices) {
        edges.resize(6 * face_count), faces.resize(12 * face_count), near.resize(3 * face_count);
        int status = mr_subdivide(coarse, face_count, vertices, edges.data(), faces.data(), &edge_count);
        starts.resize(edge_count + 1);
        if (status == MR_OK)
            status = mr_siblings(faces.data(), face_count, vertices, edge_count, starts.data(), near.data());
        return status;
    }
};

// Rows of a mesh's vertices: luma of all frames, then one colour difference, then the other.
class Colors {
public:
    Colors(const mr_colored& colored, double* last)
        : colored_(colored), width_(3 * colored.frames), rows_(width_ * colored.vertices), last_(last) {}

    int decode_base(const CodedField& record) {
        const mr_mesh& base = *colored_.base;
        if (base.vertices > colored_.vertices) return MR_BAD_RECORD;
        mr_hierarchy* made = nullptr;
        const int status = mr_hierarchy_create(&base, &made);
        if (status != MR_OK) return status;
        const std::unique_ptr<mr_hierarchy, void (*)(mr_hierarchy*)> owner(made, mr_hierarchy_destroy);
        const int32_t* order = mr_hierarchy_order(made);
        count_ = base.vertices;
        return each_row(record, mr_hierarchy_graph(made), [&](size_t place, const double* row) {
            const size_t v = static_cast<size_t>(order[place]);
            std::copy_n(add_before(v, row), width_, rows_.data() + width_ * v);
        });
    }

    int decode_level(const ColorsLevel& record, const Subdivision& level) {
        const size_t edges = level.edge_count;
        if (count_ + edges > colored_.vertices) return MR_BAD_RECORD;
        std::vector<double> weights(level.near.size());
        for (size_t e = 0; e < edges; ++e) {
            const int64_t begin = level.starts[e], end = level.starts[e + 1];
            std::fill(weights.begin() + begin, weights.begin() + end,
                      record.sibling_weight / (64.0 * static_cast<double>(end - begin)));
        }
        const mr_graph graph{edges, level.starts.data(), level.near.data(), weights.data()};
        const int status = each_row(record.values, graph, [&](size_t e, const double* row) {
            const double *a = row_of(level.edges[2 * e]), *b = row_of(level.edges[2 * e + 1]);
            double* out = rows_.data() + width_ * (count_ + e);
            const double* offsets = add_before(count_ + e, row);
            for (size_t k = 0; k < width_; ++k) out[k] = (a[k] + b[k]) / 2.0 + offsets[k];
        });
        count_ += edges;
        return status;
    }

    bool are_all() const { return count_ == colored_.vertices; }

    void write(uint8_t* colors) const {
        const size_t frames = colored_.frames;
        for (size_t t = 0; t < frames; ++t)
            for (size_t v = 0; v < count_; ++v, colors += 3) {
                const double* row = rows_.data() + width_ * v;
                const double luma = row[t] + 0.5, of_blue = row[t + frames] / colored_.chroma * kBlueDifference,
                             of_red = row[t + 2 * frames] / colored_.chroma * kRedDifference;
                colors[0] = byte_of(luma + of_red);
                colors[1] = byte_of(luma - kBlue / kGreen * of_blue - kRed / kGreen * of_red);
                colors[2] = byte_of(luma + of_blue);
            }
    }

private:
    const double* row_of(int32_t v) const { return rows_.data() + width_ * static_cast<size_t>(v); }

    static uint8_t byte_of(double share) {
        const double value = 255.0 * share + 0.5;
        return value >= 255.0 ? 255 : value >= 0.0 ? static_cast<uint8_t>(value) : 0;  // 0 also for what is no number
    }

    // The row of a vertex, its values in the group before added; they become those that this group leaves.
    const double* add_before(size_t v, const double* row) {
        const size_t frames = colored_.frames;
        const double* before = colored_.before ? colored_.before + 3 * v : nullptr;
        std::copy_n(row, width_, sum_.data());
        for (size_t k = 0; k < 3; ++k) {
            double* values = sum_.data() + k * frames;
            for (size_t t = 0; before && t < frames; ++t) values[t] += before[k];
            last_[3 * v + k] = values[frames - 1];
        }
        return sum_.data();
    }

    template <class Visit>
    int each_row(const CodedField& record, const mr_graph& graph, Visit visit) {
        FieldStreams streams;
        const int status = decode_streams(record, graph, width_, 0, streams);
        if (status != MR_OK) return status;
        FieldRows values(streams.over(graph));
        std::vector<double> block(kRowBlock * width_);
        sum_.resize(width_);
        for (size_t first = 0; first < graph.count; first += kRowBlock) {
            const size_t count = std::min(kRowBlock, graph.count - first);
            values.next(count, block.data());
            for (size_t k = 0; k < count; ++k) visit(first + k, block.data() + width_ * k);
        }
        return MR_OK;
    }

    const mr_colored& colored_;
    size_t width_, count_ = 0;
    Array<double> rows_;
    std::vector<double> sum_;
    double* last_;
};

int decode(const mr_colored& colored, const CodedField& base, const std::vector<ColorsLevel>& levels, uint8_t* colors,
           double* last) {
    Colors found(colored, last);
    int status = found.decode_base(base);
    Subdivision level, finer;
    const int32_t* faces = colored.base->faces;
    size_t face_count = colored.base->face_count, vertices = colored.base->vertices;
    for (size_t k = 0; status == MR_OK && k < levels.size(); ++k) {
        status = finer.make(faces, face_count, vertices);
        if (status == MR_OK) status = found.decode_level(levels[k], finer);
        std::swap(level, finer);
        faces = level.faces.data(), face_count *= 4, vertices += level.edge_count;
    }
    if (status != MR_OK) return status;
    if (!found.are_all()) return MR_BAD_RECORD;
    found.write(colors);
    return MR_OK;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_decode_colors(const mr_colored* colored, const mr_bytes* records, uint8_t* colors, double* last) {
    if (colored->frames == 0 || colored->levels < 0 || !(colored->chroma > 0)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        CodedField base;
        std::vector<ColorsLevel> levels(static_cast<size_t>(colored->levels));
        if (!parse(*records, base, levels)) return MR_BAD_RECORD;
        return wide([&] { return decode(*colored, base, levels, colors, last); });
    });
}

void mr_color_values(const uint8_t* colors, size_t count, double chroma, double* values) {
    for (size_t v = 0; v < count; ++v, colors += 3, values += 3) {
        const double red = colors[0] / 255.0, blue = colors[2] / 255.0;
        const double luma = kRed * red + kGreen * (colors[1] / 255.0) + kBlue * blue;
        values[0] = luma - 0.5;
        values[1] = (blue - luma) / kBlueDifference * chroma;
        values[2] = (red - luma) / kRedDifference * chroma;
    }
}
