#include <algorithm>
#include <climits>
#include <vector>

#include "guarded.h"
#include "meshreel/laplacian.h"

namespace meshreel {
namespace {

struct Graph {
    std::vector<int64_t> starts;
    std::vector<int32_t> neighbours;  // repeated where faces share an edge; order does not change hops
};

Graph graph_of(const int32_t* faces, int64_t face_count, int64_t vertices) {
    Graph g;
    g.starts.assign(static_cast<size_t>(vertices) + 1, 0);
    for (int64_t k = 0; k < 3 * face_count; ++k) g.starts[faces[k] + 1] += 2;
    for (int64_t v = 0; v < vertices; ++v) g.starts[v + 1] += g.starts[v];
    g.neighbours.resize(static_cast<size_t>(g.starts[vertices]));
    std::vector<int64_t> next(g.starts.begin(), g.starts.end() - 1);
    for (int64_t f = 0; f < face_count; ++f)
        for (int c = 0; c < 3; ++c) {
            const int32_t i = faces[3 * f + c];
            g.neighbours[next[i]++] = faces[3 * f + (c + 1) % 3];
            g.neighbours[next[i]++] = faces[3 * f + (c + 2) % 3];
        }
    return g;
}

// Updates the hops to the nearest source for a new source: only vertices that come closer are visited.
void add_source(const Graph& g, int32_t source, std::vector<int32_t>& hops, std::vector<int32_t>& queue) {
    queue.assign(1, source);
    hops[source] = 0;
    for (size_t head = 0; head < queue.size(); ++head) {
        const int32_t v = queue[head];
        for (int64_t p = g.starts[v]; p < g.starts[v + 1]; ++p) {
            const int32_t w = g.neighbours[p];
            if (hops[w] <= hops[v] + 1) continue;
            hops[w] = hops[v] + 1;
            queue.push_back(w);
        }
    }
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int64_t mr_farthest_anchors(const int32_t* faces, int64_t face_count, int64_t vertices, int64_t count, int32_t* out) {
    if (vertices < 0 || vertices > INT_MAX || face_count < 0 || count < 0) return -1;
    for (int64_t k = 0; k < 3 * face_count; ++k)
        if (faces[k] < 0 || faces[k] >= vertices) return -1;
    int64_t found = 0;
    const int status = guarded(MR_NO_MEMORY, [&] {
        const Graph g = graph_of(faces, face_count, vertices);
        std::vector<int32_t> hops(static_cast<size_t>(vertices), INT_MAX), queue;
        for (int32_t v = 0; v < vertices; ++v) {  // one a component
            if (hops[v] != INT_MAX || g.starts[v] == g.starts[v + 1]) continue;
            add_source(g, v, hops, queue);
            out[found++] = v;
        }
        for (int32_t& h : hops)
            if (h == INT_MAX) h = 0;  // no face uses it: its own row of L determines it
        while (found < count) {
            const int32_t far = hops.empty() ? 0 : *std::max_element(hops.begin(), hops.end());
            if (far == 0) break;
            // The first of the farthest, again and again: no vertex comes to be as far as these. Each distance is
            // searched once, and there are at most 2 sqrt(V): a source that is far has many vertices to itself.
            for (int32_t v = 0; v < vertices && found < count; ++v) {
                if (hops[v] != far) continue;
                add_source(g, v, hops, queue);
                out[found++] = v;
            }
        }
        std::sort(out, out + found);
        return MR_OK;
    });
    return status == MR_OK ? found : -1;
}
