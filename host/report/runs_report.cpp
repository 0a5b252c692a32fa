// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "report/chart.hpp"
#include "report/html.hpp"
#include "report/run_files.hpp"
#include "report/run_report.hpp"
#include "report/run_warnings.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using namespace report;

constexpr std::size_t kMostRuns = 12;
/// Views that are shown, so that the page stays small.
constexpr std::size_t kShownViews = 2;

// nlohmann::json says that its moves throw nothing, and asserts in them.
struct Run {  // NOLINT(bugprone-exception-escape)
  fs::path folder;
  std::string name;
  std::string letter;  ///< what stands for it in curves
  Json metrics;
  std::vector<Json> evaluations;
  std::vector<Json> views;                             ///< of the last evaluation
  std::map<std::string, std::size_t> by_name;          ///< places of these
  std::map<std::string, std::vector<double>> columns;  ///< of metrics.csv
  std::map<std::string, std::string> settings;
  std::vector<std::string> warnings;
};

std::vector<Run> read_runs(const std::vector<fs::path>& folders) {
  std::vector<Run> runs;
  const std::vector<std::string> names = run_names(folders);
  for (const fs::path& folder : folders) {
    Run run;
    run.folder = folder;
    run.name = names[runs.size()];
    run.letter = std::string(1, static_cast<char>('A' + runs.size()));
    run.metrics = metrics_of(folder);
    run.evaluations = objects(run.metrics, "evaluations");
    run.views = views_of(folder, run.evaluations);
    for (std::size_t i = 0; i < run.views.size(); ++i)
      run.by_name.emplace(text(run.views[i], "name"), i);
    run.columns = columns_of(folder / "metrics.csv");
    run.settings = settings(text_of(folder / "config.toml"));
    run.warnings = warnings_of(run.metrics, run.settings, run.columns, run.views);
    runs.push_back(std::move(run));
  }
  return runs;
}

/// A row of a table with a cell for each run, empty for one whose number is NaN; the greatest of
/// the others stands out.
std::string numbers_row(const std::string& what,
                        const std::vector<Run>& runs,
                        const char* format,
                        const std::function<double(const Run&)>& value,
                        bool greatest_wins = false) {
  std::vector<double> numbers;
  numbers.reserve(runs.size());
  double most = std::nan("");
  for (const Run& run : runs) {
    numbers.push_back(value(run));
    most = std::fmax(most, numbers.back());  // of NaN and a number the number
  }
  std::string out = fmt::format("<tr><th>{}</th>", escaped(what));
  for (const double number : numbers) {
    const std::string text = std::isnan(number) ? "" : fmt::format(fmt::runtime(format), number);
    out += greatest_wins && number == most ? fmt::format("<td><b>{}</b></td>", text)
                                           : fmt::format("<td>{}</td>", text);
  }
  return out + "</tr>\n";
}

/// What the reports of the runs begin with, a cell for each.
std::string verdicts(const std::vector<Run>& runs) {
  std::string out = "<tr><th>Verdict</th>";
  for (const Run& run : runs) {
    out += fmt::format("<td>{}", escaped(verdict(run.metrics, run.warnings.size())));
    for (const std::string& each : run.warnings)
      out += fmt::format("<br/><span class=\"warn\">{}.</span>", escaped(each));
    out += "</td>";
  }
  return out + "</tr>\n";
}

std::string heads(const std::vector<Run>& runs) {
  std::string out = "<tr><th></th>";
  for (std::size_t i = 0; i < runs.size(); ++i) {
    out += fmt::format("<th class=\"c{}\">{}: {}</th>", i % kColors, runs[i].letter,
                       escaped(runs[i].name));
  }
  return out + "</tr>\n";
}

double last_of(const Run& run, const char* key) {
  return run.evaluations.empty() ? std::nan("") : number(run.evaluations.back(), key);
}

std::string facts(const std::vector<Run>& runs) {
  const auto metric = [](const char* key, double scale = 1.0) {
    return [key, scale](const Run& run) { return scale * number(run.metrics, key); };
  };
  std::string out = "<table>\n" + heads(runs) + verdicts(runs);
  out += numbers_row(
      "PSNR of held-out views, dB", runs, "{:.2f}",
      [](const Run& run) { return last_of(run, "psnr"); }, true);
  const auto aligned = [](const Run& run) {
    return !run.evaluations.empty() && run.evaluations.back().contains("psnr_aligned");
  };
  if (std::any_of(runs.begin(), runs.end(), aligned)) {
    const auto psnr = [&](const Run& run) {
      return aligned(run) ? last_of(run, "psnr_aligned") : std::nan("");
    };
    out += numbers_row("The same where the views fit, dB", runs, "{:.2f}", psnr);
  }
  out += numbers_row(
      "SSIM", runs, "{:.4f}", [](const Run& run) { return last_of(run, "ssim"); }, true);
  out += numbers_row("Gaussians", runs, "{:.0f}", metric("gaussians"));
  out += numbers_row("Iterations", runs, "{:.0f}", metric("iteration"));
  out += numbers_row("Training, s", runs, "{:.0f}", metric("training_seconds"));
  out += numbers_row("Device memory at most, MiB", runs, "{:.0f}",
                     metric("peak_device_bytes", 1.0 / 1048576.0));
  const auto texts = [&](const char* name, const auto& value) {
    if (std::all_of(runs.begin(), runs.end(), [&](const Run& run) { return value(run).empty(); }))
      return;
    out += fmt::format("<tr><th>{}</th>", escaped(name));
    for (const Run& run : runs) out += fmt::format("<td>{}</td>", escaped(value(run)));
    out += "</tr>\n";
  };
  for (const Origin& origin : kOrigins) {
    texts(origin.name, [&](const Run& run) { return text(run.metrics, origin.key); });
  }
  texts("Resumed, last by", [](const Run& run) { return last_command(run.metrics); });
  return out + "</table>\n";
}

std::string charts(const std::vector<Run>& runs) {
  const auto of_evaluations = [&](const char* title, const char* label, const char* x,
                                  const char* y) {
    std::vector<Curve> curves;
    curves.reserve(runs.size());
    for (const Run& run : runs) curves.push_back(evaluated(run.letter, run.evaluations, x, y));
    return chart(title, label, curves);
  };
  const auto of_columns = [&](const char* title, const char* x, const char* label, const char* y) {
    std::vector<Curve> curves;
    curves.reserve(runs.size());
    for (const Run& run : runs) curves.push_back(curve(run.letter, run.columns, x, y));
    return chart(title, label, curves);
  };
  return "<div class=\"charts\">\n" +
         of_evaluations("PSNR of held-out views, dB", "iterations", "iteration", "psnr") +
         of_evaluations("PSNR of held-out views, dB", "seconds of training", "training_seconds",
                        "psnr") +
         of_columns("PSNR of the view just trained, dB", "seconds", "seconds of training", "psnr") +
         of_columns("Loss", "iteration", "iterations", "loss") +
         of_columns("Gaussians", "iteration", "iterations", "gaussians") +
         of_columns("Iterations a second", "iteration", "iterations", "it_per_s") + "</div>\n";
}

const Json* view_named(const Run& run, const std::string& name) {
  const auto found = run.by_name.find(name);
  return found == run.by_name.end() ? nullptr : &run.views[found->second];
}

/// The views that all runs have, those in which they differ most first.
std::string held_out(const std::vector<Run>& runs) {
  struct Common {
    std::string name;
    double spread = 0;
  };
  std::vector<Common> common;
  for (const Json& view : runs.front().views) {
    Common entry{text(view, "name"), 0};
    double least = number(view, "psnr"), most = least;
    bool everywhere = true;
    for (const Run& run : runs) {
      const Json* other = view_named(run, entry.name);
      everywhere = everywhere && other != nullptr;
      if (other == nullptr) break;
      least = std::min(least, number(*other, "psnr"));
      most = std::max(most, number(*other, "psnr"));
    }
    entry.spread = most - least;
    if (everywhere) common.push_back(entry);
  }
  if (common.empty()) return "<p>The runs have no held-out view in common.</p>\n";
  std::stable_sort(common.begin(), common.end(),
                   [](const Common& a, const Common& b) { return a.spread > b.spread; });
  const auto pictures = [&](const Common& entry) {
    std::vector<Figure> of_runs;
    of_runs.reserve(runs.size());
    for (const Run& run : runs) {
      of_runs.push_back(picture(pictures_of(run.folder, run.evaluations),
                                *view_named(run, entry.name), run.letter));
    }
    return of_runs;
  };
  std::vector<Common> shown = common;
  std::stable_partition(shown.begin(), shown.end(), [&](const Common& entry) {
    const std::vector<Figure> of_runs = pictures(entry);
    return std::none_of(of_runs.begin(), of_runs.end(),
                        [](const Figure& figure) { return figure.file.empty(); });
  });
  shown.resize(std::min(kShownViews, shown.size()));
  std::vector<Figure> all;
  for (const Common& entry : shown) {
    const std::vector<Figure> of_runs = pictures(entry);
    all.insert(all.end(), of_runs.begin(), of_runs.end());
  }
  std::string out = figures(all);
  out += "<details><summary>All views</summary><table>\n" + heads(runs);
  for (const Common& entry : common) {
    out += numbers_row(
        entry.name, runs, "{:.2f}",
        [&](const Run& run) { return number(*view_named(run, entry.name), "psnr"); }, true);
  }
  return out + "</table></details>\n";
}

std::string differences(const std::vector<Run>& runs) {
  std::set<std::string> keys;
  for (const Run& run : runs) {
    for (const auto& [key, value] : run.settings) keys.insert(key);
  }
  std::string rows;
  for (const std::string& key : keys) {
    std::vector<std::string> values;
    for (const Run& run : runs) {
      const auto found = run.settings.find(key);
      values.push_back(found == run.settings.end() ? "" : found->second);
    }
    if (std::all_of(values.begin(), values.end(),
                    [&](const std::string& value) { return value == values.front(); }))
      continue;
    rows += fmt::format("<tr><th>{}</th>", escaped(key));
    for (const std::string& value : values) rows += fmt::format("<td>{}</td>", escaped(value));
    rows += "</tr>\n";
  }
  if (rows.empty()) return "<p>All settings are the same.</p>\n";
  return "<table>\n" + heads(runs) + rows + "</table>\n";
}

}  // namespace

std::string runs_report(const std::vector<fs::path>& folders) {
  if (folders.size() < 2 || folders.size() > kMostRuns) {
    throw UsageError(
        fmt::format("{} runs do not go side by side: give 2 to {}", folders.size(), kMostRuns));
  }
  const std::vector<Run> runs = read_runs(folders);
  std::string title;
  for (const Run& run : runs) title += (title.empty() ? "" : ", ") + run.name;
  return page(title, facts(runs) + "<h2>Curves</h2>\n" + charts(runs) +
                         "<h2>Held-out views that differ most</h2>\n" + held_out(runs) +
                         "<h2>Settings that differ</h2>\n" + differences(runs));
}

}  // namespace raysplats
