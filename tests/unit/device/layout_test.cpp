// SPDX-License-Identifier: Apache-2.0
#include "shared/records.h"

#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

TEST_CASE("shared records: sizes and offsets agree between the compilers") {
#define RS_SIZE_OF(type) sizeof(type),
#define RS_OFFSET_OF(type, field) offsetof(type, field),
  const std::vector<std::size_t> expected{RS_RECORDS(RS_SIZE_OF, RS_OFFSET_OF)};
  Context context(test_device());
  Buffer<std::uint32_t> layout(context, 256, "layout");
  layout.clear();
  context.kernel("parallel/layout_probe.cl", "layout_probe").launch(Range{}, layout);
  const std::vector<std::uint32_t> found = layout.download();
  REQUIRE(expected.size() < layout.size());
  REQUIRE(found[0] == expected.size() + 1);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CAPTURE(i);
    CHECK(found[i + 1] == expected[i]);
  }
}
