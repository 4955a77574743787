#include "video.h"

#include <algorithm>

#include "../budget.h"

namespace meshreel {
namespace {

// Bytes of states that all tracks keep together, as in src/meshreel/decoder/cache.py.
constexpr double kMostKept = 1 << 25;
constexpr double kMostTogether = 8 * limits::kNumbers;

// Memory that groups may take together whose chunks have so many bytes.
double most_together(double size) { return std::min(limits::kTogether + limits::kPerByte * size, kMostTogether); }

}  // namespace

void Refusals::check(uint32_t chunk, const std::vector<uint32_t>& dependents) {
    const auto found = messages_.find(chunk);
    if (found == messages_.end()) return;
    const std::string message = found->second;
    for (const uint32_t dependent : dependents) messages_[dependent] = message;
    throw FormatError(message);
}

void Video::set_layers(int64_t layers) {
    if (layers == layers_) return;
    layers_ = layers;
    tracks_ = std::vector<Cached>(head.tracks.size());
    memory_.clear();
    splats_ = {};
    refused_ = lost_ = Refusals();  // other layers of a chunk may be whole
}

std::vector<uint8_t> Video::read(uint32_t chunk, int64_t layers) const {
    try {
        return source_.chunk(head, chunk, layers == kAllLayers ? kAllLayers : layers + 1);
    } catch (const FormatError& error) {
        throw FormatError(describe(head, chunk) + ": " + error.what());
    } catch (const SourceError& error) {
        throw SourceError(describe(head, chunk) + ": " + error.what());
    }
}

Mesh Video::track(uint64_t frame, size_t number) {
    const Group& group = group_of(frame, number);
    lacking = tracks_[number].lacking;
    return group.frame(static_cast<size_t>(frame - head.chunks[tracks_[number].chunk].first_frame));
}

Mesh Video::whole(uint64_t frame) {
    double taken = 0, size = 0;
    for (size_t number = 0; number < tracks_.size(); ++number) {
        taken += memory_of(frame, number), size += count_of(head.chunks[head.chunk_of_frame(frame, number)].size());
        require(number == 0 || taken <= most_together(size),
                "tracks whose groups take more memory together than their bytes may");
    }
    Mesh mesh = background(frame);
    std::string left_out = lacking;
    mesh.places.clear();
    for (size_t number = 0; number < tracks_.size(); ++number) {
        const Group& group = group_of(frame, number);
        const Cached& cached = tracks_[number];
        append(mesh, group.frame(static_cast<size_t>(frame - head.chunks[cached.chunk].first_frame)));
        if (left_out.empty()) left_out = cached.lacking;
    }
    lacking = left_out;
    mesh.places.clear();
    return mesh;
}

const Group& Video::group_of(uint64_t frame, size_t track) {
    const uint32_t chunk = head.chunk_of_frame(frame, track);
    Cached& cached = tracks_[track];
    if (cached.chunk != chunk) decode(chunk, cached);
    return cached.group;
}

double Video::memory_of(uint64_t frame, size_t track) {
    const auto known = memory_.find(head.chunk_of_frame(frame, track));
    return known == memory_.end() ? group_of(frame, track).memory() : known->second;
}

// What all tracks keep takes no more than the groups of one frame may: the oldest goes, but never the newest.
void Video::make_room() {
    for (;;) {
        Cached* oldest = nullptr;
        double taken = 0, size = 0;
        for (Cached& cached : tracks_) {
            if (cached.turn == 0) continue;
            taken += cached.taken + cached.kept, size += cached.size;
            if (!oldest || cached.turn < oldest->turn) oldest = &cached;
        }
        if (!oldest || oldest->turn == turns_ || taken <= most_together(size)) return;
        *oldest = Cached();
    }
}

Context Video::context_of(uint32_t chunk, const State* previous) const {
    const std::array<double, 3>& origin = head.header.origin;
    return {head.chunks[chunk].frames, layers_, previous, {head.header.scale, {origin[0], origin[1], origin[2]}}};
}

void Video::decode(uint32_t chunk, Cached& cached) {
    cached.turn = ++turns_, cached.size = count_of(head.chunks[chunk].size());
    const std::shared_ptr<State> before = state_before(chunk, cached);
    const std::vector<uint8_t> payload = read(chunk, layers_);
    cached.chunk = kNoChunk, cached.group = Group(), cached.taken = 0;
    const Context context = context_of(chunk, before.get());
    Continued made = refused_.of(head, chunk, [&] { return continue_group(view(payload), context); });
    const int64_t layers = head.chunks[chunk].form == Form::LAYERS ? layers_ : kAllLayers;
    cached.lacking = paint(chunk, context, layers, made);
    const unsigned levels = made.canvas.empty() ? 0 : made.canvas[0].levels;
    const std::string more = put_on_texture(chunk, levels, made.group.faces, made.group.places);
    if (cached.lacking.empty()) cached.lacking = more;
    cached.taken = memory_[chunk] = made.group.memory();
    keep(chunk, made.state, cached);
    turn(made.group.positions.data(), made.group.positions.size());
    for (Mesh& mesh : made.group.added) turn(mesh.vertices.data(), mesh.vertices.size());
    cached.group = std::move(made.group);
    cached.chunk = chunk;
}

void Video::turn(double* vertices, size_t numbers) const {
    if (head.edit.is_turned) turn_all(head.edit.rotation, head.header.origin.data(), vertices, numbers);
}

std::shared_ptr<State> Video::state_before(uint32_t chunk, Cached& cached) {
    std::vector<uint32_t> chain(1, chunk);
    refused_.check(chunk);
    uint32_t before = head.group_before(chunk);
    for (; before != kNoChunk && cached.states.count(before) == 0; before = head.group_before(before)) {
        lost_.check(before, chain);
        chain.push_back(before);
    }
    std::shared_ptr<State> state = before == kNoChunk ? nullptr : cached.states[before];
    if (before == kNoChunk) cached.states.clear(), cached.kept = 0;
    for (size_t link = chain.size() - 1; link > 0; --link) {
        const uint32_t number = chain[link];
        std::shared_ptr<State> after;
        if (head.chunks[number].form == Form::LAYERS) {
            const std::vector<uint8_t> payload = read(number, layers_);
            Context context = context_of(number, state.get());
            context.is_shown = false;
            Continued made = lost_.of(head, number, [&] { return continue_group(view(payload), context); });
            paint(number, context, static_cast<int64_t>(made.state->scalars.size()), made);
            after = made.state;
        }
        keep(number, after, cached);
        state = after;
    }
    return state;
}

void Video::keep(uint32_t chunk, const std::shared_ptr<State>& state, Cached& cached) {
    if (cached.states.count(chunk) == 0) {
        const State* before = cached.states.empty() ? nullptr : cached.states.rbegin()->second.get();
        double size = state ? state->memory_beyond(before) : 0;
        if (cached.kept + size > kMostKept / count_of(tracks_.size())) {
            cached.states.clear(), cached.kept = 0;
            size = state ? state->memory_beyond(nullptr) : 0;
        }
        cached.states[chunk] = state;
        cached.kept += size;
    }
    make_room();
}

// Returns why there are no colours, where they are damaged: the surface is shown without them.
template <class Paint>
std::string Video::paint_with(uint32_t chunk, int64_t layers, Paint paint) {
    const uint32_t of = head.companion_of(chunk, ChunkKind::COLORS);
    if (of == kNoChunk) return "";
    try {
        refused_.check(of);
        const std::vector<uint8_t> data = read(of, layers);
        refused_.of(head, of, [&] { paint(view(data)); });
    } catch (const FormatError& error) {
        return error.what();
    }
    return "";
}

std::string Video::paint(uint32_t chunk, const Context& context, int64_t layers, Continued& made) {
    return paint_with(chunk, layers, [&](const mr_bytes& data) { paint_group(data, context, made); });
}

uint32_t Video::pictures_of(uint32_t chunk) const {
    const uint32_t pictures = head.companion_of(chunk, ChunkKind::PICTURES);
    return pictures == kNoChunk ? head.companion_of(chunk, ChunkKind::COMPATIBLE) : pictures;
}

// Returns why there are no places, where they are damaged.
std::string Video::put_on_texture(uint32_t chunk, unsigned levels, const Faces& faces, std::vector<float>& places) {
    const uint32_t pictures = pictures_of(chunk);
    if (pictures == kNoChunk) return "";
    try {
        const uint32_t number = static_cast<uint32_t>(head.chunks[pictures].depends_on[1]);
        const Layout& found = atlas(number);
        require(count_of(found.places->size()) * std::pow(4.0, levels) == 2 * count_of(faces->size()),
                "an atlas of another mesh");
        places = places_of(found, levels);
    } catch (const FormatError& error) {
        return error.what();
    }
    return "";
}

const Layout& Video::atlas(uint32_t chunk) {
    if (atlas_chunk_ == chunk) return atlas_;
    refused_.check(chunk);
    const std::vector<uint8_t> data = read(chunk, kAllLayers);
    const std::vector<uint8_t> of = read(static_cast<uint32_t>(head.chunks[chunk].depends_on[0]), 0);
    atlas_ = refused_.of(head, chunk, [&] { return decode_atlas(view(data), base_mesh(view(of))); });
    atlas_chunk_ = chunk;
    return atlas_;
}

Mesh Video::background(uint64_t frame) {
    const uint32_t chunk = head.static_of_frame(frame);
    lacking.clear();
    if (chunk == kNoChunk) return Mesh();
    Mesh mesh = state_of(chunk);
    turn(mesh.vertices.data(), mesh.vertices.size());  // not the state, to which changes are made
    lacking = background_.lacking;
    return mesh;
}

// Decodes from the last state, if this one was changed from it.
const Mesh& Video::state_of(uint32_t chunk) {
    std::vector<uint32_t> chain(1, chunk);
    refused_.check(chunk);
    while (chain.back() != background_.chunk && !head.chunks[chain.back()].depends_on.empty()) {
        const uint32_t before = static_cast<uint32_t>(head.chunks[chain.back()].depends_on[0]);
        refused_.check(before, chain);
        chain.push_back(before);
    }
    if (chain.back() == background_.chunk) chain.pop_back();
    else background_ = {};
    try {
        for (; !chain.empty(); chain.pop_back()) {
            background_.mesh = decode_state(chain.back());
            background_.chunk = chain.back();
        }
    } catch (...) {
        background_ = {};
        throw;
    }
    return background_.mesh;
}

Mesh Video::decode_state(uint32_t chunk) {
    const std::vector<uint8_t> payload = read(chunk, kAllLayers);
    const bool is_change = head.chunks[chunk].form == Form::PATCH;
    const Mesh* before = is_change ? &background_.mesh : nullptr;
    const mr_placement place = context_of(chunk, nullptr).place;
    Background made = refused_.of(head, chunk, [&] {
        Background found = decode_background(view(payload), before, place);
        background_.cost = is_change ? background_.cost + change_cost(*before, found.mesh) : 0;
        background_.size = (is_change ? background_.size : 0) + count_of(payload.size());
        require(background_.cost <= limits::kChain * allowance(background_.size),
                "a background that costs more than its bytes may");
        return found;
    });
    std::string& lacks = background_.lacking;
    if (!is_change) lacks.clear();
    const std::string unpainted =
        paint_with(chunk, kAllLayers, [&](const mr_bytes& data) { paint_background(data, made); });
    if (lacks.empty()) lacks = unpainted;
    const std::string more = put_on_texture(chunk, 0, made.mesh.faces, made.mesh.places);
    if (lacks.empty()) lacks = more;
    return std::move(made.mesh);
}

// The chunk of the splats that a group has: its own, or those of a group before it.
uint32_t Video::splats_of(uint32_t chunk) const {
    for (; chunk != kNoChunk; chunk = head.group_before(chunk)) {
        const Form form = head.chunks[chunk].form;
        if (form != Form::LAYERS && form != Form::LAPLACIAN) return kNoChunk;
        const uint32_t found = head.companion_of(chunk, ChunkKind::SPLATS);
        if (found != kNoChunk) return found;
    }
    return kNoChunk;
}

Bound Video::splats(uint64_t frame, size_t track) {
    lacking.clear();
    const uint32_t chunk = head.chunk_of_frame(frame, track), of = splats_of(chunk);
    if (of == kNoChunk) return Bound();
    const Group& group = group_of(frame, track);
    if (splats_.chunk != of) {
        refused_.check(of);
        const uint32_t owner = static_cast<uint32_t>(head.chunks[of].depends_on[0]);
        const std::vector<uint8_t> first = read(owner, 0), data = read(of, layers_);
        splats_ = {};
        splats_.faces = refused_.of(head, of, [&] { return base_mesh(view(first)).face_count(); });
        splats_.found = refused_.of(head, of, [&] { return decode_splats(view(data), splats_.faces); });
        splats_.chunk = of;
    }
    const double corners = 3 * std::ldexp(count_of(splats_.faces), 2 * static_cast<int>(group.levels));
    if (count_of(group.faces->size()) != corners) return Bound();  // they are of another mesh
    const size_t t = static_cast<size_t>(frame - head.chunks[chunk].first_frame);
    return bind_splats(splats_.found.all, group, t, head.header.scale);
}

}  // namespace meshreel
