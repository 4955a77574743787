// Runs the tests of the file that the argument names, or all of them.
#include <cstring>

#include "check.h"

int main(int count, char** arguments) {
    int run = 0;
    for (const Test& test : all_tests()) {
        if (count > 1 && !std::strstr(test.file, arguments[1])) continue;
        const int before = failures();
        test.run();
        if (failures() > before) std::fprintf(stderr, "failed: %s\n", test.name);
        ++run;
    }
    std::printf("%d tests, %d checks failed\n", run, failures());
    return run == 0 || failures() > 0;
}
