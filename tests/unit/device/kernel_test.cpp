// SPDX-License-Identifier: Apache-2.0
#include "device/kernel.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "device/kernel_sources.hpp"
#include "device/profiler.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;
using test::message_of;

namespace {

ContextOptions uncached() {
  ContextOptions options;
  options.kernel_cache = false;
  return options;
}

// What other code writes to standard error while `action` runs.
template <class Action>
std::string standard_error(const Action& action) {
  std::FILE* file = std::tmpfile();
  REQUIRE(file != nullptr);
  std::fflush(stderr);
  const int terminal = ::dup(2);
  ::dup2(::fileno(file), 2);
  action();
  std::fflush(stderr);
  ::dup2(terminal, 2);
  ::close(terminal);
  std::rewind(file);
  std::string text;
  for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) text += static_cast<char>(c);
  std::fclose(file);
  return text;
}

const char* const kScale =
    "#include \"shared/compat.h\"\n"
    "#ifndef RS_FACTOR\n#define RS_FACTOR 2\n#endif\n"
    "__kernel void scale(__global int* data, int offset, uint count) {\n"
    "  const uint i = get_global_id(0);\n"
    "  if (i < count) data[i] = data[i] * RS_FACTOR + offset;\n"
    "}\n";

}  // namespace

TEST_CASE("kernel source: includes are resolved once, from a folder when it is named") {
  const TemporaryDirectory folder;
  const ScopedVariable variable("RAYSPLATS_KERNEL_DIR", folder.path().string());
  folder.write("a.cl", "first\n#include \"sub/b.h\"\n#include \"sub/b.h\"\nlast\n");
  folder.write("sub/b.h", "#include \"a.cl\"\nbody\n");
  const std::string source = resolve_kernel_source("a.cl");
  CHECK(source.find("first") < source.find("body"));
  CHECK(source.find("body") < source.find("last"));
  CHECK(source.find("body") == source.rfind("body"));
  CHECK(source.find("first") == source.rfind("first"));
  CHECK(contains(source, "#line 1 \"sub/b.h\""));
  CHECK(contains(source, "#line 3 \"a.cl\""));
  CHECK(
      contains(message_of<DeviceError>([] { resolve_kernel_source("missing.cl"); }), "missing.cl"));
}

TEST_CASE("kernel source: the built-in files, and a name that is none") {
  CHECK(contains(resolve_kernel_source("parallel/layout_probe.cl"), "RsAabb"));
  CHECK(
      contains(message_of<DeviceError>([] { resolve_kernel_source("no/such.cl"); }), "no/such.cl"));
}

TEST_CASE("kernel: a compile error shows file, line and the compiler's message") {
  const TemporaryDirectory folder;
  const ScopedVariable variable("RAYSPLATS_KERNEL_DIR", folder.path().string());
  folder.write("good.h", "\n\n");
  folder.write(
      "broken.cl",
      "#include \"good.h\"\n__kernel void f(__global int* a) {\n  a[0] = undeclared_name;\n}\n");
  Context context(test_device(), uncached());
  const std::string message =
      message_of<DeviceError>([&] { context.kernel("broken.cl", "f").argument_count(); });
  CAPTURE(message);
  CHECK(contains(message, "broken.cl:3"));
  CHECK(contains(message, "undeclared_name"));
  CHECK(contains(message, context.device().name));
  // The file is the user's own.
  CHECK(contains(message, "Kernel file " + (folder.path() / "broken.cl").string() + " does not"));
  CHECK(contains(message, "): correct it\n"));
}

TEST_CASE("kernel: a compile error of a folder that the context names has the file's path") {
  const TemporaryDirectory folder;
  folder.write("broken.cl", "__kernel void f(__global int* a) { a[0] = undeclared_name; }\n");
  ContextOptions options = uncached();
  options.kernel_directory = folder.path().string();
  Context context(test_device(), options);
  const std::string message =
      message_of<DeviceError>([&] { context.kernel("broken.cl", "f").argument_count(); });
  CAPTURE(message);
  CHECK(contains(message, (folder.path() / "broken.cl").string()));
  CHECK(contains(message, "correct it"));
  CHECK(!contains(message, "update the driver"));
}

TEST_CASE("kernel: launches with defines, values and rounded ranges") {
  const TemporaryDirectory folder;
  const ScopedVariable variable("RAYSPLATS_KERNEL_DIR", folder.path().string());
  folder.write("scale.cl", kScale);
  folder.write("shared/compat.h", "");
  Context context(test_device(), uncached());
  Buffer<std::int32_t> data(context, 10, "data");
  const std::vector<std::int32_t> input{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  data.upload(input);
  Kernel twice = context.kernel("scale.cl", "scale");
  Kernel thrice = context.kernel("scale.cl", "scale", BuildOptions().define("RS_FACTOR", 3));
  twice.launch(Range::linear(10, 8), data, std::int32_t{1}, std::uint32_t{9});
  thrice.launch(Range::linear(10, 8), data, std::int32_t{0}, std::uint32_t{10});
  twice.launch(Range::linear(0, 8), data, std::int32_t{5}, std::uint32_t{10});  // nothing to do
  for (std::size_t i = 0; i < 10; ++i)
    CHECK(data.read(i) == 3 * (i < 9 ? 2 * input[i] + 1 : input[i]));
  CHECK(twice.name() == "scale");
  CHECK(twice.max_work_group_size() >= 1);
}

TEST_CASE("kernel: wrong launches are refused with the kernel's name") {
  const TemporaryDirectory folder;
  const ScopedVariable variable("RAYSPLATS_KERNEL_DIR", folder.path().string());
  folder.write("scale.cl", kScale);
  folder.write("shared/compat.h", "");
  Context context(test_device(), uncached());
  CHECK(contains(message_of<DeviceError>(
                     [&] { context.kernel("scale.cl", "no_such_kernel").argument_count(); }),
                 "no_such_kernel"));
  Kernel kernel = context.kernel("scale.cl", "scale");
  Buffer<std::int32_t> data(context, 10, "data");
  const std::string count =
      message_of<DeviceError>([&] { kernel.launch(Range::linear(10, 1), data, std::int32_t{1}); });
  CHECK(contains(count, "scale takes 3 arguments, 2 were given"));
  const std::string empty = message_of<DeviceError>([&] {
    kernel.launch(Range::linear(10, 1), Buffer<std::int32_t>(), std::int32_t{1}, std::uint32_t{1});
  });
  CHECK(contains(empty, "Argument 0 of kernel scale"));
  const std::string size = message_of<DeviceError>(
      [&] { kernel.launch(Range::linear(10, 1), data, std::int64_t{1}, std::uint32_t{1}); });
  CHECK(contains(size, "Argument 1 of kernel scale"));
  const std::size_t group = 2 * context.device().max_work_group_size;
  const std::string range = message_of<DeviceError>(
      [&] { kernel.launch(Range::linear(1, group), data, std::int32_t{1}, std::uint32_t{1}); });
  CHECK(contains(range, "scale"));
  CHECK(contains(range, std::to_string(group)));
}

TEST_CASE("range: sizes round up to whole groups") {
  CHECK(Range::linear(0, 64).global[0] == 0);
  CHECK(Range::linear(1, 64).global[0] == 64);
  CHECK(Range::linear(64, 64).global[0] == 64);
  CHECK(Range::linear(65, 64).global[0] == 128);
  CHECK(Range::linear(65, 64).local[0] == 64);
  const Range plane = Range::plane(17, 8, 8, 4);
  CHECK(plane.global[0] == 24);
  CHECK(plane.global[1] == 8);
  CHECK(plane.global[2] == 1);
  CHECK(plane.local[0] == 8);
  CHECK(plane.local[1] == 4);
  CHECK(plane.local[2] == 1);
}

TEST_CASE("profiler: launches are counted and the table has them") {
  ContextOptions options;
  options.profile = true;
  Context context(test_device(), options);
  Buffer<std::uint32_t> layout(context, 256, "layout");
  Kernel kernel = context.kernel("parallel/layout_probe.cl", "layout_probe");
  for (int i = 0; i < 3; ++i) kernel.launch(Range{}, layout);
  const std::vector<Profiler::Row> rows = context.profiler().rows();
  REQUIRE(rows.size() == 1);
  CHECK(rows[0].kernel == "layout_probe");
  CHECK(rows[0].calls == 3);
  CHECK(rows[0].share == doctest::Approx(1));
  context.profiler().reset();
  CHECK(context.profiler().rows().empty());

  Profiler profiler;
  profiler.add("short", 1000000);
  profiler.add("long", 2000000);
  profiler.add("long", 1000000);
  REQUIRE(profiler.rows().size() == 2);
  CHECK(profiler.rows()[0].kernel == "long");
  CHECK(profiler.rows()[0].total_ms == doctest::Approx(3));
  CHECK(profiler.rows()[0].mean_ms == doctest::Approx(1.5));
  CHECK(profiler.rows()[1].share == doctest::Approx(0.25));
  const std::string table = profiler.table();
  CHECK(table.find("kernel") < table.find("long"));
  CHECK(table.find("long") < table.find("short"));
  CHECK(contains(table, "75.0%"));
}

TEST_CASE("profiler: what asks for times waits for its turn") {
  ContextOptions options;
  options.profile = options.keep_launches = true;
  Context context(test_device(), options);
  Buffer<float> buffer(context, 64, "filled");
  buffer.clear(64);
  for (const bool table : {true, false}) {
    CAPTURE(table);
    std::atomic<bool> done = false;
    std::size_t found = 0;
    auto turn = context.lock();
    std::thread other([&] {
      found = table ? context.profile_table().size() : context.take_launches().size();
      done = true;
    });
    for (int i = 0; i < 20 && !done; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    CHECK_FALSE(done.load());
    turn.unlock();
    other.join();
    CHECK(found > 0);
  }
}

TEST_CASE("compilers that warn are not heard") {
  const TemporaryDirectory folder;
  const ScopedVariable variable("RAYSPLATS_KERNEL_DIR", folder.path().string());
  // A loop that cannot be unrolled is what a compiler warns of late, when its log is made up.
  folder.write("noisy.cl",
               "void turn(const float* from, float* to, const int rows) {\n"
               "  #pragma unroll\n"
               "  for (int i = 0; i < rows / 2; ++i) to[i] = from[i + rows / 2] * RS_RUN;\n"
               "}\n"
               "__kernel void noisy(__global float* data) {\n"
               "  float a[8], b[8];\n"
               "  for (int i = 0; i < 8; ++i) a[i] = data[i];\n"
               "  turn(a, b, 8);\n"
               "  for (int i = 0; i < 4; ++i) data[i] = b[i];\n"
               "}\n");
  Context context(test_device(), uncached());
  const auto build = [&](int run) {
    // Drivers have caches of their own: every run of the test has another source.
    const auto now = std::chrono::system_clock::now().time_since_epoch().count();
    BuildOptions options;
    options.define("RS_RUN", fmt::format("{}.{}f", now % 1000000007, run));
    return standard_error([&] { context.kernel("noisy.cl", "noisy", options); });
  };
  CHECK(build(1) == "");
}
