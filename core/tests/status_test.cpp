#include <cstring>
#include <set>
#include <string>

#include "check.h"
#include "shapes.h"

TEST(each_status_has_words_of_its_own_and_an_unknown_one_has_words_too) {
    std::set<std::string> words;
    int status = MR_OK;
    for (; std::strcmp(mr_message(status), mr_message(-1)) != 0; ++status) words.insert(mr_message(status));
    CHECK(status > MR_NOT_FINITE && words.size() == static_cast<size_t>(status));
}
