// SPDX-License-Identifier: Apache-2.0
#include "report/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "report/camera_map.hpp"
#include "report/chart.hpp"
#include "report/html.hpp"
#include "report/run_files.hpp"
#include "report/run_warnings.hpp"
#include "run/train_config.hpp"
#include "scene/gaussians/activation.hpp"
#include "util/atomic_file.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using namespace report;

std::string row(const std::string& name, const std::string& value) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", escaped(name), escaped(value));
}

std::string charts(const std::map<std::string, std::vector<double>>& columns,
                   const std::vector<Json>& evaluations) {
  const Curve psnr[] = {curve("training view", columns, "iteration", "psnr"),
                        evaluated("held-out views", evaluations, "iteration", "psnr")};
  const Curve timed[] = {curve("training view", columns, "seconds", "psnr"),
                         evaluated("held-out views", evaluations, "training_seconds", "psnr")};
  const Curve loss[] = {curve("loss", columns, "iteration", "loss")};
  const Curve count[] = {curve("Gaussians", columns, "iteration", "gaussians")};
  const Curve speed[] = {curve("speed", columns, "iteration", "it_per_s")};
  const Curve ssim[] = {evaluated("SSIM", evaluations, "iteration", "ssim")};
  return "<div class=\"charts\">\n" + chart("PSNR, dB", "iterations", psnr) +
         chart("PSNR, dB", "seconds of training", timed) + chart("Loss", "iterations", loss) +
         chart("SSIM of held-out views", "iterations", ssim) +
         chart("Gaussians", "iterations", count) +
         chart("Iterations a second", "iterations", speed) + "</div>\n";
}

std::string held_out(const fs::path& run,
                     const std::vector<Json>& evaluations,
                     std::vector<Json> views) {
  if (evaluations.empty()) return "<p>The run has no held-out views.</p>\n";
  const fs::path folder = pictures_of(run, evaluations);
  if (views.empty()) return "";
  std::stable_sort(views.begin(), views.end(), [](const Json& a, const Json& b) {
    return number(a, "psnr") < number(b, "psnr");
  });
  std::vector<Figure> shown{picture(folder, views.front(), "Worst")};
  if (views.size() > 2) shown.push_back(picture(folder, views[views.size() / 2], "Typical"));
  if (views.size() > 1) shown.push_back(picture(folder, views.back(), "Best"));
  std::string out = figures(shown);
  out +=
      "<details><summary>All views</summary><table>\n<tr><th>view</th><th>PSNR</th><th>SSIM</th>"
      "</tr>\n";
  for (const Json& view : views) {
    out += fmt::format("<tr><td>{}</td><td>{:.2f}</td><td>{:.4f}</td></tr>\n",
                       escaped(text(view, "name")), number(view, "psnr"), number(view, "ssim"));
  }
  return out + "</table></details>\n";
}

/// A heading and what stands below it; nothing without that.
std::string section(const char* heading, const std::string& content) {
  return content.empty() ? "" : fmt::format("<h2>{}</h2>\n{}", heading, content);
}

/// What `make` makes of files of the run, or why it cannot, where they are damaged.
template <class Make>
std::string made_or_why(Make make) {
  try {
    return make();
  } catch (const DataError& error) {
    return fmt::format("<p class=\"warn\">{}</p>\n", escaped(error.what()));
  }
}

std::string in_grid(const std::string& charts) {
  return charts.empty() ? "" : "<div class=\"charts\">\n" + charts + "</div>\n";
}

/// The model that the run has last written.
fs::path newest_model(const fs::path& run) {
  constexpr std::string_view kPrefix = "iteration_";
  fs::path out;
  double newest = -1;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(run / "point_cloud", error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kPrefix)) continue;
    const double iteration = parse_real(name.substr(kPrefix.size())).value_or(-1);
    const fs::path file = entry.path() / "point_cloud.ply";
    if (iteration <= newest || !fs::is_regular_file(file, error)) continue;
    newest = iteration;
    out = file;
  }
  return out;
}

std::string model_histograms(const fs::path& run) {
  const fs::path file = newest_model(run);
  if (file.empty()) return "";
  const Gaussians model = read_ply(file);
  std::vector<double> opacities, sizes;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* scales = model.log_scales.data() + 3 * i;
    opacities.push_back(sigmoid(static_cast<double>(model.opacities[i])));
    sizes.push_back(static_cast<double>(*std::max_element(scales, scales + 3)) / std::log(10.0));
  }
  if (sizes.empty()) return "";
  std::sort(sizes.begin(), sizes.end());
  // A few strays are not to squeeze all others into one bar.
  constexpr double kStrays = 1e-3;
  const auto strays = static_cast<std::size_t>(kStrays * static_cast<double>(sizes.size()));
  const double least = sizes[strays], most = std::max(sizes[sizes.size() - 1 - strays], least + 1);
  return in_grid(
      histogram("Opacity", "opacity", opacities, 0, 1) +
      histogram("Size: log10 of the longest axis", "units of the data set", sizes, least, most));
}

/// Gains of the colours of all training photos, in the order of their names.
std::string exposures(const fs::path& run) {
  const fs::path file = run / "exposures.json";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return "";
  // In the order in which their names fit the colours of curves: blue, orange, green.
  constexpr std::size_t kChannels[] = {2, 0, 1};
  Curve gains[] = {{"blue", {}}, {"red", {}}, {"green", {}}};
  double photo = 0;
  const Json json = io::read_json_object(file);
  for (const auto& [name, rows] : json.items()) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t c = kChannels[i];
      const bool sound = rows.is_array() && rows.size() == 3 && rows[c].is_array() &&
                         rows[c].size() == 4 && rows[c][c].is_number();
      if (sound) gains[i].points.emplace_back(photo, rows[c][c].get<double>());
    }
    ++photo;
  }
  return in_grid(chart("Gain of the colours", "photos by name", gains));
}

std::string kernels(const Json& metrics) {
  constexpr double kLeastShare = 0.01;
  std::string rows;
  for (const Json& kernel : objects(metrics, "kernels")) {
    if (number(kernel, "share") < kLeastShare) continue;
    rows += fmt::format("<tr><th>{}</th><td>{:.0f}</td><td>{:.1f}</td>{}</tr>\n",
                        escaped(text(kernel, "name")), number(kernel, "calls"),
                        number(kernel, "ms"), share_cell(number(kernel, "share")));
  }
  if (rows.empty()) return "<p>The run was too short for one of its steps to be timed.</p>\n";
  const double steps = number(metrics, "timed_steps");
  const std::string what = steps > 0 ? fmt::format("Device time in {} of training, one of every 32",
                                                   counted(steps, "step"))
                                     : "Device time of the whole run";
  return "<p>" + what +
         ".</p>\n<table>\n<tr><th>kernel</th><th>launches</th><th>ms</th><th>share</th></tr>\n" +
         rows + "</table>\n";
}

/// What somebody needs to make the run again, as far as its files say it.
std::string origin(const Json& metrics) {
  std::string rows;
  for (const auto& [name, key] : kOrigins) {
    const std::string value = text(metrics, key);
    if (!value.empty()) rows += row(name, value);
  }
  if (const std::string last = last_command(metrics); !last.empty())
    rows += row("Resumed, last by", last);
  // Its 64 bits are more than a double has.
  const auto seed = metrics.find("seed");
  if (seed != metrics.end() && seed->is_number_integer()) rows += row("Seed", seed->dump());
  return rows;
}

std::string configuration(const fs::path& run) {
  const fs::path file = run / "config.toml";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return "<p>There is no config.toml that tells them.</p>\n";
  const std::string text = text_of(file);
  const TrainOptions usual;
  const std::map<std::string, std::string> defaults = settings(to_toml(usual));
  std::string changed;
  for (const auto& [key, value] : settings(text)) {
    const auto usual = defaults.find(key);
    if (usual == defaults.end() || usual->second != value) changed += row(key, value);
  }
  return (changed.empty() ? "<p>All settings are the defaults.</p>\n"
                          : "<table>\n" + changed + "</table>\n") +
         fmt::format("<details><summary>All settings</summary><pre>{}</pre></details>\n",
                     escaped(text));
}

struct Page {
  std::string text;
  std::vector<std::string> warnings;
};

Page page_of(const fs::path& run) {
  const Json metrics = metrics_of(run);
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  const std::vector<Json> views = views_of(run, evaluations);
  const auto columns = columns_of(run / "metrics.csv");
  std::string facts;
  if (!evaluations.empty()) {
    const Json& last = evaluations.back();
    facts +=
        row("Held-out views",
            fmt::format("PSNR {:.2f} dB{}, SSIM {:.4f}, {}", number(last, "psnr"),
                        last.contains("psnr_aligned")
                            ? fmt::format(" ({:.2f} where they fit)", number(last, "psnr_aligned"))
                            : "",
                        number(last, "ssim"), counted(number(last, "views"), "view")));
  }
  const double most = number(metrics, "most_gaussians");
  facts += row("Gaussians", fmt::format("{:.0f}", number(metrics, "gaussians")) +
                                (most > 0 ? fmt::format(", at most {:.0f}", most) : ""));
  facts += row("Iterations", fmt::format("{:.0f}", number(metrics, "iteration")));
  facts += row("Training", fmt::format("{:.0f} s, and {:.0f} s of compiling kernels",
                                       number(metrics, "training_seconds"),
                                       number(metrics, "kernel_build_seconds")));
  facts += row("Device memory",
               fmt::format("{:.0f} MiB at most", number(metrics, "peak_device_bytes") / 1048576.0));
  facts += origin(metrics);
  std::vector<std::string> warnings =
      warnings_of(metrics, settings(text_of(run / "config.toml")), columns, views);
  std::string said = fmt::format("<p>{}</p>\n", escaped(verdict(metrics, warnings.size())));
  for (const std::string& each : warnings)
    said += fmt::format("<p class=\"warn\">{}.</p>\n", escaped(each));
  std::string text = report::page(
      run_name(run),
      said + "<table>\n" + facts + "</table>\n" + section("Curves", charts(columns, evaluations)) +
          section("Held-out views", held_out(run, evaluations, views)) +
          section("Cameras", made_or_why([&] {
                    return in_grid(camera_map(run, views, objects(metrics, "photos")));
                  })) +
          section("Model", made_or_why([&] { return model_histograms(run); })) +
          section("Exposure", made_or_why([&] { return exposures(run); })) +
          section("Kernels", kernels(metrics)) +
          section("Settings that differ from the defaults", configuration(run)));
  return {std::move(text), std::move(warnings)};
}

}  // namespace

std::vector<fs::path> report_inputs(const fs::path& run) {
  std::vector<fs::path> files{run / "metrics.json", run / "metrics.csv", run / "config.toml",
                              run / "cameras.json", run / "exposures.json"};
  if (const fs::path model = newest_model(run); !model.empty()) files.push_back(model);
  // Pictures have names that only metrics.json beside them knows, which may be damaged.
  const fs::path evaluation = pictures_of(run, objects(metrics_of(run), "evaluations"));
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(evaluation, error)) {
    if (entry.path().filename() == "metrics.json" || io::has_image_extension(entry.path()))
      files.push_back(entry.path());
  }
  return files;
}

std::string run_report(const fs::path& run) { return page_of(run).text; }

std::string write_run_report(const fs::path& run, const fs::path& file) {
  const Page page = page_of(run);
  write_text_file(file, page.text);
  return warnings_line(page.warnings, file);
}

}  // namespace raysplats
