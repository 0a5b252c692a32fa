// SPDX-License-Identifier: Apache-2.0
#include "report/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/atomic_file.hpp"
#include "report/html.hpp"
#include "report/run_files.hpp"
#include "train/train_config.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using namespace report;

constexpr double kCappedShare = 1e-3;  ///< of rays, from which the cap on hits is worth a warning
constexpr double kBelowBest = 0.1;     ///< dB
constexpr double kNothingLearned = 0.1;

std::string row(const std::string& name, const std::string& value) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", escaped(name), escaped(value));
}

std::vector<std::string> warnings_of(const Json& metrics, const std::vector<Json>& evaluations) {
  std::vector<std::string> out;
  const auto complete = metrics.find("complete");
  if (complete == metrics.end() || !complete->is_boolean() || !complete->get<bool>()) {
    out.push_back(fmt::format("The run is not over: {:.0f} of {:.0f} iterations",
                              number(metrics, "iteration"), number(metrics, "iterations")));
  }
  const double rays = number(metrics, "traced_rays");
  const double capped = number(metrics, "capped_rays");
  if (capped > kCappedShare * rays) {
    out.push_back(fmt::format("{:.2f} % of the rays stopped at --max-hits: raise it",
                              100.0 * capped / std::max(rays, 1.0)));
  }
  if (number(metrics, "bad_steps") > 0 || number(metrics, "skipped_updates") > 0) {
    out.push_back(fmt::format("{:.0f} steps were not finite, {:.0f} updates were left out",
                              number(metrics, "bad_steps"), number(metrics, "skipped_updates")));
  }
  const auto rise = metrics.find("psnr_rise");
  if (rise != metrics.end() && rise->is_number() && rise->get<double>() < kNothingLearned)
    out.emplace_back("No view became better by 0.1 dB: poses or photos may be wrong");
  if (evaluations.size() > 1) {
    const auto best = std::max_element(
        evaluations.begin(), evaluations.end(),
        [](const Json& a, const Json& b) { return number(a, "psnr") < number(b, "psnr"); });
    const double below = number(*best, "psnr") - number(evaluations.back(), "psnr");
    if (below > kBelowBest) {
      out.push_back(fmt::format("The run ends {:.2f} dB below its best, at iteration {:.0f}", below,
                                number(*best, "iteration")));
    }
  }
  return out;
}

std::string charts(const fs::path& run, const std::vector<Json>& evaluations) {
  auto columns = columns_of(run / "metrics.csv");
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

std::string held_out(const fs::path& run, const std::vector<Json>& evaluations) {
  if (evaluations.empty()) return "<p>The run has no held-out views.</p>\n";
  const fs::path folder = pictures_of(run, evaluations);
  std::vector<Json> views = views_of(run, evaluations);
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

std::string configuration(const fs::path& run) {
  const std::string text = text_of(run / "config.toml");
  const std::map<std::string, std::string> defaults = settings(to_toml({}));
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

}  // namespace

std::string run_report(const fs::path& run) {
  const Json metrics = metrics_of(run);
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  const std::string name = run_name(run);
  std::string facts;
  if (!evaluations.empty()) {
    const Json& last = evaluations.back();
    facts += row("Held-out views",
                 fmt::format("PSNR {:.2f} dB, SSIM {:.4f}, {:.0f} views", number(last, "psnr"),
                             number(last, "ssim"), number(last, "views")));
  }
  facts += row("Gaussians", fmt::format("{:.0f}", number(metrics, "gaussians")));
  facts += row("Iterations", fmt::format("{:.0f}", number(metrics, "iteration")));
  facts += row("Training", fmt::format("{:.0f} s, and {:.0f} s of compiling kernels",
                                       number(metrics, "training_seconds"),
                                       number(metrics, "kernel_build_seconds")));
  facts += row("Device memory",
               fmt::format("{:.0f} MiB at most", number(metrics, "peak_device_bytes") / 1048576.0));
  facts += row("Device", text(metrics, "device"));
  std::string warnings;
  for (const std::string& each : warnings_of(metrics, evaluations))
    warnings += fmt::format("<p class=\"warn\">{}.</p>\n", escaped(each));
  return report::page(name, warnings + "<table>\n" + facts + "</table>\n<h2>Curves</h2>\n" +
                                charts(run, evaluations) + "<h2>Held-out views</h2>\n" +
                                held_out(run, evaluations) +
                                "<h2>Settings that differ from the defaults</h2>\n" +
                                configuration(run));
}

void write_run_report(const fs::path& run, const fs::path& file) {
  write_text_file(file, run_report(run));
}

}  // namespace raysplats
