// SPDX-License-Identifier: Apache-2.0
#include "util/number_text.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

using namespace raysplats;

using Words = std::vector<std::string>;

TEST_CASE("numbers are read in the spellings of TOML and of shells") {
  CHECK(parse_whole("1_000") == 1000);
  CHECK(parse_whole("1e4") == 10000);
  CHECK(parse_whole("+7") == 7);
  CHECK(parse_whole("-7") == -7);
  CHECK(parse_whole("28k") == 28000);
  CHECK(parse_whole("-2k") == -2000);
  CHECK(parse_natural("0.29M") == 290000u);  // which the product of the doubles is not
  CHECK(parse_natural("1_0k") == 10000u);
  CHECK(parse_natural("18446744073709551615") == 18446744073709551615u);
  CHECK(parse_real("1_0.5") == 10.5);
  for (const char* text : {"", "1.5", "1e-1", "7x", "_1", "1__0", "nan", "1e40", "+-1",
                           "9223372036854775808", "k", "1.2345k", "0.1k1", "1kM", "1K", "1e12M"}) {
    INFO(text);
    CHECK_FALSE(parse_whole(text));
  }
  CHECK_FALSE(parse_natural("-1"));
  CHECK_FALSE(parse_natural("18446744073709551616"));
  for (const char* text : {"inf", "nan", "", "1,5", "0x"}) CHECK_FALSE(parse_real(text));
}

TEST_CASE("a number of things is one thing or several") {
  CHECK(counted(0, "photo") == "0 photos");
  CHECK(counted(1, "photo") == "1 photo");
  CHECK(counted(2, "photo") == "2 photos");
  CHECK(counted(1, "mesh", "meshes") == "1 mesh");
  CHECK(counted(2, "mesh", "meshes") == "2 meshes");
}

TEST_CASE("every spelling of a list gives the same items") {
  const Words expected{"5", "10", "15"};
  for (const Words& values :
       {Words{"5", "10", "15"}, Words{"5,10,15"}, Words{"5, 10, 15"}, Words{"[5,10,15]"},
        Words{"[5, 10, 15]"}, Words{"=[5, 10, 15]"}, Words{"[5,", "10,", "15]"},
        Words{"5", "[10, 15]"}, Words{"[ 5 , 10 , 15 , ]"}, Words{"5 10 15"},
        Words{"\"5\"", "'10', 15"}, Words{"=5", "10", "15"}, Words{"5,", "10", ",15"}}) {
    CHECK(list_items(values) == expected);
  }
  for (const Words& values : {Words{}, Words{""}, Words{"[]"}, Words{"[ ]"}, Words{"="}}) {
    REQUIRE(list_items(values));
    CHECK(list_items(values)->empty());
  }
  for (const char* text : {"[5", "5]", "5,,10", ",5", "[[5]]", "][", "[,]", "'5"}) {
    INFO(text);
    CHECK_FALSE(list_items({text}));
  }
}

TEST_CASE("words that belong to a list of numbers are told from others") {
  for (const char* word : {"5", "[5,", "10]", "=[300,", "[]", "-1", "+1", ".5", "-.5", "1e-3,2",
                           "100k", "1_000", "0.4,0.8", "4:0.1,2:0.4", ","}) {
    INFO(word);
    CHECK(is_number_list_part(word));
  }
  for (const char* word : {"", "data", "-o", "--eval-at", "-q", "5x", "e5", "runs/5", "-", ".",
                           "2024-05-01", "1.2.3", "4:"}) {
    INFO(word);
    CHECK_FALSE(is_number_list_part(word));
  }
}

TEST_CASE("ranges are told in words") {
  CHECK(number_words(true, 1, 1000) == "a whole number from 1 to 1000");
  CHECK(number_words(false, 0, 0.9999999) == "a number from 0 to 0.9999999");
  CHECK(number_words(false, 0, kNoBound) == "a number of at least 0");
  CHECK(number_words(false, -kNoBound, kNoBound) == "a number");
}
