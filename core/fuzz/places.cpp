// Places of a mesh's corners in a texture: those that decode are those that their symbols encode to.
#include "meshreel/places.h"

#include "input.h"

using namespace meshreel;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Mesh mesh = mesh_of(in, 64);
    const mr_mesh view = mesh.view();
    const size_t count = mesh.face_count();
    std::vector<int32_t> joins(4 * count), starts(6 * count), rests(2 * count), places(6 * count), found(6 * count);
    mr_place_symbols symbols{joins.data(), starts.data(), rests.data(), 0, 0, 0};
    if (in.u8() % 2 == 1) {  // symbols of places, and perhaps others
        for (int32_t& place : places) place = in.number();
        if (mr_encode_places(&view, places.data(), &symbols) != MR_OK) return 0;
        LAW(symbols.join_count <= joins.size() && symbols.start_count <= starts.size());
        LAW(symbols.rest_count <= rests.size());
        LAW(mr_decode_places(&view, &symbols, found.data()) == MR_OK && found == places);
    } else {
        symbols = {joins.data(),
                   starts.data(),
                   rests.data(),
                   in.u16() % (joins.size() + 1),
                   in.u16() % (starts.size() + 1),
                   in.u16() % (rests.size() + 1)};
        for (auto* stream : {&joins, &starts, &rests})
            for (int32_t& symbol : *stream) symbol = in.number();
    }
    if (mr_decode_places(&view, &symbols, found.data()) != MR_OK) return 0;
    std::vector<int32_t> more_joins(4 * count), more_starts(6 * count), more_rests(2 * count), again(6 * count);
    mr_place_symbols more{more_joins.data(), more_starts.data(), more_rests.data(), 0, 0, 0};
    LAW(mr_encode_places(&view, found.data(), &more) == MR_OK);
    LAW(mr_decode_places(&view, &more, again.data()) == MR_OK && again == found);
    return 0;
}
