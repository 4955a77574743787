// The frames of a file, decoded as they are asked for. Beside src/meshreel/decoder.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "../../src/format_error.h"
#include "../group.h"
#include "../splats.h"
#include "source.h"

namespace meshreel {

// Chunks whose bytes are damaged though their checksums match, so that no frame more decodes them again.
class Refusals {
public:
    // What `decode` gives. A FormatError is remembered, and thrown with the name of the chunk.
    template <class Decode>
    auto of(const Head& head, uint32_t chunk, Decode decode) {
        try {
            return decode();
        } catch (const FormatError& error) {
            throw FormatError(messages_[chunk] = describe(head, chunk) + ": " + error.what());
        }
    }
    // Throws the FormatError of a chunk again, and remembers it for those that need it.
    void check(uint32_t chunk, const std::vector<uint32_t>& dependents = {});

private:
    std::map<uint32_t, std::string> messages_;
};

struct Picture {
    std::vector<uint8_t> packet;  // empty where there is none
    uint64_t stream, number;
    uint16_t width, height;
};

struct Sound {
    std::vector<uint8_t> data;  // empty where there is none
    double start;               // s after frame 0
    AudioType type;
};

// Used by one thread at a time. Frames are numbered as they are coded.
class Video {
public:
    explicit Video(const Source& source) : source_(source), head(read_head(source)), tracks_(head.tracks.size()) {}

    void set_layers(int64_t layers);
    Mesh track(uint64_t frame, size_t track);
    Mesh background(uint64_t frame);
    Mesh whole(uint64_t frame);
    Bound splats(uint64_t frame, size_t track);
    // The coded picture of a group or a background in a frame, in the coding of a kind of chunks.
    Picture picture(uint64_t frame, uint32_t chunk, ChunkKind kind);
    Sound audio() const;

    // What was left out of the last mesh, in words.
    std::string lacking;

private:
    struct Cached {
        uint32_t chunk = kNoChunk;
        Group group;
        std::string lacking;
        std::map<uint32_t, std::shared_ptr<State>> states;  // by chunk; null where nothing can be predicted from it
        double kept = 0, taken = 0;                         // bytes of states and of the group
        double size = 0;                                    // bytes of the chunk that was decoded last
        uint64_t turn = 0;                                  // when that was; 0: nothing is kept
    };

    const Group& group_of(uint64_t frame, size_t track);
    double memory_of(uint64_t frame, size_t track);
    void make_room();
    void decode(uint32_t chunk, Cached& cached);
    std::shared_ptr<State> state_before(uint32_t chunk, Cached& cached);
    void keep(uint32_t chunk, const std::shared_ptr<State>& state, Cached& cached);
    Context context_of(uint32_t chunk, const State* previous) const;
    template <class Paint>
    std::string paint_with(uint32_t chunk, int64_t layers, Paint paint);
    std::string paint(uint32_t chunk, const Context& context, int64_t layers, Continued& made);
    void turn(double* vertices, size_t numbers) const;
    std::string put_on_texture(uint32_t chunk, unsigned levels, const Faces& faces, std::vector<float>& places);
    const Mesh& state_of(uint32_t chunk);
    Mesh decode_state(uint32_t chunk);
    const Layout& atlas(uint32_t chunk);
    uint32_t pictures_of(uint32_t chunk) const;
    uint32_t splats_of(uint32_t chunk) const;
    std::vector<uint8_t> read(uint32_t chunk, int64_t layers) const;

    Source source_;

public:
    const Head head;

private:
    int64_t layers_ = kAllLayers;
    std::vector<Cached> tracks_;
    uint64_t turns_ = 0;
    std::map<uint32_t, double> memory_;  // of all groups that were decoded, by their chunks
    Refusals refused_,
        lost_;  // of frames, and of states, which may be whole where frames of the same group are damaged
    struct {
        uint32_t chunk = kNoChunk;
        Mesh mesh;
        double cost = 0, size = 0;  // of what led to it
        std::string lacking;
    } background_;
    uint32_t atlas_chunk_ = kNoChunk;
    Layout atlas_{};
    struct {
        uint32_t chunk = kNoChunk;
        size_t faces = 0;  // of the base mesh
        Splats found;
    } splats_;  // those that were decoded last
};

}  // namespace meshreel
