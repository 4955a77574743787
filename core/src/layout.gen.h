// clang-format off
// Made from src/meshreel/format/layout.py, budget.py and checks.py by scripts/generate. Do not edit.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "records.h"

namespace meshreel {

constexpr uint8_t kMagic[8] = {0x52, 0x45, 0x45, 0x4c, 0x0d, 0x0a, 0x1a, 0x0a};
constexpr uint8_t kVersion = 1, kEdited = 1;
constexpr uint64_t kLayerPictures = 64, kMostTracks = 256;
constexpr int kMostChanges = 255, kMostNested = 100;
constexpr int64_t kExact = 9007199254740991;  // beyond it whole numbers are no doubles
constexpr double kLargest = 1e+15, kSmallest = 1e-15;  // of the numbers in a header
constexpr size_t kPreambleSize = 14;  // bytes

// Numbers of the law of costs: src/meshreel/format/budget.py has their meaning.
namespace limits {
constexpr double kFree = 201326592;
constexpr double kPerByte = 8192;
constexpr double kTogether = 100663296;
constexpr double kChain = 8;
constexpr double kHead = 67108864;
constexpr double kFrames = 65535;
constexpr double kFramesPerByte = 64;
constexpr double kFrame = 1024;
constexpr double kElement = 160;
constexpr double kShown = 30;
constexpr double kMoving = 30;
constexpr double kSolved = 1600;
constexpr double kColumn = 20;
constexpr double kPair = 100;
constexpr double kNumber = 40;
constexpr double kColors = 100663296;
constexpr double kPainted = 32;
constexpr double kPainting = 256;
constexpr double kPictures = 805306368;
constexpr double kTexel = 2;
constexpr double kVideos = 184549376;
constexpr double kSplat = 1024;
constexpr double kAudio = 268435456;
constexpr double kFaces = 64000000;
constexpr double kNumbers = 536870912;
constexpr double kHeld = 44;
}  // namespace limits

// Purpose of a chunk.
enum class ChunkKind : uint8_t { STATIC = 1, GROUP = 2, COLORS = 3, ATLAS = 4, PICTURES = 5, COMPATIBLE = 6, SPLATS =
    7, AUDIO = 8 };

// Coding of a chunk, stored in its first byte.
enum class Form : uint8_t { LAPLACIAN = 1, LAYERS = 2, DRACO = 3, EMPTY = 4, PATCH = 5, VERTEX_COLORS = 6, PLACES = 7,
    VIDEO = 8, GAUSSIANS = 9, AUDIO_FILE = 10 };

// Rule by which encoder and decoder choose the anchors of the Laplacian coordinates.
enum class AnchorRule : uint8_t { SPREAD = 1, FARTHEST = 2 };

// Prediction of a coded field.
enum class Origin : uint8_t { ALONE = 0, PREVIOUS = 1 };

// Motion shared by all vertices of a mesh.
enum class SharedMotion : uint8_t { NONE = 0, SHIFTS = 1, POSES = 2 };

// Coding of pictures.
enum class VideoCodec : uint8_t { AV1 = 1, H264 = 2 };

// Container and coding of an audio file.
enum class AudioType : uint8_t { OGG = 1, WEBM = 2, MP4 = 3, ADTS = 4, MPEG = 5 };

// The first bytes of a file: its signature, and the size of the head.
struct Preamble {
    // `52 45 45 4c 0d 0a 1a 0a`
    mr_bytes magic;
    // version of the format, 1; a reader refuses any other
    uint8_t version;
    // 1: the metadata has an `edit`, which counts; other bits are 0
    uint8_t flags;
    // size of the head, bytes: offset of the first chunk
    uint32_t head_size;

    static Preamble read(Records& in) {
        Preamble record;
        in.begin("Preamble.magic");
        record.magic = in.blob(8);
        in.begin("Preamble.version");
        record.version = in.u8();
        in.begin("Preamble.flags");
        record.flags = in.u8();
        in.begin("Preamble.head_size");
        record.head_size = in.u32();
        return record;
    }
};

// Values for all frames. Coordinates y in chunks are normalised: x = origin + scale * y is in metres.
struct Header {
    // 1/s, above 0
    double frame_rate;
    // m
    std::array<double, 3> origin;
    // m, above 0
    double scale;
    // lower corner of the sequence's bounding box, normalised
    std::array<double, 3> minimum;
    // upper corner of this box
    std::array<double, 3> maximum;
    // a JSON object, not needed for decoding: `up` (axis; y if absent), preset ...
    std::string metadata;
    // time of frame 0, microseconds
    int64_t first_time;
    // microseconds from each frame to the next, each above 0; if empty, frame i is at first_time + 10^6 * i /
    // frame_rate
    std::vector<uint64_t> intervals;

    static Header read(Records& in) {
        Header record;
        in.begin("Header.frame_rate");
        record.frame_rate = in.f64();
        in.begin("Header.origin");
        for (double& item : record.origin) item = in.f64();
        in.begin("Header.scale");
        record.scale = in.f64();
        in.begin("Header.minimum");
        for (double& item : record.minimum) item = in.f32();
        in.begin("Header.maximum");
        for (double& item : record.maximum) item = in.f32();
        in.begin("Header.metadata");
        record.metadata = in.text(in.u16());
        in.begin("Header.first_time");
        record.first_time = in.i64();
        in.begin("Header.intervals");
        record.intervals.resize(in.count(in.varint(), 1));
        for (uint64_t& item : record.intervals) item = in.varint();
        return record;
    }
};

// Byte range of a chunk, whose first k layers are its first bytes; the form decides which k can be decoded.
struct Layer {
    // bytes, above 0
    uint64_t size;
    // CRC-32 (ISO-HDLC, as in zlib) of these bytes
    uint32_t crc;

    static Layer read(Records& in) {
        Layer record;
        in.begin("Layer.size");
        record.size = in.varint();
        in.begin("Layer.crc");
        record.crc = in.u32();
        return record;
    }
};

// Index entry of a chunk.
struct IndexEntry {
    // purpose
    ChunkKind kind;
    // coding; equal to the first byte of the chunk
    Form form;
    // number of frames; 0 if and only if STATIC, a companion of one, or AUDIO
    uint16_t frames;
    // number of the moving body, from 0; 0 if STATIC or AUDIO
    uint64_t track;
    // numbers of the earlier chunks that it needs: for a GROUP, the STATIC chunk it is shown with and the GROUP right
    // before it in its track; for a STATIC of form PATCH, the STATIC chunk that it changes; for COLORS, the chunk
    // whose vertices have them and, where they are predicted, the COLORS of the group before; for ATLAS, the GROUP
    // whose base mesh, or the STATIC whose faces, it places; for SPLATS, the GROUP whose base mesh they are on; for
    // PICTURES and COMPATIBLE, the GROUP, the ATLAS, and but for the first of this, that of the group before
    std::vector<uint64_t> depends_on;
    // at least one
    std::vector<Layer> layers;

    static IndexEntry read(Records& in) {
        IndexEntry record;
        in.begin("IndexEntry.kind");
        record.kind = static_cast<ChunkKind>(in.u8());
        in.begin("IndexEntry.form");
        record.form = static_cast<Form>(in.u8());
        in.begin("IndexEntry.frames");
        record.frames = in.u16();
        in.begin("IndexEntry.track");
        record.track = in.varint();
        in.begin("IndexEntry.depends_on");
        record.depends_on.resize(in.count(in.u8(), 1));
        for (uint64_t& item : record.depends_on) item = in.varint();
        in.begin("IndexEntry.layers");
        record.layers.resize(in.count(in.u16(), 5));
        for (Layer& item : record.layers) item = Layer::read(in);
        return record;
    }
};

// All chunks in the order of their bytes; in each track the frames of GROUP chunks follow one another from 0.
struct Index {
    // chunk 0, 1 ...
    std::vector<IndexEntry> chunks;

    static Index read(Records& in) {
        Index record;
        in.begin("Index.chunks");
        record.chunks.resize(in.count(in.u32(), 8));
        for (IndexEntry& item : record.chunks) item = IndexEntry::read(in);
        return record;
    }
};

// Last record of the head: its checksum.
struct Checksum {
    // CRC-32 of the head up to here
    uint32_t crc;

    static Checksum read(Records& in) {
        Checksum record;
        in.begin("Checksum.crc");
        record.crc = in.u32();
        return record;
    }
};

// The payload of a group of form LAPLACIAN.
struct LaplacianGroup {
    // LAPLACIAN
    Form form;
    // midpoint subdivisions of the decoded reference mesh
    uint8_t levels;
    // spacing of the reference's lattice, above 0: decoded vertices are rounded to multiples
    double step;
    // the reference mesh, Draco
    mr_bytes reference;
    // a DisplacementHead and its streams
    mr_bytes displacements;

    static LaplacianGroup read(Records& in) {
        LaplacianGroup record;
        in.begin("LaplacianGroup.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("LaplacianGroup.levels");
        record.levels = in.u8();
        in.begin("LaplacianGroup.step");
        record.step = in.f64();
        in.begin("LaplacianGroup.reference");
        record.reference = in.blob(in.u32());
        in.begin("LaplacianGroup.displacements");
        record.displacements = in.rest();
        return record;
    }
};

// Direction of the basis, and sizes of the streams of its weights.
struct Component {
    // b, at most 30: the direction's numbers are integers times 2^-b
    uint8_t basis_bits;
    // k: the quantiser's step is 2^(-k/8)
    uint8_t step_level;
    // bytes of its anchors' stream
    uint64_t anchors_size;
    // bytes of its deltas' stream
    uint64_t deltas_size;

    static Component read(Records& in) {
        Component record;
        in.begin("Component.basis_bits");
        record.basis_bits = in.u8();
        in.begin("Component.step_level");
        record.step_level = in.u8();
        in.begin("Component.anchors_size");
        record.anchors_size = in.varint();
        in.begin("Component.deltas_size");
        record.deltas_size = in.varint();
        return record;
    }
};

// Head of coded displacements; for each component in turn, the streams of its anchors and its deltas follow.
struct DisplacementHead {
    // T, above 0
    uint16_t frames;
    // how anchors are chosen
    AnchorRule anchor_rule;
    // number of requested anchors; each connected component has at least one
    uint64_t anchor_count;
    // factor of the anchors' rows, above 0
    uint8_t anchor_weight;
    // b, at most 30: the mean's numbers are integers times 2^-b
    uint8_t mean_bits;
    // strongest first, at most 3 T
    std::vector<Component> components;
    // integers: 3 T of the mean, then 3 T of each component's direction
    mr_bytes basis;

    static DisplacementHead read(Records& in) {
        DisplacementHead record;
        in.begin("DisplacementHead.frames");
        record.frames = in.u16();
        in.begin("DisplacementHead.anchor_rule");
        record.anchor_rule = in.choice(AnchorRule::SPREAD, AnchorRule::FARTHEST);
        in.begin("DisplacementHead.anchor_count");
        record.anchor_count = in.varint();
        in.begin("DisplacementHead.anchor_weight");
        record.anchor_weight = in.u8();
        in.begin("DisplacementHead.mean_bits");
        record.mean_bits = in.u8();
        in.begin("DisplacementHead.components");
        record.components.resize(in.count(in.u16(), 4));
        for (Component& item : record.components) item = Component::read(in);
        in.begin("DisplacementHead.basis");
        record.basis = in.blob(in.varint());
        return record;
    }
};

// Trajectories in a basis: quantised weights at the vertices of a causal graph.
struct CodedField {
    // M, number of basis vectors
    uint64_t columns;
    // k: the quantiser's step is 2^(-k/8)
    uint8_t step_level;
    // integers: what moves all vertices alike, if anything, then the basis
    mr_bytes basis;
    // one stream: the symbols of all columns
    mr_bytes symbols;

    static CodedField read(Records& in) {
        CodedField record;
        in.begin("CodedField.columns");
        record.columns = in.varint();
        in.begin("CodedField.step_level");
        record.step_level = in.u8();
        in.begin("CodedField.basis");
        record.basis = in.blob(in.varint());
        in.begin("CodedField.symbols");
        record.symbols = in.blob(in.varint());
        return record;
    }
};

// First layer of a group of form LAYERS; a LayersLevel for each level follows.
struct LayersGroup {
    // LAYERS
    Form form;
    // source of the base mesh
    Origin origin;
    // T, above 0
    uint8_t frames;
    // L, midpoint subdivisions of the base mesh
    uint8_t levels;
    // spacing of the base's lattice, above 0: decoded vertices are rounded to multiples
    double step;
    // the base mesh, Draco; no bytes where its origin is PREVIOUS
    mr_bytes base;
    // what moves all vertices alike
    SharedMotion shared;
    // the displacements of the base's vertices
    CodedField motion;

    static LayersGroup read(Records& in) {
        LayersGroup record;
        in.begin("LayersGroup.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("LayersGroup.origin");
        record.origin = in.choice(Origin::ALONE, Origin::PREVIOUS);
        in.begin("LayersGroup.frames");
        record.frames = in.u8();
        in.begin("LayersGroup.levels");
        record.levels = in.u8();
        in.begin("LayersGroup.step");
        record.step = in.f64();
        in.begin("LayersGroup.base");
        record.base = in.blob(in.varint());
        in.begin("LayersGroup.shared");
        record.shared = in.choice(SharedMotion::NONE, SharedMotion::POSES);
        in.begin("LayersGroup.motion");
        record.motion = CodedField::read(in);
        return record;
    }
};

// Layer of a group of form LAYERS that refines it by one level of subdivision.
struct LayersLevel {
    // prediction of the scalars
    Origin origin;
    // share of an edge's sagitta by which its midpoint is lifted, 64ths
    uint8_t curvature;
    // weight of the siblings' mean in a prediction, 64ths
    uint8_t sibling_weight;
    // the offsets of its new vertices
    CodedField scalars;

    static LayersLevel read(Records& in) {
        LayersLevel record;
        in.begin("LayersLevel.origin");
        record.origin = in.choice(Origin::ALONE, Origin::PREVIOUS);
        in.begin("LayersLevel.curvature");
        record.curvature = in.u8();
        in.begin("LayersLevel.sibling_weight");
        record.sibling_weight = in.u8();
        in.begin("LayersLevel.scalars");
        record.scalars = CodedField::read(in);
        return record;
    }
};

// Optional last layer of a group of form LAYERS: corrections where frames do not follow the base mesh.
struct LayersPatches {
    // number of integers in `dropped`
    uint64_t runs;
    // integers: lengths of runs; they mark the faces that each frame lacks
    mr_bytes dropped;
    // k: the spacing of the mesh's lattice is 2^(-k/8)
    uint8_t step_level;
    // cells along x that each frame has in the lattice
    uint64_t width;
    // additional faces of all frames, Draco; no bytes: nothing
    mr_bytes mesh;

    static LayersPatches read(Records& in) {
        LayersPatches record;
        in.begin("LayersPatches.runs");
        record.runs = in.varint();
        in.begin("LayersPatches.dropped");
        record.dropped = in.blob(in.varint());
        in.begin("LayersPatches.step_level");
        record.step_level = in.u8();
        in.begin("LayersPatches.width");
        record.width = in.varint();
        in.begin("LayersPatches.mesh");
        record.mesh = in.blob(in.varint());
        return record;
    }
};

// The payload of a group of form DRACO.
struct DracoGroup {
    // DRACO
    Form form;
    // midpoint subdivisions of every decoded mesh
    uint8_t levels;
    // spacing of the frames' lattice, above 0: decoded vertices are rounded to multiples
    double step;
    // one Draco mesh per frame; no bytes: an empty frame
    std::vector<mr_bytes> meshes;

    static DracoGroup read(Records& in) {
        DracoGroup record;
        in.begin("DracoGroup.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("DracoGroup.levels");
        record.levels = in.u8();
        in.begin("DracoGroup.step");
        record.step = in.f64();
        in.begin("DracoGroup.meshes");
        record.meshes.resize(in.count(in.u16(), 4));
        for (mr_bytes& item : record.meshes) item = in.blob(in.u32());
        return record;
    }
};

// The payload of a group of form EMPTY.
struct EmptyGroup {
    // EMPTY
    Form form;

    static EmptyGroup read(Records& in) {
        EmptyGroup record;
        in.begin("EmptyGroup.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        return record;
    }
};

// The payload of a STATIC chunk of form PATCH: changes of the background that it depends on.
struct StaticPatch {
    // PATCH
    Form form;
    // spacing of the mesh's lattice, above 0: decoded vertices are rounded to multiples
    double step;
    // number of integers in `dropped`
    uint64_t runs;
    // integers: lengths of runs of faces, kept and dropped in turn
    mr_bytes dropped;
    // additional faces, Draco; no bytes: nothing
    mr_bytes mesh;

    static StaticPatch read(Records& in) {
        StaticPatch record;
        in.begin("StaticPatch.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("StaticPatch.step");
        record.step = in.f64();
        in.begin("StaticPatch.runs");
        record.runs = in.varint();
        in.begin("StaticPatch.dropped");
        record.dropped = in.blob(in.varint());
        in.begin("StaticPatch.mesh");
        record.mesh = in.blob(in.varint());
        return record;
    }
};

// First bytes of a chunk of form VERTEX_COLORS; for each mesh, a CodedField and a ColorsLevel a level follow.
struct VertexColors {
    // VERTEX_COLORS
    Form form;
    // prediction of the values
    Origin origin;
    // what colour differences were multiplied by, 64ths, above 0
    uint8_t chroma;

    static VertexColors read(Records& in) {
        VertexColors record;
        in.begin("VertexColors.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("VertexColors.origin");
        record.origin = in.choice(Origin::ALONE, Origin::PREVIOUS);
        in.begin("VertexColors.chroma");
        record.chroma = in.u8();
        return record;
    }
};

// Colours of the vertices that a level of subdivision adds.
struct ColorsLevel {
    // weight of the siblings' mean in a prediction, 64ths
    uint8_t sibling_weight;
    // differences from the means of the ends of their edges
    CodedField values;

    static ColorsLevel read(Records& in) {
        ColorsLevel record;
        in.begin("ColorsLevel.sibling_weight");
        record.sibling_weight = in.u8();
        in.begin("ColorsLevel.values");
        record.values = CodedField::read(in);
        return record;
    }
};

// The payload of a chunk of form PLACES: of each corner of the base mesh's faces, its place in the texture.
struct Atlas {
    // PLACES
    Form form;
    // of the texture, texels, even, above 0
    uint16_t width;
    // of the texture, texels, even, above 0
    uint16_t height;
    // number of integers in `joins`
    uint64_t join_count;
    // number of integers in `starts`
    uint64_t start_count;
    // number of integers in `rests`
    uint64_t rest_count;
    // integers: whether faces share the places of an edge, or of a corner
    mr_bytes joins;
    // integers: places of the faces that share none with one before
    mr_bytes starts;
    // integers: differences of places from where shapes predict them
    mr_bytes rests;

    static Atlas read(Records& in) {
        Atlas record;
        in.begin("Atlas.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("Atlas.width");
        record.width = in.u16();
        in.begin("Atlas.height");
        record.height = in.u16();
        in.begin("Atlas.join_count");
        record.join_count = in.varint();
        in.begin("Atlas.start_count");
        record.start_count = in.varint();
        in.begin("Atlas.rest_count");
        record.rest_count = in.varint();
        in.begin("Atlas.joins");
        record.joins = in.blob(in.varint());
        in.begin("Atlas.starts");
        record.starts = in.blob(in.varint());
        in.begin("Atlas.rests");
        record.rests = in.blob(in.varint());
        return record;
    }
};

// The payload of a chunk of form VIDEO: the textures of a group's frames; of a background, each of its layers.
struct Pictures {
    // VIDEO
    Form form;
    // coding of the pictures
    VideoCodec codec;
    // frames from one picture to the next, above 0; 1 of a GROUP
    uint64_t interval;
    // one a picture, in their order
    std::vector<mr_bytes> packets;

    static Pictures read(Records& in) {
        Pictures record;
        in.begin("Pictures.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("Pictures.codec");
        record.codec = in.choice(VideoCodec::AV1, VideoCodec::H264);
        in.begin("Pictures.interval");
        record.interval = in.varint();
        in.begin("Pictures.packets");
        record.packets.resize(in.count(in.u16(), 1));
        for (mr_bytes& item : record.packets) item = in.blob(in.varint());
        return record;
    }
};

// First bytes of a chunk of form GAUSSIANS; a GaussiansLayer follows for each of its layers.
struct Gaussians {
    // GAUSSIANS
    Form form;
    // b, 1 to 14: weights of a face's corners are integers times 2^-b
    uint8_t place_bits;
    // b, 1 to 14: angles are integers times pi 2^-b
    uint8_t turn_bits;
    // b, 1 to 14: opacities are integers times 2^-b
    uint8_t opacity_bits;
    // b, 1 to 14: lumas and colour differences are integers times 2^-b
    uint8_t color_bits;
    // k: offsets along the normal are integers times 2^(-k/8)
    uint8_t offset_level;
    // k, which levels of scales are counted from
    uint8_t scale_level;
    // N, splats of all layers
    uint64_t count;

    static Gaussians read(Records& in) {
        Gaussians record;
        in.begin("Gaussians.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("Gaussians.place_bits");
        record.place_bits = in.u8();
        in.begin("Gaussians.turn_bits");
        record.turn_bits = in.u8();
        in.begin("Gaussians.opacity_bits");
        record.opacity_bits = in.u8();
        in.begin("Gaussians.color_bits");
        record.color_bits = in.u8();
        in.begin("Gaussians.offset_level");
        record.offset_level = in.u8();
        in.begin("Gaussians.scale_level");
        record.scale_level = in.u8();
        in.begin("Gaussians.count");
        record.count = in.varint();
        return record;
    }
};

// Splats of a layer, in the order of their faces.
struct GaussiansLayer {
    // n, above 0
    uint64_t count;
    // n integers: how many faces of the base mesh lie between it and the last
    mr_bytes faces;
    // 2 n integers: weights of the second corners, then of the third ones
    mr_bytes places;
    // n integers: offsets along the normal
    mr_bytes offsets;
    // n integers: angles of the longer axes
    mr_bytes turns;
    // 2 n integers: levels of longer scales, then how many the shorter add
    mr_bytes scales;
    // n integers: opacities
    mr_bytes opacities;
    // 3 n integers: lumas, then both differences, each less the splat before
    mr_bytes colors;

    static GaussiansLayer read(Records& in) {
        GaussiansLayer record;
        in.begin("GaussiansLayer.count");
        record.count = in.varint();
        in.begin("GaussiansLayer.faces");
        record.faces = in.blob(in.varint());
        in.begin("GaussiansLayer.places");
        record.places = in.blob(in.varint());
        in.begin("GaussiansLayer.offsets");
        record.offsets = in.blob(in.varint());
        in.begin("GaussiansLayer.turns");
        record.turns = in.blob(in.varint());
        in.begin("GaussiansLayer.scales");
        record.scales = in.blob(in.varint());
        in.begin("GaussiansLayer.opacities");
        record.opacities = in.blob(in.varint());
        in.begin("GaussiansLayer.colors");
        record.colors = in.blob(in.varint());
        return record;
    }
};

// The payload of a chunk of form AUDIO_FILE; its layers are pieces of it.
struct AudioFile {
    // AUDIO_FILE
    Form form;
    // what the file is
    AudioType type;
    // when it begins, microseconds of the clock that first_time is of
    int64_t start;
    // the file, at least one byte
    mr_bytes data;

    static AudioFile read(Records& in) {
        AudioFile record;
        in.begin("AudioFile.form");
        record.form = in.choice(Form::LAPLACIAN, Form::AUDIO_FILE);
        in.begin("AudioFile.type");
        record.type = in.choice(AudioType::OGG, AudioType::MPEG);
        in.begin("AudioFile.start");
        record.start = in.i64();
        in.begin("AudioFile.data");
        record.data = in.rest();
        return record;
    }
};

}  // namespace meshreel
