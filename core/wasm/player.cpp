#include "player.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../decoder/budget.h"
#include "../decoder/group.h"
#include "../decoder/splats.h"
#include "packing.h"

using namespace meshreel;

namespace {

constexpr size_t kTextureWidth = 2048;   // that every WebGL 2 has
constexpr size_t kMostRows = 16384;      // that nearly every one has; 33 million vertices
constexpr size_t kMostSplats = 1 << 22;  // their texture has no more rows than that, and none draws more in time
constexpr uint16_t kNoPlace = 65535;
constexpr double kPlaceScale = 65534, kSplatWeight = 1 << 14, kFullTurn = 1 << 16;
constexpr size_t kSplatWords = 8, kTexelWords = 4;
constexpr double kTwoPi = 2 * 3.14159265358979323846;

double rounded(double value) { return std::floor(value + 0.5); }

// The arrays that a packed chunk consists of.
struct Arrays {
    std::vector<uint16_t> texels, places, extra_places;
    std::vector<uint8_t> colors;
    std::vector<uint32_t> faces, extra, starts, words;
};

template <class T>
mr_array view(const std::vector<T>& numbers) {
    return {numbers.data(), numbers.size() * sizeof(T)};
}

// Four bytes a colour, and room for `count`.
std::vector<uint8_t> color_texels(const std::vector<uint8_t>& colors, size_t count) {
    std::vector<uint8_t> texels(4 * count);
    for (size_t v = 0; 3 * v < colors.size(); ++v) {
        std::memcpy(&texels[4 * v], &colors[3 * v], 3);
        texels[4 * v + 3] = 255;
    }
    return texels;
}

// Places of the corners of faces one behind the other; a face -1 has none.
std::vector<uint16_t> packed_places(const Layout& atlas, const std::vector<float>& texels,
                                    const std::vector<int32_t>& faces) {
    std::vector<uint16_t> packed(6 * faces.size(), kNoPlace);
    for (size_t f = 0; f < faces.size(); ++f) {
        const float* from = faces[f] < 0 ? nullptr : &texels[6 * static_cast<size_t>(faces[f])];
        if (!from || std::isnan(from[0])) continue;
        for (size_t k = 0; k < 6; ++k) {
            const double side = k % 2 == 0 ? atlas.width : atlas.height;
            packed[6 * f + k] = static_cast<uint16_t>(rounded(kPlaceScale * double{from[k]} / side));
        }
    }
    return packed;
}

void append_corners(const int32_t* corners, size_t count, uint32_t first, std::vector<uint32_t>& out) {
    for (size_t k = 0; k < count; ++k) out.push_back(first + static_cast<uint32_t>(corners[k]));
}

// The faces that every frame shows, and those of single ones: kept there though not everywhere, or of its own mesh.
void pack_faces(const Group& group, const Layout* atlas, Arrays& out) {
    const size_t count = group.faces->size() / 3;
    std::vector<uint8_t> ever(count);
    for (size_t k = 0; k < group.dropped.size(); ++k) ever[k % count] |= group.dropped[k];
    std::vector<int32_t> common, changing, single;
    for (size_t f = 0; f < count; ++f) (ever[f] ? changing : common).push_back(static_cast<int32_t>(f));
    const int32_t* corners = group.faces->data();
    for (const int32_t f : common) append_corners(corners + 3 * f, 3, 0, out.faces);
    uint32_t first = static_cast<uint32_t>(group.vertices);
    out.starts.assign(1, 0);
    for (size_t t = 0; t < group.frames; ++t) {
        for (const int32_t f : changing) {
            if (group.dropped_in(t)[f]) continue;
            append_corners(corners + 3 * f, 3, 0, out.extra);
            single.push_back(f);
        }
        if (!group.added.empty()) {
            const Mesh& mesh = group.added[t];
            append_corners(mesh.faces->data(), mesh.faces->size(), first, out.extra);
            single.insert(single.end(), mesh.face_count(), -1);
            first += static_cast<uint32_t>(mesh.vertex_count());
        }
        out.starts.push_back(static_cast<uint32_t>(out.extra.size()));
    }
    if (!atlas) return;
    const std::vector<float> texels = texels_of(*atlas, group.levels);
    out.places = packed_places(*atlas, texels, common);
    out.extra_places = packed_places(*atlas, texels, single);
}

void grow(const std::vector<double>& vertices, double* box) { mr_grow_box(vertices.data(), vertices.size() / 3, box); }

// An empty box where there is no vertex.
void close_box(double* box) {
    for (int k = 0; k < 3; ++k) {
        box[k] = std::isfinite(box[k]) ? box[k] : 0;
        box[3 + k] = std::isfinite(box[3 + k]) ? std::max(box[k], box[3 + k]) : box[k];
    }
}

void pack_vertices(const Group& group, double* box, Arrays& out, mr_packed& packed) {
    std::vector<Mesh> frames;
    size_t total = 0;
    for (size_t t = 0; t < group.frames; ++t) {
        total += group.vertices + (group.added.empty() ? 0 : group.added[t].vertex_count());
        if (!group.added.empty()) grow(group.added[t].vertices, box);
    }
    mr_grow_box(group.positions.data(), group.positions.size() / 3, box);
    packed.rows = static_cast<uint32_t>(std::max<size_t>(1, (total + kTextureWidth - 1) / kTextureWidth));
    require(packed.rows <= kMostRows, "a group of more vertices in all frames than can be shown");
    packed.vertices = static_cast<uint32_t>(group.vertices);
    out.texels.resize(4 * kTextureWidth * packed.rows);
    uint16_t* behind = out.texels.data() + 4 * group.frames * group.vertices;
    std::vector<uint16_t> texels;
    for (size_t t = 0; t < group.frames; ++t) {
        const Mesh mesh = group.frame(t);
        texels.resize(4 * mesh.vertex_count());
        const mr_mesh view = mesh.view();
        check(mr_pack_vertices(&view, box, texels.data()));
        const auto own = texels.begin() + static_cast<ptrdiff_t>(4 * group.vertices);
        std::copy(texels.begin(), own, out.texels.begin() + static_cast<ptrdiff_t>(4 * t * group.vertices));
        behind = std::copy(own, texels.end(), behind);
    }
}

// A bit for each frame that lacks a face; nothing where none does.
std::vector<uint32_t> lacking_bits(const Group& group, size_t face) {
    std::vector<uint32_t> bits((group.frames + 31) / 32);
    bool is_ever = false;
    for (size_t t = 0; t < group.frames && !group.dropped.empty(); ++t) {
        if (!group.dropped_in(t)[face]) continue;
        bits[t >> 5] |= 1u << (t & 31);
        is_ever = true;
    }
    return is_ever ? bits : std::vector<uint32_t>();
}

uint32_t byte_of(double value) { return static_cast<uint32_t>(rounded(255 * value)); }

// The words of a splat but the last; what types.ts says of PackedSplats.
void pack_splat(const Splat& splat, const Located& at, const Group& group, double scale, uint32_t* words) {
    size_t first = 0;  // the corner at which the edge begins that has the direction of the base's first
    while (at.along[(first + 2) % 3] != 0) ++first;
    const size_t corners[3] = {first, (first + 1) % 3, (first + 2) % 3};
    for (size_t n = 0; n < 3; ++n) words[n] = static_cast<uint32_t>((*group.faces)[3 * at.face + corners[n]]);
    const auto weight = [&](size_t n) { return static_cast<uint32_t>(rounded(kSplatWeight * at.weights[corners[n]])); };
    words[3] = weight(1) | weight(2) << 16;
    const float offset = static_cast<float>(scale * splat.offset);
    std::memcpy(words + 4, &offset, sizeof offset);
    const double back = at.along[first] > 0 ? kFullTurn / 2 : 0;
    const uint32_t turn = static_cast<uint32_t>(rounded(splat.turn / kTwoPi * kFullTurn + back)) % (1u << 16);
    words[5] = turn | uint32_t{splat.rungs[0]} << 16 | uint32_t{splat.rungs[1]} << 24;
    words[6] = byte_of(splat.opacity) << 24;
    for (int d = 0; d < 3; ++d) words[6] |= byte_of(splat.color[d]) << (8 * d);
}

void pack_splats(const Splats& splats, const Group& group, double scale, Arrays& out, mr_packed& packed) {
    const size_t count = splats.all.size(), own = kSplatWords * count;
    std::vector<uint32_t>& words = out.words;
    words.assign(own, 0);
    for (size_t k = 0; k < count; ++k) {
        const Located at = locate(splats.all[k], group.levels);
        pack_splat(splats.all[k], at, group, scale, &words[kSplatWords * k]);
        const std::vector<uint32_t> bits = lacking_bits(group, at.face);
        words[kSplatWords * k + 7] = bits.empty() ? 0 : static_cast<uint32_t>(words.size());
        words.insert(words.end(), bits.begin(), bits.end());
    }
    const size_t row = kTexelWords * kTextureWidth;
    words.resize((words.size() + row - 1) / row * row);
    packed.splats = static_cast<uint32_t>(count);
    packed.unit = scale * splats.growth;
}

}  // namespace

struct mr_made {
    mr_placement place;
    Context context;
    bool is_group;
    // Of a group:
    std::shared_ptr<State> previous;
    Continued made;
    std::shared_ptr<const Layout> layout;  // its own, or that of the group before
    std::shared_ptr<const Splats> splats;
    // Of a background:
    Background background;
    double cost = 0, size = 0;  // of what led to it

    Arrays arrays;
    mr_packed packed{};
    mr_shown shown{};
    Mesh mesh;
    Bound bound;

    const Mesh* base() const {
        if (!is_group) return &background.added.base;
        return made.canvas.empty() ? nullptr : &made.canvas[0].base;
    }
    const Mesh& some_base() const {
        require(base(), "a companion of a group without a mesh");
        return *base();
    }
    bool has_places() const {
        if (!layout || !base() || layout->places->size() != 2 * base()->faces->size()) return false;
        return is_group || background.mesh.faces->size() == base()->faces->size();
    }
};

namespace {

// What `body` gives, or `refused`, where it throws.
template <class Result, class Body>
Result caught(Result refused, Body body) {
    last_refusal().clear();
    try {
        return body();
    } catch (...) {
        return refused;
    }
}

void open_group(const mr_bytes& data, const mr_chunk& chunk, mr_made& made) {
    const mr_made* before = chunk.previous;
    if (before) made.previous = before->made.state;
    made.context = {static_cast<size_t>(chunk.frames), chunk.layers < 0 ? kAllLayers : chunk.layers,
                    made.previous.get(), made.place, chunk.is_shown != 0};
    made.made = continue_group(data, made.context);
    if (!before) return;
    made.layout = before->layout;
    const bool is_same = made.base() && before->base() && made.base()->faces->size() == before->base()->faces->size();
    if (is_same) made.splats = before->splats;
}

void open_background(const mr_bytes& data, const mr_made* before, mr_made& made) {
    const Mesh* changed = before ? &before->background.mesh : nullptr;
    made.background = decode_background(data, changed, made.place);
    made.size = count_of(data.size) + (before ? before->size : 0);
    if (before) made.cost = before->cost + change_cost(*changed, made.background.mesh);
    require(made.cost <= limits::kChain * allowance(made.size), "a background that costs more than its bytes may");
}

void pack_group(mr_made& made, const Layout* atlas) {
    const Group& group = made.made.group;
    Arrays& out = made.arrays;
    pack_vertices(group, made.packed.box, out, made.packed);
    pack_faces(group, atlas, out);
    const bool is_colored = !group.colors.empty() || std::any_of(group.added.begin(), group.added.end(),
                                                                 [](auto& mesh) { return !mesh.colors.empty(); });
    if (is_colored) {
        std::vector<uint8_t> colors = group.colors;
        for (const Mesh& mesh : group.added) colors.insert(colors.end(), mesh.colors.begin(), mesh.colors.end());
        out.colors = color_texels(colors, kTextureWidth * made.packed.rows);
    }
    if (made.splats) pack_splats(*made.splats, group, made.place.scale, out, made.packed);
}

void pack_background(mr_made& made, const Layout* atlas) {
    const Mesh& mesh = made.background.mesh;
    Arrays& out = made.arrays;
    grow(mesh.vertices, made.packed.box);
    out.texels.resize(4 * mesh.vertex_count());
    const mr_mesh view = mesh.view();
    check(mr_pack_vertices(&view, made.packed.box, out.texels.data()));
    made.packed.vertices = static_cast<uint32_t>(mesh.vertex_count());
    append_corners(mesh.faces->data(), mesh.faces->size(), 0, out.faces);
    if (!mesh.colors.empty()) out.colors = color_texels(mesh.colors, mesh.vertex_count());
    if (!atlas) return;
    std::vector<int32_t> all(mesh.face_count());
    for (size_t f = 0; f < all.size(); ++f) all[f] = static_cast<int32_t>(f);
    out.places = packed_places(*atlas, texels_of(*atlas, 0), all);
}

}  // namespace

mr_made* mr_open_chunk(const mr_chunk* chunk) {
    return caught<mr_made*>(nullptr, [&] {
        auto made = std::make_unique<mr_made>();
        made->place = *chunk->place, made->is_group = chunk->frames >= 0;
        const mr_bytes data{chunk->data, chunk->size};
        if (made->is_group) open_group(data, *chunk, *made);
        else open_background(data, chunk->previous, *made);
        return made.release();
    });
}

void mr_close_chunk(mr_made* made) { delete made; }

void mr_trim_chunk(mr_made* made) {
    made->made.group = Group(), made->arrays = Arrays(), made->mesh = Mesh(), made->bound = Bound();
}

const char* mr_refusal(void) { return last_refusal().c_str(); }

int mr_dress_chunk(mr_made* made, int kind, const uint8_t* bytes, size_t size) {
    return caught<int>(MR_BAD_RECORD, [&]() -> int {
        const mr_bytes data{bytes, size};
        if (kind == MR_COLORS && made->is_group) paint_group(data, made->context, made->made);
        if (kind == MR_COLORS && !made->is_group) paint_background(data, made->background);
        if (kind == MR_ATLAS) made->layout = std::make_shared<const Layout>(decode_atlas(data, made->some_base()));
        if (kind == MR_SPLATS) {
            auto splats = std::make_shared<const Splats>(decode_splats(data, made->some_base().face_count()));
            if (splats->all.size() > kMostSplats) throw FormatError("more splats than can be shown");
            made->splats = splats;
        }
        return MR_OK;
    });
}

const mr_packed* mr_pack_chunk(mr_made* made, int is_textured) {
    return caught<const mr_packed*>(nullptr, [&]() -> const mr_packed* {
        constexpr double far = std::numeric_limits<double>::infinity();
        made->arrays = {},
        made->packed = {{far, far, far, -far, -far, -far}, 0, 0, 0, 0, 0, 0, {}, {}, {}, {}, {}, {}, {}, {}};
        const Layout* atlas = is_textured && made->has_places() ? made->layout.get() : nullptr;
        if (made->is_group) pack_group(*made, atlas);
        else pack_background(*made, atlas);
        mr_packed& packed = made->packed;
        const Arrays& out = made->arrays;
        close_box(packed.box);
        if (atlas) packed.width = atlas->width, packed.height = atlas->height;
        packed.texels = view(out.texels), packed.colors = view(out.colors), packed.faces = view(out.faces);
        packed.extra = view(out.extra), packed.starts = view(out.starts), packed.places = view(out.places);
        packed.extra_places = view(out.extra_places), packed.words = view(out.words);
        return &packed;
    });
}

const mr_shown* mr_show_frame(mr_made* made, size_t frame) {
    return caught<const mr_shown*>(nullptr, [&] {
        const Group& group = made->made.group;
        made->mesh = made->is_group ? group.frame(frame) : made->background.mesh;
        made->bound = made->splats ? bind_splats(made->splats->all, group, frame, made->place.scale) : Bound();
        const Mesh& mesh = made->mesh;
        const Bound& bound = made->bound;
        made->shown = {view(mesh.vertices), view(*mesh.faces),  view(mesh.colors),     view(bound.means),
                       view(bound.axes),    view(bound.scales), view(bound.opacities), view(bound.colors)};
        return &made->shown;
    });
}
