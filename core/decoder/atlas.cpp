// Where the corners of a base mesh's faces are in a texture. Beside src/meshreel/{coding/appearance,geometry}/atlas.py.
#include <limits>

#include "budget.h"
#include "group.h"
#include "head.h"
#include "meshreel/places.h"
#include "records.h"

namespace meshreel {
namespace {

constexpr uint16_t kMostSide = 2048;  // texels

// Triangles cut in four, in the order of `subdivide`.
std::vector<double> cut(const std::vector<double>& places) {
    std::vector<double> finer;
    finer.reserve(4 * places.size());
    for (size_t f = 0; f < places.size(); f += 6) {
        // Corners a, b, c and the middles of ab, bc, ca.
        double points[6][2];
        for (size_t k = 0; k < 6; ++k) points[k / 2][k % 2] = places[f + k];
        for (size_t k = 0; k < 6; ++k)
            points[3 + k / 2][k % 2] = (points[k / 2][k % 2] + points[(k / 2 + 1) % 3][k % 2]) / 2;
        for (const size_t corner : {0, 3, 5, 3, 1, 4, 5, 4, 2, 3, 4, 5})
            finer.insert(finer.end(), points[corner], points[corner] + 2);
    }
    return finer;
}

}  // namespace

Atlas decode_atlas(const mr_bytes& data, const Mesh& base) {
    Records in(data);
    Atlas atlas;
    require(in.u8() == kPlaces, "an atlas of another form");
    atlas.width = in.u16(), atlas.height = in.u16();
    for (const uint16_t side : {atlas.width, atlas.height})
        require(side > 0 && side <= kMostSide && side % 2 == 0, "a texture whose side is odd, 0 or too long");
    const size_t faces = base.face_count();
    uint64_t counts[3];
    const uint64_t most[3] = {4 * faces, 6 * faces, 2 * faces};
    for (int k = 0; k < 3; ++k) {
        counts[k] = in.varint();
        require(counts[k] <= most[k], "an atlas of more symbols than its faces have");
    }
    std::vector<int32_t> streams[3];
    for (int k = 0; k < 3; ++k) streams[k] = decode_integers(in.blob(in.varint()), counts[k]);
    in.finish("Atlas");
    const mr_mesh view = base.view();
    const mr_place_symbols symbols{streams[0].data(), streams[1].data(), streams[2].data(),
                                   streams[0].size(), streams[1].size(), streams[2].size()};
    std::vector<int32_t> places(6 * faces);
    check(mr_decode_places(&view, &symbols, places.data()), "an atlas: ");
    for (size_t k = 0; k < places.size(); ++k)
        require(places[k] >= 0 && places[k] <= (k % 2 == 0 ? atlas.width : atlas.height), "a place beyond its texture");
    atlas.places = std::make_shared<const std::vector<int32_t>>(std::move(places));
    return atlas;
}

std::vector<float> places_of(const Atlas& atlas, unsigned levels) {
    std::vector<double> places(atlas.places->begin(), atlas.places->end());
    for (size_t f = 0; f < places.size(); f += 6) {
        const double x = places[f], y = places[f + 1];
        if (places[f + 2] != x || places[f + 3] != y || places[f + 4] != x || places[f + 5] != y) continue;
        for (size_t k = 0; k < 6; ++k) places[f + k] = std::numeric_limits<double>::quiet_NaN();
    }
    for (unsigned level = 0; level < levels; ++level) places = cut(places);
    std::vector<float> found(places.size());
    for (size_t k = 0; k < places.size(); k += 2) {
        found[k] = static_cast<float>(places[k] / atlas.width);
        found[k + 1] = static_cast<float>(1.0 - places[k + 1] / atlas.height);
    }
    return found;
}

}  // namespace meshreel
