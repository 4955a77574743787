// Draco meshes before Draco sees them: the check of their claims, twice.
#include "meshreel/draco.h"

#include "input.h"

using namespace meshreel;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    std::vector<Bytes> meshes(in.u8() % 4);
    std::vector<mr_bytes> views;
    for (Bytes& mesh : meshes) mesh = in.bytes();
    for (const Bytes& mesh : meshes) views.push_back({mesh.data(), mesh.size()});
    const int status = mr_check_draco(views.data(), views.size());
    LAW(mr_check_draco(views.data(), views.size()) == status);
    return 0;
}
