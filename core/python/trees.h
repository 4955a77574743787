// The tree of a surface as a class, which frames hold.
#pragma once

#include <algorithm>
#include <memory>

#include "arrays.h"
#include "meshreel/tree.h"

namespace meshreel {

template <class T, void (*destroy)(T*)>
struct Destroy {
    void operator()(T* handle) const { destroy(handle); }
};

inline bool are_vectors(const In<double, 2>& rows, size_t count) {
    return rows.shape(0) == count && rows.shape(1) == 3;
}

class PySurfaceTree {
public:
    PySurfaceTree(In<double, 2> positions, In<int32_t, 2> faces)
        : vertices_(positions.shape(0)), faces_(faces.shape(0)) {
        const mr_mesh mesh = mesh_of(positions, faces);
        mr_tree* tree = nullptr;
        check(without_gil([&] { return mr_tree_create(&mesh, &tree); }));
        tree_.reset(tree);
    }

    void move(In<double, 2> positions) {
        expect(are_vectors(positions, vertices_));
        check(without_gil([&] { return mr_tree_move(tree_.get(), positions.data()); }));
    }

    nb::tuple closest(In<double, 2> queries, double reach, nb::object guesses, nb::object gone) const {
        const size_t count = queries.shape(0);
        expect(are_vectors(queries, count));
        Buffer<int32_t> faces(count);
        std::fill(faces.data(), faces.data() + count, -1);
        if (!guesses.is_none()) {
            const auto given = nb::cast<In<int32_t, 1>>(guesses);
            expect(given.shape(0) == count);
            std::copy(given.data(), given.data() + count, faces.data());
        }
        const uint8_t* left_out = nullptr;
        if (!gone.is_none()) {
            const auto given = nb::cast<In<uint8_t, 1>>(gone);
            expect(given.shape(0) == faces_);
            left_out = given.data();
        }
        Buffer<double> weights(3 * count);
        check(without_gil([&] {
            return mr_tree_closest(tree_.get(), queries.data(), count, reach, left_out, faces.data(), weights.data());
        }));
        return nb::make_tuple(faces.shaped(count), weights.shaped(count, 3));
    }

    nb::tuple cast(In<double, 2> origins, In<double, 2> ways, bool weighted) const {
        const size_t count = ways.shape(0);
        const bool one = origins.shape(0) == 1;
        expect(are_vectors(ways, count) && are_vectors(origins, one ? 1 : count));
        Buffer<int32_t> faces(count);
        Buffer<double> distances(count), weights(weighted ? 3 * count : 0);
        const mr_rays rays{origins.data(), ways.data(), count, one};
        check(without_gil([&] {
            return mr_tree_cast(tree_.get(), &rays, faces.data(), distances.data(),
                                weighted ? weights.data() : nullptr);
        }));
        return nb::make_tuple(faces.shaped(count), distances.shaped(count), weights.shaped(weighted ? count : 0, 3));
    }

    const mr_tree* handle() const { return tree_.get(); }

private:
    size_t vertices_, faces_;
    std::unique_ptr<mr_tree, Destroy<mr_tree, mr_tree_destroy>> tree_;
};

}  // namespace meshreel
