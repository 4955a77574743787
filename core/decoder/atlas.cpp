// Where the corners of a base mesh's faces are in a texture. Beside src/meshreel/{coding/appearance,geometry}/atlas.py.
#include <limits>

#include "../src/records.h"
#include "budget.h"
#include "group.h"
#include "meshreel/places.h"

namespace meshreel {
namespace {

constexpr uint16_t kMostSide = 2048;  // texels

// Triangles cut in four, in the order of `subdivide`.
std::vector<float> cut(const std::vector<float>& places) {
    std::vector<float> finer;
    finer.reserve(4 * places.size());
    for (size_t f = 0; f < places.size(); f += 6) {
        // Corners a, b, c and the middles of ab, bc, ca.
        float points[6][2];
        for (size_t k = 0; k < 6; ++k) points[k / 2][k % 2] = places[f + k];
        for (size_t k = 0; k < 6; ++k)
            points[3 + k / 2][k % 2] = (points[k / 2][k % 2] + points[(k / 2 + 1) % 3][k % 2]) / 2;
        for (const size_t corner : {0, 3, 5, 3, 1, 4, 5, 4, 2, 3, 4, 5})
            finer.insert(finer.end(), points[corner], points[corner] + 2);
    }
    return finer;
}

}  // namespace

Layout decode_atlas(const mr_bytes& data, const Mesh& base) {
    const Atlas record = read_all<Atlas>(data, "Atlas");
    require(record.form == Form::PLACES, "an atlas of another form");
    for (const uint16_t side : {record.width, record.height})
        require(side > 0 && side <= kMostSide && side % 2 == 0, "a texture whose side is odd, 0 or too long");
    const size_t faces = base.face_count();
    const uint64_t most[3] = {4 * faces, 6 * faces, 2 * faces},
                   counts[3] = {record.join_count, record.start_count, record.rest_count};
    const mr_bytes coded[3] = {record.joins, record.starts, record.rests};
    std::vector<int32_t> streams[3];
    for (int k = 0; k < 3; ++k) {
        require(counts[k] <= most[k], "an atlas of more symbols than its faces have");
        streams[k] = decode_integers(coded[k], counts[k]);
    }
    const mr_mesh view = base.view();
    const mr_place_symbols symbols{streams[0].data(), streams[1].data(), streams[2].data(),
                                   streams[0].size(), streams[1].size(), streams[2].size()};
    std::vector<int32_t> places(6 * faces);
    check(mr_decode_places(&view, &symbols, places.data()), "an atlas: ");
    for (size_t k = 0; k < places.size(); ++k)
        require(places[k] >= 0 && places[k] <= (k % 2 == 0 ? record.width : record.height),
                "a place beyond its texture");
    return {record.width, record.height, std::make_shared<const std::vector<int32_t>>(std::move(places))};
}

std::vector<float> texels_of(const Layout& atlas, unsigned levels) {
    std::vector<float> places(atlas.places->begin(), atlas.places->end());
    for (size_t f = 0; f < places.size(); f += 6) {
        const float x = places[f], y = places[f + 1];
        if (places[f + 2] != x || places[f + 3] != y || places[f + 4] != x || places[f + 5] != y) continue;
        for (size_t k = 0; k < 6; ++k) places[f + k] = std::numeric_limits<float>::quiet_NaN();
    }
    for (unsigned level = 0; level < levels; ++level) places = cut(places);
    return places;
}

std::vector<float> places_of(const Layout& atlas, unsigned levels) {
    std::vector<float> places = texels_of(atlas, levels);
    for (size_t k = 0; k < places.size(); k += 2) {
        places[k] = static_cast<float>(double{places[k]} / atlas.width);
        places[k + 1] = static_cast<float>(1.0 - double{places[k + 1]} / atlas.height);
    }
    return places;
}

}  // namespace meshreel
