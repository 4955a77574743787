// A CodedField record over a graph (form LAYERS), decoded twice.
#include "input.h"

using namespace meshreel;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Links links = links_of(in);
    const size_t width = in.u8() % 12;
    const size_t head = in.u8() % 12;
    Bytes record;
    put_field(in, links.view(), width, head, record);
    if (in.u8() == 255) record = in.bytes();
    const mr_bytes bytes{record.data(), record.size()};
    const mr_graph graph = links.view();
    std::vector<double> rows(graph.count * width), again(graph.count * width);
    const int status = mr_decode_field(&bytes, &graph, width, head, rows.data());
    LAW(mr_decode_field(&bytes, &graph, width, head, again.data()) == status);
    if (status == MR_OK) LAW(are_same(rows, again));
    return 0;
}
