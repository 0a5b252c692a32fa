// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/data_option_table.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

using namespace raysplats;

TEST_CASE("what is given of a data set goes over what was there, and nothing else does") {
  DatasetOptions base;
  base.downscale = 3;
  base.test_every = 5;
  base.masks = MaskUse::kCutout;
  base.origin = {1, 2, 3};
  DataSettings settings;
  settings.set("downscale", {"1.5"});
  settings.set("undistort", {"false"});
  CHECK(settings.has("downscale"));
  CHECK_FALSE(settings.has("masks"));
  DatasetOptions got = settings.over(base);
  CHECK(got.downscale == 1.5);
  CHECK_FALSE(got.undistort);
  CHECK(got.test_every == 5);
  CHECK(got.masks == MaskUse::kCutout);
  CHECK(got.origin == base.origin);
  settings.set("masks", {"ignore"});
  settings.set("origin", {"auto"});
  settings.set("test-every", {"1_000"});
  got = settings.over(base);
  CHECK(got.masks == MaskUse::kIgnore);
  CHECK_FALSE(got.origin.has_value());
  CHECK(got.test_every == 1000);
}

TEST_CASE("options of data sets refuse in one sentence what they do not accept") {
  const auto refusal = [](const std::string& name, const std::vector<std::string>& values) {
    DataSettings settings;
    try {
      settings.set(name, values);
    } catch (const UsageError& error) {
      CHECK_FALSE(settings.has(name));
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(refusal("downscale", {"0.5"}) ==
        "The option 'downscale' needs a number from 1 to 1024, not '0.5'");
  CHECK(refusal("test-every", {"-1"}).find("a whole number from 0") != std::string::npos);
  CHECK(refusal("masks", {"white"}) == "The option 'masks' is ignore or cutout, not 'white'");
  CHECK(refusal("origin", {"1,2"}).find("three numbers") != std::string::npos);
  CHECK(refusal("origin", {"1e30,0,0"}).find("a number from") != std::string::npos);
  CHECK(refusal("downscales", {"2"}).find("no option") != std::string::npos);
}

TEST_CASE("rows of data sets say what they hold as TOML, and read it again") {
  DatasetOptions options;
  options.downscale = 2.5;
  options.undistort = false;
  options.origin = {1, -2, 0.5};
  DatasetOptions again;
  const std::vector<OptionRow> from = data_option_rows(options), to = data_option_rows(again);
  REQUIRE(from.size() == to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    std::string text = from[i].text();
    if (text.front() == '"') text = text.substr(1, text.size() - 2);
    to[i].set({text});
    CHECK(to[i].text() == from[i].text());
  }
  CHECK(again.origin == options.origin);
}
