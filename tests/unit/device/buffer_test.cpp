// SPDX-License-Identifier: Apache-2.0
#include "device/buffer.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <memory>
#include <type_traits>
#include <vector>

#include "device/context.hpp"
#include "device/fault_injection.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

TEST_CASE("buffer: content survives the way to the device and back") {
  Context context(test_device());
  Buffer<float> a(context, 5, "a");
  a.upload(std::vector<float>{1, 2, 3, 4, 5});
  a.upload(std::vector<float>{9, 8}, 2);
  CHECK(a.download() == std::vector<float>{1, 2, 9, 8, 5});
  CHECK(a.read(4) == 5.0f);
  Buffer<float> b(context, 4, "b");
  b.clear();
  b.copy_from(a, 2, 2, 1);
  CHECK(b.download() == std::vector<float>{0, 9, 8, 0});
  std::vector<float> part(2);
  a.download(part, 3);
  CHECK(part == std::vector<float>{8, 5});
}

TEST_CASE("buffer: empty and growing buffers") {
  Context context(test_device());
  Buffer<std::uint32_t> buffer(context, 0, "none");
  CHECK(buffer.size() == 0);
  CHECK(buffer.download().empty());
  buffer.clear();
  buffer.upload({});
  buffer.ensure(context, 100, "more");
  CHECK(buffer.size() == 100);
  const std::size_t bytes = buffer.raw().bytes();
  buffer.ensure(context, 10, "less");  // keeps its memory
  CHECK(buffer.size() == 10);
  CHECK(buffer.raw().bytes() == bytes);
}

TEST_CASE("buffer: where it cannot grow it is empty, and may grow later") {
  Context context(test_device());
  Buffer<std::uint32_t> buffer(context, 10, "small");
  context.faults().arm(Fault::kAllocation, 1);
  CHECK_THROWS_AS(buffer.ensure(context, 100, "more"), ResourceError);
  CHECK(buffer.size() == 0);
  CHECK(buffer.raw().empty());
  CHECK(context.allocated_bytes() == 0);
  buffer.ensure(context, 5, "again");
  CHECK(buffer.size() == 5);
  CHECK(buffer.download().size() == 5);
}

TEST_CASE("buffer: memory is counted while it lives") {
  Context context(test_device());
  CHECK(context.allocated_bytes() == 0);
  {
    Buffer<std::uint32_t> a(context, 1000, "a");
    Buffer<std::uint32_t> b = std::move(a);
    CHECK(context.allocated_bytes() == 4000);
    Buffer<std::uint32_t> c(context, 500, "c");
    CHECK(context.allocated_bytes() == 6000);
    b.ensure(context, 2000, "b");
    CHECK(context.allocated_bytes() == 10000);
  }
  CHECK(context.allocated_bytes() == 0);
  CHECK(context.peak_allocated_bytes() == 10000);
}

TEST_CASE("buffer: cannot be copied by accident, and may outlive its context") {
  CHECK_FALSE(std::is_copy_constructible_v<Buffer<float>>);
  CHECK_FALSE(std::is_copy_assignable_v<Buffer<float>>);
  CHECK(std::is_nothrow_move_constructible_v<Buffer<float>>);
  auto context = std::make_unique<Context>(test_device());
  Buffer<float> buffer(*context, 10, "late");
  context.reset();
}

TEST_CASE("buffer: sizes over the device's limit are refused with the label") {
  Context context(test_device());
  const std::size_t limit = context.device().max_allocation;
  for (const std::size_t size : {limit / 4 + 1, std::numeric_limits<std::size_t>::max() / 4,
                                 std::numeric_limits<std::size_t>::max() / 2 + 3}) {
    try {
      const Buffer<float> buffer(context, size, "hit lists");
      FAIL("not refused");
    } catch (const ResourceError& error) {
      CHECK(std::string(error.what()).find("hit lists") != std::string::npos);
      CHECK(error.exit_code() == 5);
    }
  }
  CHECK(context.allocated_bytes() == 0);
}

TEST_CASE("buffer: accesses outside are errors, not crashes") {
  Context context(test_device());
  Buffer<float> buffer(context, 4, "small");
  CHECK_THROWS_AS(buffer.read(4), DeviceError);
  CHECK_THROWS_AS(buffer.upload(std::vector<float>(5)), DeviceError);
  CHECK_THROWS_AS(buffer.copy_from(buffer, 8), DeviceError);
  Buffer<float> none;
  CHECK_THROWS_AS(none.upload(std::vector<float>(1)), DeviceError);
  CHECK_THROWS_AS(none.read(0), DeviceError);
  CHECK_THROWS_AS(buffer.copy_from(none, 1), DeviceError);
}
