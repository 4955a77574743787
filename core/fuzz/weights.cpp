// Columns of quantised weights (form LAPLACIAN). Streams that decode are those that their symbols encode to.
#include "input.h"

using namespace meshreel;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Links links = links_of(in);
    const size_t columns = in.u8() % 4;
    std::vector<size_t> sizes(columns);
    std::vector<int32_t> symbols(columns * links.count());
    const mr_weights weights = weights_of(symbols, columns, links.view());
    const auto encode = [&](std::vector<int32_t>& numbers) {
        const mr_weights given = weights_of(numbers, columns, links.view());
        Bytes made(8 * numbers.size() + 64);
        size_t total = 0;
        if (mr_encode_weights(&given, made.data(), made.size(), sizes.data()) != MR_OK) sizes.assign(columns, 0);
        for (size_t each : sizes) total += each;
        made.resize(total);
        return made;
    };
    Bytes streams = stream_of(in, symbols.size(), encode);
    if (in.u8() % 2 == 1)
        for (size_t& each : sizes) each = in.u16();
    size_t left = streams.size();
    for (size_t& each : sizes) left -= each = each < left ? each : left;
    size_t failed = 0;
    const int status = mr_decode_weights(&weights, streams.data(), sizes.data(), &failed);
    LAW(status == MR_OK || status == MR_NOT_CAUSAL || (status == MR_BAD_STREAM && failed < columns));
    if (status != MR_OK) return 0;
    streams.resize(streams.size() - left);
    const std::vector<size_t> given = sizes;
    LAW(encode(symbols) == streams && given == sizes);
    return 0;
}
