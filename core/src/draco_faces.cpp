#include "draco_faces.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

namespace meshreel {
namespace {

using namespace clers;

constexpr int kContexts = 6;  // of valences 2 to 7

// Symbols in the order of decoding.
class Symbols {
public:
    Symbols(DracoReader& in, DracoTraversal traversal, const DracoClaims& claims) : traversal_(traversal) {
        if (traversal == DracoTraversal::Standard) bits_ = in.block();
        start_chance = in.byte();
        starts = in.block();
        if (traversal == DracoTraversal::Standard) return;
        uint64_t left = claims.symbols;
        for (std::vector<uint8_t>& context : contexts_) {
            const uint64_t count = in.varint();
            if (count > left) in.fail();
            if (!in.good()) return;
            left -= count;
            if (count > 0) in.symbols(count, 1, kSymbols, &context);
        }
    }

    // kSymbols where there are no more.
    uint8_t next(uint32_t valence) {
        if (traversal_ == DracoTraversal::Standard) {
            constexpr Symbol coded[] = {S, L, R, E};
            const uint8_t symbol = bits_.bits(1) == 0 ? C : coded[bits_.bits(2)];
            return bits_.good() ? symbol : static_cast<uint8_t>(kSymbols);
        }
        if (valence == 0) return E;  // the first
        std::vector<uint8_t>& context = contexts_[std::clamp(valence, 2u, 7u) - 2];
        if (context.empty()) return kSymbols;
        const uint8_t symbol = context.back();
        context.pop_back();
        return symbol;
    }

    uint8_t start_chance;  // as DracoFaces has them
    DracoReader starts;

private:
    DracoTraversal traversal_;
    DracoReader bits_;
    std::vector<uint8_t> contexts_[kContexts];
};

// The boundary of the faces so far: loops of edges. Each new face is put to the active edge, the last one of a stack.
class Boundary {
public:
    explicit Boundary(uint64_t points) { edges_.reserve(points); }

    uint64_t points() const { return edges_.size() - joined_.size(); }
    uint64_t joined() const { return joined_.size(); }
    uint64_t open() const { return stack_.size(); }
    uint32_t valence() const { return stack_.empty() ? 0 : edges_[stack_.back()].valence; }

    // False where no face can be put there. `waiting` is the edge of a handle that this symbol closes, or kNone.
    bool add(uint8_t symbol, uint32_t waiting) {
        if (symbol >= kSymbols || (waiting != kNone && symbol != S)) return false;
        if (symbol == E) return start(), true;
        if (stack_.empty() || edges_[stack_.back()].waits) return false;
        if (symbol == C) return close();
        if (symbol == S) return join(waiting);
        const uint32_t old = stack_.back(), more = insert_after(old);
        count(edges_[more].next, 1);
        count(more, 2);
        count(old, 1);
        if (symbol == L) stack_.back() = more;
        return true;
    }

    // The edge beside the active one that waits for a handle; kNone where it is no edge of the last face's own.
    uint32_t wait(uint8_t symbol, bool is_right) {
        if (symbol == C || symbol == S || (symbol != E && (symbol == R) != is_right)) return kNone;
        const Edge& active = edges_[stack_.back()];
        const uint32_t edge = is_right ? active.next : active.previous;
        edges_[edge].waits = true;
        return edge;
    }

    // Ends the boundary. Returns how many corners were renamed: at each join those of one vertex, and at last, so that
    // no number of a vertex is missing, those of the last vertex for each that was joined to another.
    uint64_t renamed() {
        size_t end = edges_.size();
        for (const uint32_t missing : joined_) {
            while (end > 0 && edges_[end - 1].valence == 0) --end;
            if (end <= missing + size_t{1}) continue;
            edges_[missing].valence = std::exchange(edges_[--end].valence, 0);
            renamed_ += edges_[missing].valence;
        }
        return renamed_;
    }

    static constexpr uint32_t kNone = ~0u;

private:
    // An edge and the vertex that it starts at; both have the number of the vertex. A vertex of the boundary has one
    // edge.
    struct Edge {
        uint32_t next, previous;
        uint32_t valence;  // of the vertex; 0 once that is joined to another
        bool waits;
    };

    void count(uint32_t edge, uint32_t more) { edges_[edge].valence += more; }

    void link(uint32_t edge, uint32_t next) { edges_[edge].next = next, edges_[next].previous = edge; }

    uint32_t insert_after(uint32_t edge) {
        const uint32_t next = edges_[edge].next, made = static_cast<uint32_t>(edges_.size());
        edges_.push_back({next, edge, 0, false});
        link(edge, made), link(made, next);
        return made;
    }

    void start() {  // a face that has no neighbour yet
        const uint32_t first = static_cast<uint32_t>(edges_.size());
        for (uint32_t k = 0; k < 3; ++k) edges_.push_back({first + (k + 1) % 3, first + (k + 2) % 3, 2, false});
        stack_.push_back(first + 1);
    }

    bool close() {  // between the active edge and the one before it
        const uint32_t old = stack_.back(), before = edges_[old].previous, after = edges_[old].next;
        if (before == old || edges_[before].waits) return false;
        link(before, after);
        count(before, 1), count(after, 1);
        stack_.back() = before;
        return true;
    }

    bool join(uint32_t waiting) {  // between the two last active edges, or the last and one that waits
        const uint32_t b = stack_.back();
        stack_.pop_back();
        if (waiting != kNone) edges_[waiting].waits = false, stack_.push_back(waiting);
        if (stack_.empty()) return false;
        const uint32_t a = stack_.back(), kept = edges_[a].next, end = edges_[b].next;
        if (a == b || kept == b || end == a || edges_[a].waits) return false;
        link(edges_[b].previous, kept), link(a, end);
        renamed_ += edges_[b].valence;
        joined_.push_back(b);
        count(kept, std::exchange(edges_[b].valence, 0));
        count(a, 1), count(end, 1);
        return true;
    }

    std::vector<Edge> edges_;
    std::vector<uint32_t> stack_, joined_;
    uint64_t renamed_ = 0;
};

bool read_handles(DracoReader& in, uint64_t symbols, std::vector<DracoHandle>& handles) {
    const uint64_t count = in.varint();
    uint64_t source = 0;
    for (uint64_t k = 0; k < count && in.good(); ++k) {
        source += in.varint();
        const uint64_t back = in.varint();
        if (back > source || source >= symbols) return false;
        handles.push_back({source, source - back, false});
    }
    if (count == 0) return true;
    DracoReader bits(in.take((count + 7) / 8), (count + 7) / 8);
    for (DracoHandle& handle : handles) handle.is_right = in.good() && bits.bits(1) == 1;
    return in.good();
}

// Calls `begin` with the handles and the symbols, of which it tells `keep` one after the other.
template <class Begin, class Keep>
bool follow(DracoReader& in, DracoTraversal traversal, DracoClaims& claims, Begin begin, Keep keep) {
    std::vector<DracoHandle> handles;
    if (!read_handles(in, claims.symbols, handles)) return false;
    Symbols symbols(in, traversal, claims);
    if (!in.good()) return false;
    begin(handles, symbols);
    Boundary boundary(claims.points + claims.splits);
    std::unordered_map<uint64_t, uint32_t> waiting;          // edges, by the symbol of the split
    for (uint64_t number = claims.symbols; number-- > 0;) {  // the encoder's numbers: it went the other way
        const uint8_t symbol = symbols.next(boundary.valence());
        keep(symbol);
        const auto found = waiting.find(number);
        if (!boundary.add(symbol, found == waiting.end() ? Boundary::kNone : found->second)) return false;
        for (; !handles.empty() && handles.back().source == number; handles.pop_back()) {
            const uint32_t edge = boundary.wait(symbol, handles.back().is_right);
            if (edge == Boundary::kNone || !waiting.emplace(handles.back().split, edge).second) return false;
        }
    }
    claims.steps = boundary.renamed();
    return boundary.points() == claims.points && boundary.joined() == claims.splits &&
           claims.faces - claims.symbols <= boundary.open();
}

}  // namespace

bool read_draco_faces(DracoReader& in, DracoTraversal traversal, DracoClaims& claims) {
    return follow(in, traversal, claims, [](const auto&, const Symbols&) {}, [](uint8_t) {});
}

bool read_draco_faces(DracoReader& in, DracoTraversal traversal, DracoClaims& claims, DracoFaces& faces) {
    const auto begin = [&](const std::vector<DracoHandle>& handles, const Symbols& symbols) {
        faces.handles = handles, faces.start_chance = symbols.start_chance, faces.starts = symbols.starts;
    };
    return follow(in, traversal, claims, begin, [&](uint8_t symbol) { faces.symbols.push_back(symbol); });
}

}  // namespace meshreel
