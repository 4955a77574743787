// Groups, backgrounds, atlases and splats, decoded from their bytes into arrays that look at the decoder's memory.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <array>
#include <optional>
#include <tuple>

#include "../decoder/group.h"
#include "../decoder/splats.h"
#include "../src/format_error.h"
#include "arrays.h"

namespace meshreel {
namespace {

using namespace nb::literals;
using StateOf = std::shared_ptr<State>;
using Place = std::tuple<double, std::array<double, 3>>;  // scale and origin
using Layers = std::optional<int64_t>;                    // at most, beyond the first; none: all

mr_placement placement_of(const Place& place) {
    const auto& [scale, origin] = place;
    return {scale, {origin[0], origin[1], origin[2]}};
}

// What `body` gives, while other threads of Python run.
template <class Body>
auto alone(Body body) {
    const nb::gil_scoped_release released;
    return body();
}

// A read-only array of numbers that `owner` has. Rows of 3, or of 3 x 2.
template <class T, class... Sizes>
nb::object array_of(const T* numbers, nb::handle owner, Sizes... sizes) {
    constexpr T kNothing{};
    const T* from = numbers ? numbers : &kNothing;  // of an array without numbers
    return nb::cast(nb::ndarray<nb::numpy, const T, nb::ndim<sizeof...(Sizes)>>(from, {size_t(sizes)...}, owner),
                    nb::rv_policy::reference);
}

// What a mesh has beside vertices and faces, whose arrays may be empty.
struct Dress {
    bool colors = false, places = false;
};

// The vertices, faces, colours and places of a mesh that `owner` has.
nb::tuple arrays_of(const Mesh& mesh, Dress has, nb::handle owner) {
    const size_t vertices = mesh.vertex_count(), faces = mesh.face_count();
    return nb::make_tuple(array_of(mesh.vertices.data(), owner, vertices, 3),
                          array_of(mesh.faces->data(), owner, faces, 3),
                          has.colors ? array_of(mesh.colors.data(), owner, vertices, 3) : nb::none(),
                          has.places ? array_of(mesh.places.data(), owner, faces, 3, 2) : nb::none());
}

// The same of a mesh that the arrays alone keep.
nb::tuple arrays_of(Mesh&& mesh, Dress has) {
    auto* kept = new Mesh(std::move(mesh));
    const nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<Mesh*>(p); });
    return arrays_of(*kept, has, owner);
}

struct CoreSplats {
    size_t faces;  // of the mesh that they are on
    Splats found;
};

// A group of frames. It must not be changed any more once its frames were asked for.
class CoreGroup {
public:
    CoreGroup(const nb::bytes& data, size_t frames, Layers layers, StateOf previous, const Place& place, bool is_shown)
        : previous_(std::move(previous)),
          context_{frames, layers.value_or(kAllLayers), previous_.get(), placement_of(place), is_shown} {
        const mr_bytes bytes = bytes_of(data);
        alone([&] { made_ = continue_group(bytes, context_); });
    }

    StateOf state() const { return made_.state; }
    const Group& group() const { return made_.group; }
    double memory() const { return made_.group.memory(); }

    void paint(const nb::bytes& data) {
        const mr_bytes bytes = bytes_of(data);
        alone([&] { paint_group(bytes, context_, made_); });
        has_.colors = true;
    }

    void place(const Layout& layout) {
        Group& group = made_.group;
        require(layout.places->size() << 2 * group.levels == 2 * group.faces->size(), "an atlas of another mesh");
        alone([&] { group.places = places_of(layout, group.levels); });
        has_.places = true;
    }

    void turn(const std::array<double, 9>& rotation, const std::array<double, 3>& origin) {
        double rows[9];
        std::copy(rotation.begin(), rotation.end(), rows);
        Group& group = made_.group;
        turn_all(rows, origin.data(), group.positions.data(), group.positions.size());
        for (Mesh& mesh : group.added) turn_all(rows, origin.data(), mesh.vertices.data(), mesh.vertices.size());
    }

    // The arrays of each frame, which keep the group alive; those that frames share are one object.
    nb::list frames() {
        const Group& group = made_.group;
        const nb::object self = nb::find(*this);
        const nb::object same = nb::borrow(arrays_of(Mesh{{}, group.faces, {}, group.places}, has_));
        keep_faces();
        nb::list found;
        const int32_t* kept = kept_.data();
        for (size_t t = 0; t < group.frames; ++t) {
            const bool is_alone = group.vertices == 0 && !group.added.empty();
            const bool is_added = !group.added.empty() && !group.added[t].vertices.empty();
            if (is_alone) found.append(arrays_of(group.added[t], has_, self));
            else if (group.vertices == 0) found.append(same);
            else if (is_added || (lacks(t) && has_.places)) found.append(arrays_of(group.frame(t), has_));
            else found.append(shared(t, lacks(t) ? kept : nullptr, same, self));
            if (lacks(t)) kept += 3 * counts_[t];
        }
        return found;
    }

private:
    bool lacks(size_t t) const { return !counts_.empty() && 3 * counts_[t] < made_.group.faces->size(); }

    // The faces of each frame that lacks some, one frame's behind the other's.
    void keep_faces() {
        const Group& group = made_.group;
        if (group.dropped.empty()) return;
        const size_t count = group.faces->size() / 3;
        size_t all = count;  // room beyond the last: each frame's faces are written before it is known which stay
        counts_.resize(group.frames);
        for (size_t t = 0; t < group.frames; ++t) {
            const uint8_t* gone = group.dropped_in(t);
            counts_[t] = static_cast<size_t>(std::count(gone, gone + count, uint8_t{0}));
            if (lacks(t)) all += counts_[t];
        }
        kept_ = Block<int32_t>(3 * all);
        int32_t* to = kept_.data();
        for (size_t t = 0; t < group.frames; ++t)
            if (lacks(t)) to += 3 * mr_keep_faces(group.faces->data(), group.dropped_in(t), count, to);
    }

    // A frame without a mesh of its own; `same` are the arrays that frames share.
    nb::tuple shared(size_t t, const int32_t* kept, const nb::object& same, const nb::object& self) const {
        const Group& group = made_.group;
        const size_t first = 3 * group.vertices * t;
        return nb::make_tuple(array_of(group.positions.data() + first, self, group.vertices, 3),
                              kept ? array_of(kept, self, counts_[t], 3) : nb::object(same[1]),
                              has_.colors ? array_of(group.colors.data() + first, self, group.vertices, 3) : nb::none(),
                              nb::object(same[3]));
    }

    StateOf previous_;
    Context context_;
    Continued made_;
    Dress has_;
    Block<int32_t> kept_;
    std::vector<size_t> counts_;  // faces that each frame keeps; empty where all keep all
};

// A state of the background.
class CoreBackground {
public:
    CoreBackground(const nb::bytes& data, const CoreBackground* before, const Place& place)
        : has_{before && before->has_.colors, before && before->has_.places} {
        const mr_bytes bytes = bytes_of(data);
        alone([&] { made_ = decode_background(bytes, before ? &before->made_.mesh : nullptr, placement_of(place)); });
    }

    void paint(const nb::bytes& data) {
        const mr_bytes bytes = bytes_of(data);
        alone([&] { paint_background(bytes, made_); });
        has_.colors = true;
    }

    void place(const Layout& layout) {
        require(layout.places->size() == 2 * made_.mesh.faces->size(), "an atlas of another mesh");
        made_.mesh.places = places_of(layout, 0);
        has_.places = true;
    }

    nb::tuple arrays() const { return arrays_of(made_.mesh, has_, nb::find(*this)); }

private:
    Background made_;
    Dress has_;
};

Layout read_atlas(const nb::bytes& data, const nb::bytes& owner) {
    const mr_bytes atlas = bytes_of(data), of = bytes_of(owner);
    return alone([&] { return decode_atlas(atlas, base_mesh(of)); });
}

CoreSplats read_splats(const nb::bytes& data, const nb::bytes& owner) {
    const mr_bytes splats = bytes_of(data), of = bytes_of(owner);
    return alone([&] {
        const size_t faces = base_mesh(of).face_count();
        return CoreSplats{faces, decode_splats(splats, faces)};
    });
}

Out<double, 2> rows_of(const std::vector<double>& numbers, size_t width) {
    return Buffer<double>(numbers.data(), numbers.size()).shaped(numbers.size() / width, width);
}

// Means, axes, scales, opacities and colours in a frame; None where the group has another mesh.
nb::object bound(const CoreSplats& splats, const CoreGroup& of, size_t t, double unit) {
    const Group& group = of.group();
    expect(t < group.frames);
    if (group.faces->size() != 3 * splats.faces << 2 * group.levels) return nb::none();
    const Bound found = alone([&] { return bind_splats(splats.found.all, group, t, unit); });
    const size_t count = found.opacities.size();
    return nb::make_tuple(rows_of(found.means, 3), Buffer<double>(found.axes.data(), 9 * count).shaped(count, 3, 3),
                          rows_of(found.scales, 3), Buffer<double>(found.opacities.data(), count).shaped(count),
                          rows_of(found.colors, 3));
}

// FormatError of the decoder as that of Python.
void translate(const std::exception_ptr& thrown, void*) {
    try {
        std::rethrow_exception(thrown);
    } catch (const FormatError& error) {
        const nb::object type = nb::module_::import_("meshreel.errors").attr("FormatError");
        PyErr_SetString(type.ptr(), error.what());
    }
}

}  // namespace

void bind_decoder(nb::module_& m) {
    nb::register_exception_translator(translate, nullptr);
    nb::class_<State>(m, "GroupState")
        .def(
            "nbytes_beyond",
            [](const State& state, const State* before) { return static_cast<size_t>(state.memory_beyond(before)); },
            "before"_a.none())
        .def_prop_ro("levels", [](const State& state) { return state.scalars.size(); });
    nb::class_<Layout>(m, "AtlasLayout").def_ro("width", &Layout::width).def_ro("height", &Layout::height);
    nb::class_<CoreGroup>(m, "Group")
        .def(nb::init<const nb::bytes&, size_t, Layers, StateOf, const Place&, bool>(), "data"_a, "frames"_a,
             "layers"_a.none(), "previous"_a.none(), "place"_a, "shown"_a = true)
        .def_prop_ro("state", &CoreGroup::state)
        .def_prop_ro("nbytes", [](const CoreGroup& group) { return static_cast<size_t>(group.memory()); })
        .def_prop_ro("vertices", [](const CoreGroup& group) { return group.group().vertices; })
        .def("paint", &CoreGroup::paint, "data"_a)
        .def("place", &CoreGroup::place, "layout"_a)
        .def("turn", &CoreGroup::turn, "rotation"_a, "origin"_a)
        .def("frames", &CoreGroup::frames);
    nb::class_<CoreBackground>(m, "Background")
        .def(nb::init<const nb::bytes&, const CoreBackground*, const Place&>(), "data"_a, "before"_a.none(), "place"_a)
        .def("paint", &CoreBackground::paint, "data"_a)
        .def("place", &CoreBackground::place, "layout"_a)
        .def("arrays", &CoreBackground::arrays);
    nb::class_<CoreSplats>(m, "Splats").def("bind", &bound, "group"_a, "frame"_a, "unit"_a);
    m.def("read_atlas", &read_atlas, "data"_a, "owner"_a);
    m.def("read_splats", &read_splats, "data"_a, "owner"_a);
}

}  // namespace meshreel
