// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <regex>
#include <string>
#include <vector>

#include "device/argument_type.hpp"
#include "device/buffer.hpp"
#include "device/context.hpp"
#include "device/kernel_sources.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;

namespace {

// What docs/architecture.md promises.
constexpr std::size_t kMostArguments = 20;

// A kernel with an argument of every sort.
const char* const kSorts =
    "typedef struct { float a; float b[15]; } RsAdam;\n"
    "typedef float4 fv;\n"
    "__kernel void sorts(__global fv* vectors, const int number, const uint word,\n"
    "                    const float4 four, const RsAdam record, __global RsAdam* records,\n"
    "                    __global const float8* rays, __local float* room) {\n"
    "  vectors[0] = four + number + word + record.a + records[0].a + rays[0].s0 + room[0];\n"
    "}\n";

struct RayWords {
  float numbers[6];
  std::uint32_t words[2];
};

struct SortsFolder : TemporaryDirectory {
  SortsFolder() { write("sorts.cl", kSorts); }
};

ContextOptions uncached() {
  ContextOptions options;
  options.kernel_cache = false;
  return options;
}

struct Sorts {
  SortsFolder folder;
  ScopedVariable kernels{"RAYSPLATS_KERNEL_DIR", folder.path().string()};
  ScopedVariable checked{"RAYSPLATS_CHECK_ARGUMENTS", "1"};
  Context context{test_device(), uncached()};
  Kernel kernel = context.kernel("sorts.cl", "sorts");
  Buffer<float> vectors{context, 8, "vectors"};
  Buffer<std::int32_t> integers{context, 8, "integers"};
  Buffer<RsAdam> records{context, 2, "records"};
  Buffer<RsPath> paths{context, 2, "paths"};
  Buffer<RayWords> rays{context, 2, "rays"};
  std::array<float, 4> four{};
  LocalMemory room{16};

  // What the launch of no work-items says of its arguments; "" when they are right.
  template <class... Arguments>
  std::string fault(const Arguments&... arguments) {
    return test::message_of<DeviceError>([&] { kernel.launch(Range::linear(0, 1), arguments...); });
  }
};

// Kernels of a program with all that it includes.
std::vector<std::string> kernel_names(const std::string& path) {
  const std::string& source = kernel_sources().at(path);
  static const std::regex kKernel("__kernel\\s+void\\s+(\\w+)\\s*\\(");
  std::vector<std::string> out;
  for (std::sregex_iterator at(source.begin(), source.end(), kKernel), end; at != end; ++at) {
    const std::string name = (*at)[1];
    if (std::find(out.begin(), out.end(), name) == out.end()) out.push_back(name);
  }
  return out;
}

}  // namespace

TEST_CASE("arguments: launches are compared with what the kernel declares") {
  Sorts s;
  const RsAdam record{};
  CHECK(s.fault(s.vectors, 1, 2u, s.four, record, s.records, s.rays, s.room) == "");
  const auto pack = argument_pack(s.vectors, 1, 2u);
  CHECK(s.fault(pack, s.four, argument_pack(record, s.records), s.rays, s.room) == "");

  const auto wrong = [&](const std::string& fault, int argument, const std::string& what) {
    CAPTURE(fault);
    CHECK(contains(fault, fmt::format("Argument {} of kernel sorts", argument)));
    CHECK(contains(fault, what));
  };
  wrong(s.fault(s.integers, 1, 2u, s.four, record, s.records, s.rays, s.room), 0, "fv");
  wrong(s.fault(s.vectors, 1u, 2u, s.four, record, s.records, s.rays, s.room), 1, "is int");
  wrong(s.fault(s.vectors, 1, 2.0f, s.four, record, s.records, s.rays, s.room), 2, "is uint");
  wrong(s.fault(s.vectors, 1, 2u, std::array<float, 2>{}, record, s.records, s.rays, s.room), 3,
        "16 bytes in the kernel and 8 in the launch");
  wrong(s.fault(s.vectors, 1, 2u, s.four, RsTexture{}, s.records, s.rays, s.room), 4, "RsTexture");
  wrong(s.fault(s.vectors, 1, 2u, s.four, record, s.paths, s.rays, s.room), 5, "RsPath");
  wrong(s.fault(s.vectors, 1, 2u, s.four, record, record, s.rays, s.room), 5, "a buffer");
  wrong(s.fault(s.vectors, 1, 2u, s.four, record, s.records, s.records, s.room), 6, "RsAdam");
  wrong(s.fault(s.vectors, 1, 2u, s.four, record, s.records, s.rays, s.vectors), 7, "local memory");
  CHECK(contains(s.fault(argument_pack(s.vectors, 1), 2u), "takes 8 arguments, 3 were given"));
}

TEST_CASE("arguments: no kernel takes more than can be read") {
  Context context(test_device());
  std::size_t most = 0, kernels = 0;
  for (const auto& [path, source] : kernel_sources()) {
    if (path.size() < 3 || path.compare(path.size() - 3, 3, ".cl") != 0) continue;
    BuildOptions build;
    if (path.find("group_") != std::string::npos) build.define("LANES", 1).define("GROUP", 32);
    for (const std::string& name : kernel_names(path)) {
      CAPTURE(name);
      const std::size_t count = context.kernel(path, name, build).argument_count();
      CHECK(count <= kMostArguments);
      most = std::max(most, count);
      ++kernels;
    }
  }
  MESSAGE(kernels << " kernels take at most " << most << " arguments");
  CHECK(kernels >= 70);
}
