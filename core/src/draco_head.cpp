#include <algorithm>
#include <cstring>

#include "draco_head.h"
#include "guarded.h"
#include "layout.gen.h"
#include "meshreel/draco.h"

// Facts about the bytes: Draco's bitstream specification, version 2.2.

namespace meshreel {
namespace {

// Faces, or points, that Draco meshes decoded together may claim: some, and more for each of their bytes. Each takes
// some 60 bytes of memory. Captured surfaces have at most 6 faces a byte, and those of the standard traversal 8,
// whatever they are.
constexpr uint64_t kFree = 1 << 17, kPerByte = 16;
constexpr uint64_t kMost = static_cast<uint64_t>(limits::kFaces);
// Corners that it may rename to put these together, at some 13 ns each. Captured surfaces have less than one a face,
// grids full of holes two.
constexpr uint64_t kFreeSteps = 1 << 24, kStepsPerFace = 64;

constexpr uint8_t kBegin[] = {'D', 'R', 'A', 'C', 'O'}, kDracoVersion[] = {2, 2};
constexpr uint8_t kMesh = 1, kEdgebreaker = 1;
constexpr uint8_t kPositions = 0, kFloat32 = 9, kQuantised = 2;
constexpr int kMostBits = 30;  // of a coordinate

uint64_t most_of(uint64_t bytes) { return bytes < kMost ? std::min(kFree + kPerByte * bytes, kMost) : kMost; }

int check_kind(DracoReader& in) {
    const uint8_t* begin = in.take(sizeof kBegin);
    if (!begin || std::memcmp(begin, kBegin, sizeof kBegin) != 0) return MR_NOT_DRACO;
    const uint8_t* version = in.take(sizeof kDracoVersion);
    if (in.byte() != kMesh) return MR_DRACO_CLOUD;
    if (!in.good() || std::memcmp(version, kDracoVersion, sizeof kDracoVersion) != 0) return MR_NOT_DRACO;
    if (in.byte() != kEdgebreaker) return MR_DRACO_SEQUENTIAL;
    const uint8_t low = in.byte(), high = in.byte();
    return (low | high) != 0 ? MR_DRACO_METADATA : MR_OK;
}

template <class ReadFaces>
int read_connectivity(DracoReader& in, DracoClaims& claims, uint64_t most, ReadFaces read_faces) {
    const auto traversal = static_cast<DracoTraversal>(in.byte());
    claims.points = in.varint(), claims.faces = in.varint();
    const uint8_t attributes = in.byte();  // with seams of their own
    claims.symbols = in.varint(), claims.splits = in.varint();
    if (!in.good()) return MR_DRACO_FACES;
    if (traversal != DracoTraversal::Standard && traversal != DracoTraversal::ByValence) return MR_DRACO_TRAVERSAL;
    if (attributes != 0) return MR_DRACO_ATTRIBUTES;
    if (claims.faces > most || claims.points > most || claims.splits > most - claims.points) return MR_DRACO_CLAIMS;
    if (claims.symbols > claims.faces) return MR_DRACO_FACES;
    return read_faces(in, traversal, claims) ? MR_OK : MR_DRACO_FACES;
}

int check_attributes(DracoReader& in) {
    constexpr uint8_t decoders = 1, no_seams = 0xff, of_points = 0, depth_first = 0, attributes = 1, plain = 0;
    constexpr uint8_t sole[] = {decoders, no_seams, of_points, depth_first, attributes, kPositions, kFloat32, 3, plain};
    const uint8_t* found = in.take(sizeof sole);
    if (!found || std::memcmp(found, sole, sizeof sole) != 0) return MR_DRACO_ATTRIBUTES;
    in.varint();  // its name
    return in.byte() == kQuantised ? MR_OK : MR_DRACO_ATTRIBUTES;
}

bool is_finite(const uint8_t* number) {  // a 32-bit float
    return (number[3] & 0x7f) != 0x7f || (number[2] & 0x80) == 0;
}

// Claims of meshes that are decoded together.
struct Tally {
    explicit Tally(uint64_t bytes) : most(most_of(bytes)) {}

    bool add(const DracoClaims& claims) {
        faces += claims.faces, points += claims.points + claims.splits, steps += claims.steps;
        return faces <= most && points <= most;
    }
    int finish() const { return steps > kFreeSteps + kStepsPerFace * faces ? MR_DRACO_STEPS : MR_OK; }

    uint64_t most, faces = 0, points = 0, steps = 0;
};

// Offsets of the parts of the positions.
struct Places {
    DracoReader symbols;
    const uint8_t *bounds, *numbers;
    uint8_t bits;
};

int check_positions(DracoReader& in, const DracoClaims& claims, Places& places) {
    constexpr uint8_t parallelogram = 1, wrapped = 1, compressed = 1;
    if (in.byte() != parallelogram || in.byte() != wrapped || in.byte() != compressed) return MR_DRACO_PREDICTION;
    places.symbols = in;
    in.symbols(claims.points, 3, DracoReader::kAnyValue, nullptr);
    places.bounds = in.take(8);            // of the wrapping
    const uint8_t* numbers = in.take(16);  // the lattice's corner and its width
    const uint8_t bits = in.byte();
    if (!in.at_end()) return MR_BAD_DRACO;
    for (int k = 0; k < 4; ++k)
        if (!is_finite(numbers + 4 * k)) return MR_DRACO_LATTICE;
    places.numbers = numbers, places.bits = bits;
    return bits >= 1 && bits <= kMostBits ? MR_OK : MR_DRACO_LATTICE;
}

template <class ReadFaces>
int read_mesh(const mr_bytes& mesh, DracoClaims& claims, uint64_t most, Places& places, ReadFaces read_faces) {
    DracoReader in(mesh.data, mesh.size);
    int status = check_kind(in);
    if (status == MR_OK) status = read_connectivity(in, claims, most, read_faces);
    if (status == MR_OK) status = check_attributes(in);
    if (status == MR_OK) status = check_positions(in, claims, places);
    return status;
}

int check_mesh(const mr_bytes& mesh, DracoClaims& claims, uint64_t most) {
    Places places{};
    return read_mesh(mesh, claims, most, places, [](DracoReader& in, DracoTraversal traversal, DracoClaims& known) {
        return read_draco_faces(in, traversal, known);
    });
}

uint32_t number_of(const uint8_t* bytes) {
    uint32_t value = 0;
    for (int k = 3; k >= 0; --k) value = value << 8 | bytes[k];
    return value;
}

float float_of(const uint8_t* bytes) {
    const uint32_t bits = number_of(bytes);
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

}  // namespace

int read_draco(const mr_bytes& mesh, DracoParts& parts) {
    Places places{};
    const auto read_faces = [&](DracoReader& in, DracoTraversal traversal, DracoClaims& claims) {
        return read_draco_faces(in, traversal, claims, parts.faces);
    };
    const int status = read_mesh(mesh, parts.claims, most_of(mesh.size), places, read_faces);
    if (status != MR_OK) return status;
    DracoPositions& found = parts.positions;
    found.corrections = places.symbols.numbers(parts.claims.points, 3);
    found.least = static_cast<int32_t>(number_of(places.bounds));
    found.most = static_cast<int32_t>(number_of(places.bounds + 4));
    for (int k = 0; k < 3; ++k) found.corner[k] = float_of(places.numbers + 4 * k);
    found.width = float_of(places.numbers + 12), found.bits = places.bits;
    if (!places.symbols.good()) return MR_BAD_DRACO;
    Tally tally(mesh.size);
    return tally.add(parts.claims) ? tally.finish() : MR_DRACO_CLAIMS;
}

}  // namespace meshreel

int mr_check_draco(const mr_bytes* meshes, size_t count) {
    using namespace meshreel;
    uint64_t bytes = 0;
    for (size_t k = 0; k < count; ++k) bytes += meshes[k].size;
    Tally tally(bytes);
    for (size_t k = 0; k < count; ++k) {
        if (meshes[k].size == 0) continue;  // the empty mesh
        DracoClaims claims{};
        const int status =
            guarded(MR_NO_MEMORY, MR_BAD_DRACO, [&] { return check_mesh(meshes[k], claims, tally.most); });
        if (status != MR_OK) return status;
        if (!tally.add(claims)) return MR_DRACO_CLAIMS;
    }
    return tally.finish();
}
