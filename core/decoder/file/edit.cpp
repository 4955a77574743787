// Edits of a file: which of its coded frames are shown, and how they are turned. Beside src/meshreel/format/edit.py.
#include <algorithm>
#include <cmath>
#include <functional>

#include "../../src/format_error.h"
#include "head.h"

namespace meshreel {
namespace {

constexpr double kClose = 1e-6;  // to a rotation
constexpr double kMost = 2;      // of the numbers that may be one's

uint64_t frame_of(const std::string& number) {
    const double frame = double_of(number);
    require(frame >= 0 && frame <= kExact, "Header.metadata: edit.frames are beyond all frames");
    require(frame == std::floor(frame), "Header.metadata: edit.frames are no whole numbers");
    return static_cast<uint64_t>(frame);
}

double entry_of(const std::string& number) {
    const double value = double_of(number);
    require(std::fabs(value) <= kMost, "Header.metadata: edit.rotation has a number that no rotation has");
    return value;
}

bool is_rotation(const double (&m)[9]) {
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            double product = i == j ? -1 : 0;
            for (int k = 0; k < 3; ++k) product += m[3 * i + k] * m[3 * j + k];
            if (std::fabs(product) > kClose) return false;
        }
    }
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
               m[2] * (m[3] * m[7] - m[4] * m[6]) >
           0;
}

void read_rotation(const std::vector<std::string>& numbers, Edit& edit) {
    if (numbers.empty()) return;
    require(numbers.size() == 9, "Header.metadata: edit.rotation has not nine numbers");
    std::transform(numbers.begin(), numbers.end(), edit.rotation, entry_of);
    require(is_rotation(edit.rotation), "Header.metadata: edit.rotation is no rotation");
    edit.is_turned = true;
}

}  // namespace

Edit parse_edit(const std::string& metadata, uint64_t frames) {
    const std::map<std::string, std::string> all = members_of(metadata);
    const auto item = all.find("edit");
    require(item != all.end(), "Header.metadata: the file is edited, and no edit is told");
    Edit edit;
    edit.ends = {0, frames};
    for (const auto& [name, value] : members_of(item->second)) {
        const bool is_frames = name == "frames";
        require(is_frames || name == "rotation",
                "Header.metadata: an edit that this reader does not know, update meshreel");
        const std::vector<std::string> numbers = number_list(value);
        if (!is_frames) {
            read_rotation(numbers, edit);
            continue;
        }
        require(!numbers.empty() && numbers.size() % 2 == 0, "Header.metadata: edit.frames are no pairs of numbers");
        edit.ends.resize(numbers.size());
        std::transform(numbers.begin(), numbers.end(), edit.ends.begin(), frame_of);
        const auto falls = std::adjacent_find(edit.ends.begin(), edit.ends.end(), std::greater_equal<uint64_t>());
        require(falls == edit.ends.end() && edit.ends.back() <= frames,
                "Header.metadata: edit.frames are not those of the file");
    }
    return edit;
}

// Of the ranges, the next behind the one that a group begins in or before must not reach into the group.
void check_shown(const Head& head) {
    const std::vector<uint64_t>& ends = head.edit.ends;
    for (const Chunk& chunk : head.chunks) {
        if (chunk.kind != ChunkKind::GROUP) continue;
        const auto behind = std::upper_bound(ends.begin(), ends.end(), chunk.first_frame);
        const size_t next = (static_cast<size_t>(behind - ends.begin()) / 2 + 1) * 2;
        require(next >= ends.size() || ends[next] >= chunk.first_frame + chunk.frames,
                "Header.metadata: edit.frames have two ranges with frames of one group");
    }
}

}  // namespace meshreel
