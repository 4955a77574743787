// The laws of an index. Beside src/meshreel/format/checks.py.
#include <algorithm>

#include "../budget.h"
#include "head.h"

namespace meshreel {
namespace {

constexpr uint64_t kMostAudio = static_cast<uint64_t>(limits::kAudio);  // bytes of a chunk
constexpr Form kCompanionForms[] = {Form::VERTEX_COLORS, Form::PLACES, Form::VIDEO, Form::VIDEO,
                                    Form::GAUSSIANS};  // from COLORS on

class IndexChecks {
public:
    explicit IndexChecks(Head& head) : head_(head) {}

    void add(uint32_t number) {
        number_ = number;
        Chunk& entry = head_.chunks[number];
        need(!entry.layers.empty(), "a chunk without layers");
        for (const Layer& layer : entry.layers) need(layer.size > 0, "a layer without bytes");
        std::vector<uint64_t> sorted = entry.depends_on;
        std::sort(sorted.begin(), sorted.end());
        need(std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end(), "depends on a chunk twice");
        if (entry.kind == ChunkKind::STATIC || entry.kind == ChunkKind::GROUP) {
            need((entry.kind == ChunkKind::STATIC) == (entry.frames == 0),
                 "a number of frames that its kind cannot have");
            need(entry.form >= Form::LAPLACIAN && entry.form <= Form::PATCH, "a form that its kind cannot have");
        }
        if (entry.kind == ChunkKind::STATIC) add_static(entry);
        else if (entry.kind == ChunkKind::GROUP) add_group(entry);
        else if (entry.is_companion()) add_companion(entry);
        else if (entry.kind == ChunkKind::AUDIO) add_audio(entry);
    }

    void finish() {
        require(!head_.tracks.empty(), "no frames: the index names no group");
        for (const uint64_t frames : frames_)
            require(frames == frames_[0], "a track that has more or fewer frames than another");
        head_.frames = frames_[0];
    }

private:
    // A STATIC or GROUP chunk, as far as others refer to it.
    struct Whole {
        uint32_t before;  // group that it is predicted from, or kNoChunk
        bool is_base;     // begins with a base mesh, so that it may have an atlas
        bool is_bearer;   // may have splats
        int changes;      // patches that lead to it; -1 of a group
        uint64_t atlas;   // that its pictures are of
    };

    void need(bool holds, const char* what) const {
        if (!holds) throw FormatError("chunk " + std::to_string(number_) + ": " + what);
    }

    const Whole* whole(uint64_t number) const {
        const auto found = wholes_.find(number);
        return found == wholes_.end() ? nullptr : &found->second;
    }

    bool is_static(uint64_t number) const {
        const Whole* known = whole(number);
        return known && known->changes >= 0;
    }

    void add_static(const Chunk& entry) {
        need((entry.form == Form::DRACO || entry.form == Form::PATCH) && entry.track == 0,
             "a background of another form, or with a track");
        need(entry.depends_on.size() == (entry.form == Form::PATCH ? 1u : 0u),
             "a background that depends on too much or too little");
        int changes = 0;
        if (entry.form == Form::PATCH) {
            need(is_static(entry.depends_on[0]), "a patch of what is no background before it");
            changes = whole(entry.depends_on[0])->changes + 1;
            need(changes <= kMostChanges, "a patch too many of one background");
        }
        wholes_[number_] = {kNoChunk, entry.form == Form::DRACO, false, changes, 0};
    }

    void add_group(Chunk& entry) {
        need(entry.form != Form::PATCH, "a group of form PATCH");
        need(entry.track <= frames_.size() && entry.track < kMostTracks,
             "a track whose number leaves a gap, or one too many");
        const size_t track = static_cast<size_t>(entry.track);
        const bool is_new = track == frames_.size();
        entry.first_frame = is_new ? 0 : frames_[track];
        const std::pair<uint64_t, int64_t> place(entry.first_frame, static_cast<int64_t>(track));
        need(place > place_, "not in the order of first frames and tracks");
        uint32_t before = kNoChunk;
        int statics = 0;
        for (const uint64_t other : entry.depends_on) {
            if (is_static(other)) {
                head_.shown_from.emplace(static_cast<uint32_t>(other), entry.first_frame);
                ++statics;
                continue;
            }
            need(before == kNoChunk && !is_new && other == head_.tracks[track].back(),
                 "depends on neither a background before it nor the last group of its track");
            before = static_cast<uint32_t>(other);
        }
        need(statics <= 1, "depends on several backgrounds");
        if (is_new) frames_.push_back(0), head_.tracks.emplace_back();
        frames_[track] += entry.frames;
        head_.tracks[track].push_back(number_);
        place_ = place;
        const bool is_base = entry.form == Form::LAYERS && before == kNoChunk;
        wholes_[number_] = {before, is_base, is_base || entry.form == Form::LAPLACIAN, -1, 0};
    }

    // What is heard is not this library's: it only keeps the laws.
    void add_audio(const Chunk& entry) {
        uint64_t size = 0;
        for (const Layer& layer : entry.layers)
            size = std::min(size + std::min(layer.size, kMostAudio + 1), kMostAudio + 1);
        need(!has_audio_ && entry.form == Form::AUDIO_FILE && !entry.frames && !entry.track &&
                 entry.depends_on.empty() && size <= kMostAudio,
             "audio besides other audio, not on its own, or too much");
        has_audio_ = true;
    }

    void add_companion(Chunk& entry) {
        const uint64_t of = entry.depends_on.empty() ? ~uint64_t{0} : entry.depends_on[0];
        need(whole(of) && head_.companion_of(static_cast<uint32_t>(of), entry.kind) == kNoChunk,
             "belongs to no chunk before it, or to one that has others");
        const Chunk& owner = head_.chunks[of];
        need(entry.form == kCompanionForms[static_cast<size_t>(entry.kind) - static_cast<size_t>(ChunkKind::COLORS)] &&
                 entry.frames == owner.frames && entry.track == owner.track,
             "its form, frames or track are not those of the chunk that it belongs to");
        const std::vector<uint64_t> others(entry.depends_on.begin() + 1, entry.depends_on.end());
        need(is_right(entry.kind, static_cast<uint32_t>(of), others), "depends on what its kind does not");
        entry.first_frame = owner.first_frame;
        head_.companions[{static_cast<uint32_t>(of), entry.kind}] = number_;
        if (entry.form == Form::VIDEO) wholes_[of].atlas = others[0];
    }

    bool is_right(ChunkKind kind, uint32_t of, const std::vector<uint64_t>& others) const {
        const Whole& known = *whole(of);
        const uint32_t last = known.before == kNoChunk ? kNoChunk : head_.companion_of(known.before, kind);
        if (kind == ChunkKind::COLORS)
            return others.empty() || (last != kNoChunk && others == std::vector<uint64_t>{last});
        if (kind == ChunkKind::ATLAS) return known.is_base && others.empty();
        if (kind == ChunkKind::SPLATS) return known.is_bearer && others.empty();
        const uint32_t own = head_.companion_of(of, ChunkKind::ATLAS);
        if (own != kNoChunk) return others == std::vector<uint64_t>{own};
        return last != kNoChunk && others == std::vector<uint64_t>{whole(known.before)->atlas, last};
    }

    Head& head_;
    uint32_t number_ = 0;
    bool has_audio_ = false;
    std::vector<uint64_t> frames_;  // of each track so far
    std::pair<uint64_t, int64_t> place_{0, -1};
    std::map<uint64_t, Whole> wholes_;
};

}  // namespace

void check_index(Head& head) {
    IndexChecks checks(head);
    for (uint32_t number = 0; number < head.chunks.size(); ++number) checks.add(number);
    checks.finish();
}

}  // namespace meshreel
