// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

using Names = std::vector<std::string>;

/// An EXR of one pixel whose channels hold 1, 2, ...
fs::path write_channels(const fs::path& path, const Names& names) {
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  OIIO::ImageSpec spec(1, 1, static_cast<int>(names.size()), OIIO::TypeFloat);
  spec.channelnames = names;
  std::vector<float> numbers;
  for (std::size_t i = 0; i < names.size(); ++i) numbers.push_back(static_cast<float>(i + 1));
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(OIIO::TypeFloat, numbers.data()));
  REQUIRE(output->close());
  return path;
}

}  // namespace

TEST_CASE("colours of an EXR are those without a layer, or of one layer by their suffixes") {
  const Scratch scratch;
  const auto read = [&](const Names& names) {
    return read_image(write_channels(scratch / "a.exr", names)).data;
  };
  using Numbers = std::vector<float>;
  CHECK(read({"beauty.R", "beauty.G", "beauty.B"}) == Numbers{1, 2, 3});
  CHECK(read({"ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B",
              "ViewLayer.Combined.A", "ViewLayer.Depth.Z"}) == Numbers{1, 2, 3, 4});
  // Colours without a layer come first, then what is called Combined, then the first layer.
  CHECK(read({"a.R", "a.G", "a.B", "R", "G", "B"}) == Numbers{4, 5, 6});
  CHECK(read({"a.R", "a.G", "a.B", "a.A", "Y"}) == Numbers{5});
  CHECK(read({"L.AO.R", "L.AO.G", "L.AO.B", "L.Combined.R", "L.Combined.G", "L.Combined.B"}) ==
        Numbers{4, 5, 6});
  CHECK(read({"b.R", "b.G", "b.B", "a.R", "a.G", "a.B", "a.Z", "A.R"}) == Numbers{4, 5, 6});
  // Depth maps are channels alone, whatever their names.
  for (const char* name : {"Z", "Y", "R", "A", "ViewLayer.Depth.Z", "depth"}) {
    CAPTURE(name);
    CHECK(read({name}) == Numbers{1});
  }
  CHECK(read({"Y", "A"}) == Numbers{1, 2});
  CHECK(read({"R", "A"}) == Numbers{1, 2});
}

TEST_CASE("an EXR without colours is refused by the names of its channels") {
  const Scratch scratch;
  const auto refusal = [&](const Names& names) {
    const fs::path path = write_channels(scratch / "a.exr", names);
    return data_error([&] { read_image(path); });
  };
  CHECK(contains(refusal({"N.X", "N.Y", "N.Z"}),
                 "a.exr has the channels N.X, N.Y, N.Z and no colours"));
  // Neither colours as brightness and differences nor two of three are grey.
  CHECK(contains(refusal({"Y", "RY", "BY"}), "channels BY, RY, Y and no colours"));
  CHECK(contains(refusal({"R", "G"}), "channels G, R and no colours"));
  CHECK(contains(refusal({"R", "B", "A"}), "channels A, B, R and no colours"));
  CHECK(contains(refusal({"R", "G", "Y"}), "channels G, R, Y and no colours"));
  CHECK(contains(refusal({"a.R", "a.G", "b.B"}), "a.R, a.G, b.B") == false);  // in their order
  CHECK(contains(refusal({"a.R", "a.G", "b.B"}), "channels a.G, a.R, b.B and no colours"));
  Names many;
  for (int i = 0; i < 9; ++i) many.push_back("crypto.0" + std::to_string(i));
  CHECK(contains(refusal(many), "crypto.07 and 1 more and no colours"));
}
