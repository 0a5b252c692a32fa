// SPDX-License-Identifier: Apache-2.0
#include "device/program_builder.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <filesystem>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "build_paths.hpp"
#include "device/buffer.hpp"
#include "device/context.hpp"
#include "device/program_cache.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr int kPrograms = 6;

const char* const kScale =
    "__kernel void scale(__global int* data) { data[get_global_id(0)] *= RS_FACTOR; }\n";

std::vector<Kernel> scales(Context& context) {
  std::vector<Kernel> kernels;
  for (int factor = 1; factor <= kPrograms; ++factor) {
    kernels.push_back(
        context.kernel("scale.cl", "scale", BuildOptions().define("RS_FACTOR", factor)));
  }
  return kernels;
}

// 1 through all of them, the last first.
std::int32_t product(Context& context, std::vector<Kernel>& kernels) {
  Buffer<std::int32_t> data(context, 1, "data");
  data.fill(1);
  for (auto kernel = kernels.rbegin(); kernel != kernels.rend(); ++kernel)
    kernel->launch(Range{{1, 1, 1}, {1, 1, 1}, {}}, data);
  return data.read(0);
}

class Folder {
 public:
  Folder() {
    folder_.write("kernels/scale.cl", kScale);
    options.compilers = 3;
    options.cache_directory = (folder_.path() / "cache").string();
    options.compiling = [this](std::size_t number, const std::string& program) {
      told.emplace_back(number, program);
    };
  }
  std::size_t cached() const { return program_cache_state(options.cache_directory).programs; }
  // A program for ContextOptions::compiler.
  fs::path script(const std::string& lines) {
    fs::path path = folder_.path() / "compiler";
    folder_.write("compiler", "#!/bin/sh\n" + lines + "\n");
    fs::permissions(path, fs::perms::owner_all);
    return path;
  }
  fs::path path() const { return folder_.path(); }

  ContextOptions options;
  std::vector<std::pair<std::size_t, std::string>> told;

 private:
  TemporaryDirectory folder_;
  ScopedVariable kernels_{"RAYSPLATS_KERNEL_DIR", (folder_.path() / "kernels").string()};
};

}  // namespace

TEST_CASE("programs: those asked for together are made, told of and kept, each once") {
  Folder folder;
  Context context(test_device(), folder.options);
  std::vector<Kernel> kernels = scales(context);
  CHECK(folder.told.empty());  // nobody has waited
  CHECK(product(context, kernels) == 720);
  REQUIRE(folder.told.size() == 2 * kPrograms);
  for (std::size_t i = 0; i < kPrograms; ++i) {
    CHECK(folder.told[2 * i] == std::pair(i + 1, std::string("scale.cl")));
    CHECK(folder.told[2 * i + 1] == std::pair(i + 1, std::string()));
  }
  CHECK(folder.cached() == kPrograms);
  std::vector<Kernel> again = scales(context);
  CHECK(product(context, again) == 720);
  CHECK(folder.told.size() == 2 * kPrograms);
  CHECK(context.build_seconds() > 0);
}

TEST_CASE("programs: one that does not compile says so at each use and leaves the others alone") {
  Folder folder;
  Context context(test_device(), folder.options);
  std::vector<Kernel> kernels = scales(context);
  Kernel broken = context.kernel("scale.cl", "scale", BuildOptions().define("RS_FACTOR", "oops"));
  CHECK_NOTHROW(context.finish_builds());
  for (int use = 0; use < 2; ++use) CHECK_THROWS_AS(broken.argument_count(), DeviceError);
  CHECK_THROWS_AS(context.kernel("scale.cl", "scale", BuildOptions().define("RS_FACTOR", "oops"))
                      .argument_count(),
                  DeviceError);
  CHECK(product(context, kernels) == 720);
}

TEST_CASE("programs: a context may go before what it has begun") {
  const Folder folder;
  for (int i = 0; i < 3; ++i) {
    Context context(test_device(), folder.options);
    scales(context);
  }
  CHECK(folder.told.empty());
}

TEST_CASE("programs: processes compile them where a compiler is named") {
  Folder folder;
  const fs::path log = folder.path() / "log";
  folder.options.compiler = folder.script(
      fmt::format("echo \"$@\" >> '{}'\nexec '{}' \"$@\"", log.string(), test::program_file()));
  {
    Context context(test_device(), folder.options);
    std::vector<Kernel> kernels = scales(context);
    CHECK(product(context, kernels) == 720);
  }
  CHECK(folder.told.size() == 2 * kPrograms);
  CHECK(folder.cached() == kPrograms);
  CHECK(fs::exists(log) == (test_device().type == DeviceType::kCpu));
}

TEST_CASE("programs: this process compiles them where the named compiler does not") {
  Folder folder;
  const std::vector<fs::path> compilers{"/no/such/program", "/bin/false",
                                        folder.script("read request; echo failed >&0; exit 1")};
  for (const fs::path& compiler : compilers) {
    CAPTURE(compiler.string());
    fs::remove_all(folder.options.cache_directory);
    folder.options.compiler = compiler;
    Context context(test_device(), folder.options);
    std::vector<Kernel> kernels = scales(context);
    CHECK(product(context, kernels) == 720);
    CHECK(folder.cached() == kPrograms);
  }
}
