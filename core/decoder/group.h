// A group of frames of any form, decoded from its payload. Beside src/meshreel/coding/{group,mesh,colored}.py.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "../src/layout.gen.h"
#include "../src/scratch.h"
#include "mesh.h"
#include "meshreel/status.h"

namespace meshreel {

constexpr int64_t kAllLayers = -1;  // as a number of layers

// Numbers in one block of memory, which are not set to anything at first, and which a host may take over.
template <class T>
class Block {
public:
    Block() = default;
    explicit Block(size_t count) : numbers_(scratch<T>(count)), count_(count) {}

    size_t size() const { return count_; }
    bool empty() const { return count_ == 0; }
    T* data() { return numbers_.get(); }
    const T* data() const { return numbers_.get(); }
    T* begin() { return data(); }
    T* end() { return data() + count_; }
    // The block, to be given back by give_block.
    T* release() { return count_ = 0, numbers_.release(); }

private:
    Scratch<T> numbers_;
    size_t count_ = 0;
};

// What the next group of a track may be predicted from.
struct State {
    Faces faces;                               // of the base mesh
    std::vector<double> base;                  // its vertices in the last frame
    std::vector<std::vector<double>> scalars;  // of the last frame, for each level that was decoded
    std::vector<std::shared_ptr<const Connectivity>> finer;
    std::vector<double> colors;  // of the last frame, three for each vertex that was decoded; or empty

    double memory_beyond(const State* before) const;  // bytes that it does not share with the one it is predicted from
};

// A mesh whose vertices, after `levels` subdivisions, have colours in `frames` frames.
struct ColoredMesh {
    Mesh base;
    unsigned levels;
    size_t frames, vertices;
};

// Frames: vertices and faces that all of them share, and a mesh that is added to each.
struct Group {
    size_t frames = 0, vertices = 0;
    unsigned levels = 0;      // subdivisions that the shared mesh has of its base
    Block<double> positions;  // frames x vertices x 3, m
    Faces faces = no_faces();
    std::vector<uint8_t> dropped;  // frames x faces, 1 where a frame lacks one; or empty
    std::vector<Mesh> added;       // one a frame, or empty
    std::vector<uint8_t> colors;   // frames x vertices x 3, or empty
    std::vector<float> places;     // two of each corner of the shared faces, in a texture; or empty

    Mesh frame(size_t t) const;
    // Which of the shared faces a frame lacks; null where it has all.
    const uint8_t* dropped_in(size_t t) const { return dropped.empty() ? nullptr : &dropped[t * (faces->size() / 3)]; }
    double memory() const;  // bytes
};

struct Continued {
    Group group;
    std::shared_ptr<State> state;     // null where no group can be predicted from this one
    std::vector<ColoredMesh> canvas;  // meshes that colours are coded over
};

struct Context {
    size_t frames;          // as the index has it
    int64_t layers;         // at most, beyond the first; kAllLayers
    const State* previous;  // that the group before left, or null
    mr_placement place;
    bool is_shown = true;  // else only the state is decoded, and the first mesh of the canvas
};

// Throws FormatError where a group has other frames than the index says.
void check_frames(size_t frames, const Context& context);

// From a whole payload, or from as many layers. Throws FormatError.
Continued continue_group(const mr_bytes& data, const Context& context);

// A state of the background, and what of it has colours of its own: all, or what a change adds behind what it keeps.
struct Background {
    Mesh mesh;
    ColoredMesh added;
};

// `before` is the state that a change is made to, placed, or null. Throws FormatError.
Background decode_background(const mr_bytes& data, const Mesh* before, const mr_placement& place);

// By form; each throws FormatError.
Continued decode_layers(const mr_bytes& data, const Context& context);
Continued decode_laplacian(const mr_bytes& data, const Context& context);

// Faces that frames lack and meshes that they have beside, of so many faces of the finest level; not yet placed.
void decode_patches(const mr_bytes& data, Group& group);

// The colours of a group that was decoded from as many layers; its state then has what the next colours need. The
// group is unchanged where this throws FormatError.
void paint_group(const mr_bytes& data, const Context& context, Continued& made);
// The same of a background; the colours of a change are those of its end.
void paint_background(const mr_bytes& data, Background& made);

// The mesh that an atlas or splats are of: from the first layer of a group that needs no other, or from a background.
Mesh base_mesh(const mr_bytes& data);
Mesh layers_base(const mr_bytes& data);
Mesh laplacian_base(const mr_bytes& data);

// Where the corners of a base mesh's faces are in a texture.
struct Layout {
    uint16_t width, height;                              // texels
    std::shared_ptr<const std::vector<int32_t>> places;  // two of each corner, from the upper left
};

Layout decode_atlas(const mr_bytes& data, const Mesh& base);
// Places of the corners of the faces after subdivisions, in texels; NaN for faces that have none. Halves are exact.
std::vector<float> texels_of(const Layout& atlas, unsigned levels);
// The same from 0 to 1 from the lower left.
std::vector<float> places_of(const Layout& atlas, unsigned levels);

}  // namespace meshreel
