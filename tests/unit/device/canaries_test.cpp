// SPDX-License-Identifier: Apache-2.0
#include "device/canaries.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

const char* const kStray =
    "__kernel void stray(__global uchar* data, int at) { data[at] = 7; }\n"
    "__kernel void whole(__global uchar* data) { data[get_global_id(0)] = 1; }\n";

// A context with canaries whose kernels may write anywhere.
struct Fixture {
  TemporaryDirectory folder;
  ScopedVariable kernels{"RAYSPLATS_KERNEL_DIR", folder.path().string()};
  ScopedVariable canaries{"RAYSPLATS_CANARY", "1"};
  Context context;
  Fixture() : context(test_device(), options(folder)) {}

  static ContextOptions options(const TemporaryDirectory& folder) {
    folder.write("stray.cl", kStray);
    ContextOptions options;
    options.kernel_cache = false;
    return options;
  }
  // what() after writing byte `at` of `buffer`.
  std::string write_at(Buffer<unsigned char>& buffer, int at) {
    try {
      context.kernel("stray.cl", "stray").launch(Range{}, buffer, at);
    } catch (const DeviceError& error) {
      return error.what();
    }
    return "";
  }
};

}  // namespace

TEST_CASE("canaries: a kernel that keeps inside its buffers passes") {
  Fixture f;
  Buffer<unsigned char> other(f.context, 3, "other");
  Buffer<unsigned char> buffer(f.context, 37, "bytes");
  f.context.kernel("stray.cl", "whole").launch(Range{{37, 1, 1}}, buffer);
  CHECK(buffer.download() == std::vector<unsigned char>(37, 1));
  CHECK(f.write_at(buffer, 36).empty());
  f.context.finish();
}

TEST_CASE("canaries: a write outside names the kernel, the buffer and the place") {
  Fixture f;
  {
    Buffer<unsigned char> buffer(f.context, 37, "bytes");
    const std::string message = f.write_at(buffer, 37);
    CHECK(message.find("Kernel stray of stray.cl wrote 1 bytes behind the buffer 'bytes'") !=
          std::string::npos);
  }
  // The broken canary goes with its buffer.
  Buffer<unsigned char> buffer(f.context, 100, "more");
  CHECK(f.write_at(buffer, 99).empty());
  CHECK(f.write_at(buffer, -3).find("wrote 3 bytes before the buffer 'more'") != std::string::npos);
}

TEST_CASE("canaries: memory that nobody has written is NaN") {
  Fixture f;
  Buffer<float> buffer(f.context, 5, "unset");
  buffer.upload(std::vector<float>{1.0f}, 2);
  const std::vector<float> values = buffer.download();
  for (std::size_t i = 0; i < values.size(); ++i) CHECK(std::isnan(values[i]) == (i != 2));
}

TEST_CASE("canaries: the variable is 0 or 1") {
  const ScopedVariable on("RAYSPLATS_CANARY", "yes");
  CHECK_THROWS_AS(Context{test_device()}, UsageError);
  const ScopedVariable off("RAYSPLATS_CANARY", "0");
  CHECK(Canaries::from_environment() == nullptr);
}
