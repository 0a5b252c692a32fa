// SPDX-License-Identifier: Apache-2.0
#include "shared/layout.h"

#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"

using namespace raysplats;

TEST_CASE("shared records: sizes and offsets agree between the compilers") {
  // In the order of cl/primitives/layout_probe.cl.
  const std::vector<std::size_t> expected{sizeof(RsAabb),
                                          offsetof(RsAabb, lo),
                                          offsetof(RsAabb, hi),
                                          sizeof(RsLine),
                                          offsetof(RsLine, v),
                                          sizeof(RsViewBounds),
                                          offsetof(RsViewBounds, x0),
                                          offsetof(RsViewBounds, y0),
                                          offsetof(RsViewBounds, x1),
                                          offsetof(RsViewBounds, y1),
                                          offsetof(RsViewBounds, depth),
                                          offsetof(RsViewBounds, quantile),
                                          offsetof(RsViewBounds, kind),
                                          offsetof(RsViewBounds, padding),
                                          sizeof(RsCamera),
                                          offsetof(RsCamera, rotation),
                                          offsetof(RsCamera, center),
                                          offsetof(RsCamera, fx),
                                          offsetof(RsCamera, fy),
                                          offsetof(RsCamera, cx),
                                          offsetof(RsCamera, cy),
                                          offsetof(RsCamera, width),
                                          offsetof(RsCamera, height),
                                          offsetof(RsCamera, near_depth),
                                          offsetof(RsCamera, padding),
                                          sizeof(RsFootprintView),
                                          offsetof(RsFootprintView, rotation),
                                          offsetof(RsFootprintView, center),
                                          offsetof(RsFootprintView, low),
                                          offsetof(RsFootprintView, high),
                                          offsetof(RsFootprintView, spacing),
                                          offsetof(RsFootprintView, kind),
                                          offsetof(RsFootprintView, padding),
                                          sizeof(RsLensCamera),
                                          offsetof(RsLensCamera, rotation),
                                          offsetof(RsLensCamera, center),
                                          offsetof(RsLensCamera, fx),
                                          offsetof(RsLensCamera, fy),
                                          offsetof(RsLensCamera, cx),
                                          offsetof(RsLensCamera, cy),
                                          offsetof(RsLensCamera, k1),
                                          offsetof(RsLensCamera, k2),
                                          offsetof(RsLensCamera, k3),
                                          offsetof(RsLensCamera, k4),
                                          offsetof(RsLensCamera, p1),
                                          offsetof(RsLensCamera, p2),
                                          offsetof(RsLensCamera, limit),
                                          offsetof(RsLensCamera, image_limit),
                                          offsetof(RsLensCamera, aperture),
                                          offsetof(RsLensCamera, focus_distance),
                                          offsetof(RsLensCamera, width),
                                          offsetof(RsLensCamera, height),
                                          offsetof(RsLensCamera, jitter),
                                          offsetof(RsLensCamera, sample),
                                          offsetof(RsLensCamera, seed_lo),
                                          offsetof(RsLensCamera, seed_hi),
                                          sizeof(RsLensTile),
                                          offsetof(RsLensTile, x0),
                                          offsetof(RsLensTile, y0),
                                          offsetof(RsLensTile, x1),
                                          offsetof(RsLensTile, y1),
                                          offsetof(RsLensTile, face),
                                          offsetof(RsLensTile, cosine),
                                          offsetof(RsLensTile, padding)};
  Context context(select_device(""));
  Buffer<std::uint32_t> layout(context, 256, "layout");
  layout.clear();
  context.kernel("primitives/layout_probe.cl", "layout_probe").launch(Range{}, layout);
  const std::vector<std::uint32_t> found = layout.download();
  REQUIRE(found[0] == expected.size() + 1);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CAPTURE(i);
    CHECK(found[i + 1] == expected[i]);
  }
}
