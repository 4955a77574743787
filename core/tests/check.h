// Tests are functions with a sentence as their name: TEST(what_is_true) { CHECK(...); }
#pragma once

#include <cstdio>
#include <vector>

struct Test {
    const char *file, *name;
    void (*run)();
};

inline std::vector<Test>& all_tests() {
    static std::vector<Test> tests;
    return tests;
}

inline int& failures() {
    static int count = 0;
    return count;
}

struct Registration {
    Registration(const char* file, const char* name, void (*run)()) { all_tests().push_back({file, name, run}); }
};

#define TEST(name)                                                        \
    static void name();                                                   \
    static const Registration registration_##name(__FILE__, #name, name); \
    static void name()

#define CHECK(holds)                                                               \
    do {                                                                           \
        if (holds) break;                                                          \
        std::fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #holds); \
        ++failures();                                                              \
    } while (false)
