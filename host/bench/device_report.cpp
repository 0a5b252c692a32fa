// SPDX-License-Identifier: Apache-2.0
#include "bench/device_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "bench/bench_cases.hpp"
#include "bench/cards.hpp"
#include "bench/kept_failure.hpp"
#include "bench/scene_bench.hpp"
#include "device/device_json.hpp"
#include "util/json_text.hpp"

namespace raysplats {
namespace {

constexpr int kSchemaVersion = 1;
constexpr int kLargeWidth = 1600, kLargeHeight = 1064;
// Ids of the rows that say how fast pictures and steps are.
constexpr const char* kWholeRows = "^(view|iteration)/";

// Time that goes on while kernels are compiled, and without that.
class Clock {
 public:
  explicit Clock(const Context& context)
      : context_(context),
        begin_(std::chrono::steady_clock::now()),
        built_(context.build_seconds()) {}
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }
  double measuring() const { return seconds() - (context_.build_seconds() - built_); }

 private:
  const Context& context_;
  std::chrono::steady_clock::time_point begin_;
  double built_;
};

void add_speeds(const BenchReport& run, int width, int height, DeviceReport& report) {
  for (const BenchRow& row : run.rows) {
    const double seconds = row.wall.value_or(row.seconds.median);
    const DeviceReport::Speed speed{row.scene, row.size, width, height,
                                    seconds > 0 ? 1.0 / seconds : 0.0};
    if (row.name == "view") report.frames.push_back(speed);
    if (row.name == "iteration") report.iterations.push_back(speed);
  }
}

// Counted by kernels of its own, which not every device can run.
void add_model(Context& context, const BenchOptions& one, DeviceReport& report) {
  const BenchCase scene{one.scenes.front(), one.sizes.front()};
  const std::string failure =
      failure_of([&] {
        const BenchModel model = generated(scene, one);
        SceneBench bench(context, model, one);
        report.models.push_back(
            {scene.scene, scene.size, one.width, one.height, forecast_cards(bench.counts(true))});
      }).reason;
  if (failure.empty()) return;
  report.left_out.push_back(
      fmt::format("the model of speed of {}, {} Gaussians: {}", scene.scene, scene.size, failure));
}

// Measures one scene of one size. False where nothing of it could be.
bool add_run(Context& context, const BenchOptions& one, DeviceReport& report) {
  const std::string failure =
      failure_of([&] { report.runs.push_back(run_bench(context, one)); }).reason;
  if (!failure.empty()) {
    report.left_out.push_back(fmt::format("{}, {} Gaussians, {}x{}: {}", one.scenes.front(),
                                          one.sizes.front(), one.width, one.height, failure));
    report.failed += bench_ids(one).size();
    return false;
  }
  const BenchReport& run = report.runs.back();
  for (const std::string& line : left_out_lines(run))
    report.left_out.push_back(fmt::format("{}x{}, {}", one.width, one.height, line));
  report.failed += static_cast<std::size_t>(
      std::count_if(run.left_out.begin(), run.left_out.end(),
                    [](const BenchReport::LeftOut& row) { return row.failed; }));
  add_speeds(run, one.width, one.height, report);
  return true;
}

// The measured time of a row beside that of the cards.
std::string model_text(const DeviceReport& report, const DeviceReport::Model& model) {
  std::string out = fmt::format("\nModel of speed: {}, {} Gaussians, {}x{}\n{}", model.scene,
                                model.size, model.width, model.height, cards_text(model.cards));
  const std::string resolution = fmt::format("{}x{}", model.width, model.height);
  for (const BenchReport& run : report.runs) {
    if (run.options.at("resolution") != resolution) continue;
    for (const BenchRow& row : run.rows) {
      const bool modelled = std::any_of(model.cards.rows.begin(), model.cards.rows.end(),
                                        [&](const auto& each) { return each.name == row.name; });
      if (modelled && row.scene == model.scene && row.size == model.size)
        out +=
            fmt::format("measured here: {:<15} {:>10.3f} ms\n", row.name, 1e3 * row.seconds.median);
    }
  }
  return out;
}

nlohmann::ordered_json model_json(const DeviceReport::Model& model) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::object();
  for (const CardForecast::Row& row : model.cards.rows) {
    for (std::size_t i = 0; i < row.cards.size(); ++i) {
      rows[row.name][cards()[i].speeds.name] = {{"seconds", row.cards[i].seconds},
                                                {"bound", row.cards[i].bound}};
    }
  }
  return {{"scene", model.scene},
          {"size", model.size},
          {"width", model.width},
          {"height", model.height},
          {"rows", rows}};
}

std::string speed_lines(const char* unit, const std::vector<DeviceReport::Speed>& speeds) {
  std::string out;
  for (const DeviceReport::Speed& speed : speeds) {
    out += fmt::format("{:<10} {:>9} Gaussians {:>5}x{:<5} {:>10.2f} {}\n", speed.scene, speed.size,
                       speed.width, speed.height, speed.per_second, unit);
  }
  return out;
}

nlohmann::ordered_json speeds_json(const std::vector<DeviceReport::Speed>& speeds) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const DeviceReport::Speed& speed : speeds) {
    out.push_back({{"scene", speed.scene},
                   {"size", speed.size},
                   {"width", speed.width},
                   {"height", speed.height},
                   {"per_second", speed.per_second}});
  }
  return out;
}

}  // namespace

bool DeviceReport::passed() const {
  return std::all_of(checks.begin(), checks.end(),
                     [](const SelfTestCheck& check) { return check.passed(); });
}

DeviceReport make_device_report(Context& context,
                                const BenchOptions& options,
                                double most_seconds) {
  const Clock clock(context);
  DeviceReport report;
  report.device = context.device();
  report.checks = run_self_test(context, options.trace, true);
  std::vector<std::size_t> sizes = options.sizes;
  std::sort(sizes.begin(), sizes.end());
  for (const bool large : {false, true}) {
    const int width = large ? kLargeWidth : options.width;
    const int height = large ? kLargeHeight : options.height;
    for (const std::string& scene : options.scenes) {
      double before = 0;  // seconds that the size before took
      std::size_t size_before = 0;
      for (const std::size_t size : sizes) {
        const double expected = size_before == 0 ? 0.0
                                                 : before * static_cast<double>(size) /
                                                       static_cast<double>(size_before);
        if (clock.seconds() + expected > most_seconds) {
          report.left_out.push_back(
              fmt::format("{}, {} Gaussians, {}x{}: it would not have ended in time", scene, size,
                          width, height));
          continue;
        }
        BenchOptions one = options;
        one.keep_failures = true;
        one.scenes = {scene};
        one.sizes = {size};
        one.width = width;
        one.height = height;
        if (large) one.filter = kWholeRows;
        one.deadline = std::chrono::steady_clock::now() +
                       std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                           std::chrono::duration<double>(most_seconds - clock.seconds()));
        const Clock run(context);
        if (!add_run(context, one, report)) continue;
        before = run.measuring();
        size_before = size;
        if (!large && clock.seconds() < most_seconds) add_model(context, one, report);
      }
    }
  }
  report.compile_seconds = context.build_seconds();
  report.seconds = clock.seconds();
  return report;
}

std::string device_report_text(const DeviceReport& report) {
  std::string out = fmt::format("{} ({}), {}\n", report.device.name,
                                device_type_name(report.device.type), report.device.platform);
  for (const SelfTestCheck& check : report.checks) {
    out += check.failure.empty()
               ? fmt::format("{:<40} {:>10.2e} of {:.0e} {}\n", check.name, check.error,
                             check.limit, check.passed() ? "passed" : "FAILED")
               : fmt::format("{:<40} FAILED: {}\n", check.name, check.failure);
  }
  for (const BenchReport& run : report.runs) {
    out += fmt::format("\n{}\n", run.options.at("resolution"));
    out += bench_table(run);
  }
  for (const DeviceReport::Model& model : report.models) out += model_text(report, model);
  out += "\n" + speed_lines("frames/s", report.frames);
  out += speed_lines("training iterations/s", report.iterations);
  for (const std::string& what : report.left_out) out += fmt::format("left out: {}\n", what);
  out += fmt::format("{:.0f} s, {:.0f} s of them for compiling kernels; self-test {}\n",
                     report.seconds, report.compile_seconds, report.passed() ? "passed" : "FAILED");
  return out;
}

std::string device_report_json(const DeviceReport& report) {
  nlohmann::ordered_json checks = nlohmann::ordered_json::array();
  for (const SelfTestCheck& check : report.checks) {
    checks.push_back({{"name", check.name},
                      {"error", check.error},
                      {"limit", check.limit},
                      {"passed", check.passed()}});
    if (!check.failure.empty()) checks.back()["failure"] = check.failure;
  }
  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  for (const BenchReport& run : report.runs)
    runs.push_back(nlohmann::ordered_json::parse(bench_json(run)));
  nlohmann::ordered_json models = nlohmann::ordered_json::array();
  for (const DeviceReport::Model& model : report.models) models.push_back(model_json(model));
  const nlohmann::ordered_json out{{"schema", "raysplats-device-report"},
                                   {"schema_version", kSchemaVersion},
                                   {"device", device_json(report.device)},
                                   {"self_test_passed", report.passed()},
                                   {"self_test", checks},
                                   {"frames", speeds_json(report.frames)},
                                   {"training_iterations", speeds_json(report.iterations)},
                                   {"models", models},
                                   {"left_out", report.left_out},
                                   {"failed", report.failed},
                                   {"compile_seconds", report.compile_seconds},
                                   {"seconds", report.seconds},
                                   {"runs", runs}};
  // Errors hold what drivers say, which may be any bytes.
  return json_text(out, 2) + "\n";
}

}  // namespace raysplats
