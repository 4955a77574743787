#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <utility>

#include "arrays.h"
#include "guarded.h"
#include "meshreel/layers.h"
#include "scratch.h"

namespace meshreel {
namespace {

// Sorts by insertion what is as short as nearly always.
template <class Iterator, class Less>
void sort_few(Iterator begin, Iterator end, Less less) {
    if (end - begin > 16) return std::sort(begin, end, less);
    for (Iterator next = begin; next != end; ++next) {
        const auto value = *next;
        Iterator at = next;
        for (; at != begin && less(value, *(at - 1)); --at) *at = *(at - 1);
        *at = value;
    }
}

// Half-edges grouped by their smaller end, in each group by their larger; equal ones are one edge.
struct HalfEdge {
    int32_t high;
    int32_t slot;  // 3 * face + side
};

size_t number_edges(const int32_t* faces, size_t face_count, size_t vertices, int32_t* edges, int32_t* numbers) {
    Array<size_t> starts(vertices + 1, 0);
    const auto ends = [&](size_t slot) {
        const int32_t a = faces[slot], b = faces[slot % 3 == 2 ? slot - 2 : slot + 1];
        return std::pair<int32_t, int32_t>(std::min(a, b), std::max(a, b));
    };
    for (size_t slot = 0; slot < 3 * face_count; ++slot) ++starts[static_cast<size_t>(ends(slot).first) + 1];
    for (size_t v = 0; v < vertices; ++v) starts[v + 1] += starts[v];
    Array<HalfEdge> halves(3 * face_count);
    Array<size_t> next(starts.begin(), starts.end() - 1);
    for (size_t slot = 0; slot < 3 * face_count; ++slot) {
        const auto [low, high] = ends(slot);
        halves[next[static_cast<size_t>(low)]++] = {high, static_cast<int32_t>(slot)};
    }
    size_t count = 0;
    for (size_t v = 0; v < vertices; ++v) {
        const auto begin = halves.begin() + static_cast<int64_t>(starts[v]),
                   end = halves.begin() + static_cast<int64_t>(starts[v + 1]);
        sort_few(begin, end, [](const HalfEdge& a, const HalfEdge& b) { return a.high < b.high; });
        for (auto half = begin; half != end; ++half) {
            if (half == begin || half->high != (half - 1)->high) {
                edges[2 * count] = static_cast<int32_t>(v);
                edges[2 * count + 1] = half->high;
                ++count;
            }
            numbers[half->slot] = static_cast<int32_t>(count - 1);
        }
    }
    return count;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_subdivide(const int32_t* faces, size_t face_count, size_t vertices, int32_t* edges, int32_t* finer,
                 size_t* edge_count) {
    if (vertices > INT32_MAX || vertices + 3 * face_count > INT32_MAX) return MR_BAD_INPUT;
    if (!in_range(faces, 3 * face_count, vertices)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        Array<int32_t> numbers(3 * face_count);
        *edge_count = number_edges(faces, face_count, vertices, edges, numbers.data());
        const int32_t first = static_cast<int32_t>(vertices);
        for (size_t f = 0; f < face_count; ++f, finer += 12) {
            const int32_t a = faces[3 * f], b = faces[3 * f + 1], c = faces[3 * f + 2];
            const int32_t ab = first + numbers[3 * f], bc = first + numbers[3 * f + 1], ca = first + numbers[3 * f + 2];
            const int32_t cut[12] = {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca};
            std::copy(cut, cut + 12, finer);
        }
        return int{MR_OK};
    });
}

int mr_siblings(const int32_t* finer, size_t face_count, size_t vertices, size_t edge_count, int64_t* starts,
                int32_t* near) {
    if (vertices > INT32_MAX || edge_count > INT32_MAX) return MR_BAD_INPUT;
    const int64_t first = static_cast<int64_t>(vertices);
    const auto in_face = [&](size_t f, int k) { return finer[12 * f + 9 + static_cast<size_t>(k)] - first; };
    for (size_t f = 0; f < face_count; ++f)
        for (int k = 0; k < 3; ++k)
            if (in_face(f, k) < 0 || in_face(f, k) >= static_cast<int64_t>(edge_count)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        Array<int64_t> bounds(edge_count + 1, 0);
        const auto each_pair = [&](auto&& visit) {
            for (size_t f = 0; f < face_count; ++f)
                for (int k = 0; k < 3; ++k)
                    for (int j = 0; j < 3; ++j)
                        if (in_face(f, j) < in_face(f, k)) visit(in_face(f, k), in_face(f, j));
        };
        each_pair([&](int64_t late, int64_t) { ++bounds[static_cast<size_t>(late) + 1]; });
        for (size_t e = 0; e < edge_count; ++e) bounds[e + 1] += bounds[e];
        Array<int32_t> all(static_cast<size_t>(bounds[edge_count]));
        Array<int64_t> next(bounds.begin(), bounds.end() - 1);
        each_pair([&](int64_t late, int64_t early) {
            all[static_cast<size_t>(next[static_cast<size_t>(late)]++)] = static_cast<int32_t>(early);
        });
        starts[0] = 0;
        for (size_t e = 0; e < edge_count; ++e) {
            const auto begin = all.begin() + bounds[e], end = all.begin() + bounds[e + 1];
            sort_few(begin, end, std::less<>());
            const auto last = std::unique(begin, end);
            std::copy(begin, last, near + starts[e]);
            starts[e + 1] = starts[e] + (last - begin);
        }
        return int{MR_OK};
    });
}

size_t mr_keep_faces(const int32_t* faces, const uint8_t* dropped, size_t face_count, int32_t* kept) {
    const uint8_t *at = dropped, *end = dropped + face_count;
    const int32_t* begin = kept;
    while (at != end) {  // few and long runs: each is copied at once
        at = std::find(at, end, uint8_t{0});
        const uint8_t* behind = at;
        for (uint64_t eight; end - behind >= 8; behind += 8) {
            std::memcpy(&eight, behind, 8);
            if (eight != 0) break;
        }
        while (behind != end && *behind == 0) ++behind;
        kept = std::copy(faces + 3 * (at - dropped), faces + 3 * (behind - dropped), kept);
        at = behind;
    }
    return static_cast<size_t>(kept - begin) / 3;
}
