// Side data: anchors, bases, runs of dropped faces. A stream that decodes is the one that its values encode to.
#include "input.h"

using namespace meshreel;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const uint32_t claimed = in.u16();
    const bool is_too_many = claimed > 65000;
    const size_t count = is_too_many ? 250000 : claimed % 120;
    Bytes stream = stream_of(in, count, encoded_integers);
    if (is_too_many && stream.size() > 6) stream.resize(6);  // cannot be so many
    std::vector<int32_t> values(is_too_many ? 1 : count);    // nothing is written for too many
    const int status = mr_decode_integers(stream.data(), stream.size(), count, values.data());
    LAW(status == MR_OK || status == MR_BAD_STREAM);
    LAW(mr_message(static_cast<int>(claimed % 40))[0] != 0);
    if (status == MR_OK) LAW(encoded_integers(values) == stream);
    return 0;
}
