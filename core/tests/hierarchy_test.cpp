#include "check.h"
#include "shapes.h"

TEST(each_vertex_has_one_place_and_is_predicted_by_places_before_it) {
    for (const Shape& shape : {tetrahedron(), sheet(9, 0.1), Shape{{0, 0, 0, 1, 1, 1}, {}}, Shape{}}) {
        const mr_mesh mesh = shape.view();
        mr_hierarchy* hierarchy = nullptr;
        CHECK(mr_hierarchy_create(&mesh, &hierarchy) == MR_OK);
        const mr_graph graph = mr_hierarchy_graph(hierarchy);
        CHECK(graph.count == shape.vertices());
        std::vector<int> seen(graph.count);
        for (size_t v = 0; v < graph.count; ++v) ++seen[static_cast<size_t>(mr_hierarchy_order(hierarchy)[v])];
        for (size_t v = 0; v < graph.count; ++v) {
            double sum = 0;
            CHECK(seen[v] == 1);
            for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k) {
                CHECK(graph.near[k] >= 0 && static_cast<size_t>(graph.near[k]) < v);
                sum += graph.weights[k];
            }
            CHECK(v == 0 || std::fabs(sum - 1) < 1e-12);
        }
        mr_hierarchy_destroy(hierarchy);
    }
}

TEST(vertices_in_one_place_are_predicted_by_finite_weights) {
    Shape shape = sheet(6);
    shape.positions.assign(shape.positions.size(), 2.0);
    const mr_mesh mesh = shape.view();
    mr_hierarchy* hierarchy = nullptr;
    CHECK(mr_hierarchy_create(&mesh, &hierarchy) == MR_OK);
    const mr_graph graph = mr_hierarchy_graph(hierarchy);
    for (int64_t k = 0; k < graph.starts[graph.count]; ++k) CHECK(std::isfinite(graph.weights[k]));
    mr_hierarchy_destroy(hierarchy);
}

TEST(faces_that_name_no_vertex_make_no_hierarchy) {
    Shape shape = tetrahedron();
    for (int32_t corner : {-1, 4}) {
        shape.faces[0] = corner;
        const mr_mesh mesh = shape.view();
        mr_hierarchy* hierarchy = nullptr;
        CHECK(mr_hierarchy_create(&mesh, &hierarchy) == MR_BAD_INPUT && !hierarchy);
    }
}
