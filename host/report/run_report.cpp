// SPDX-License-Identifier: Apache-2.0
#include "report/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <vector>

#include "base/atomic_file.hpp"
#include "base/number_text.hpp"
#include "io/image_codec.hpp"
#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "report/html.hpp"
#include "train/train_config.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using report::chart;
using report::Curve;
using report::escaped;

constexpr std::uint64_t kMostText = std::uint64_t{64} << 20;
constexpr int kPictureQuality = 85;
constexpr double kCappedShare = 1e-3;  ///< of rays, from which the cap on hits is worth a warning
constexpr double kBelowBest = 0.1;     ///< dB
constexpr double kNothingLearned = 0.1;

constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--text:#1d1d1b;--line:#d5d5d0;--warn:#9c3a1a;--c0:#1d5fa8;--c1:#c2561b}
@media (prefers-color-scheme:dark){:root{--text:#e6e6e3;--line:#3c3e42;--warn:#f0906a;--c0:#7db4ee;--c1:#f0a15e}body{background:#1c1d1f}}
body{max-width:1000px;margin:24px auto;padding:0 16px;color:var(--text);font:15px/1.5 system-ui,sans-serif}
h1{font-size:22px}h2{font-size:17px;margin-top:28px;border-top:1px solid var(--line);padding-top:10px}
.warn{color:var(--warn)}.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(380px,1fr));gap:12px}
svg{width:100%;height:auto}svg text{fill:currentColor;font-size:11px}svg .title{font-size:13px;font-weight:600}
svg line{stroke:var(--line)}polyline{fill:none;stroke-width:1.6}
polyline.c0{stroke:var(--c0)}polyline.c1{stroke:var(--c1)}circle.c0,text.c0{fill:var(--c0)}circle.c1,svg text.c1{fill:var(--c1)}svg text.c0{fill:var(--c0)}
table{border-collapse:collapse}td,th{padding:3px 14px 3px 0;text-align:left;border-bottom:1px solid var(--line)}
figure{margin:14px 0}img{max-width:100%;height:auto}pre{white-space:pre-wrap;overflow-wrap:anywhere}
)";

std::string text_of(const fs::path& path) {
  std::error_code error;
  if (fs::file_size(path, error) > kMostText && !error)
    throw DataError(fmt::format("{} is too large for a file of a run", path.string()));
  std::ifstream stream(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

/// A number of a JSON object; 0 when it has none.
double number(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : 0.0;
}

std::string row(const std::string& name, const std::string& value) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", escaped(name), escaped(value));
}

std::vector<Json> objects(const Json& json, const char* key) {
  std::vector<Json> out;
  const auto found = json.find(key);
  if (found == json.end() || !found->is_array()) return out;
  std::copy_if(found->begin(), found->end(), std::back_inserter(out),
               [](const Json& each) { return each.is_object(); });
  return out;
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

/// Columns of metrics.csv by name; rows that are incomplete or no numbers are left out.
std::map<std::string, std::vector<double>> columns_of(const fs::path& path) {
  std::istringstream stream(text_of(path));
  const auto cells = [](const std::string& line) {
    std::vector<std::string> out;
    std::istringstream parts(line);
    for (std::string part; std::getline(parts, part, ',');) out.push_back(part);
    return out;
  };
  std::string line;
  std::getline(stream, line);
  const std::vector<std::string> names = cells(line);
  std::map<std::string, std::vector<double>> out;
  while (std::getline(stream, line)) {
    const std::vector<std::string> values = cells(line);
    std::vector<double> numbers;
    for (const std::string& value : values) {
      if (const std::optional<double> parsed = parse_real(value)) numbers.push_back(*parsed);
    }
    if (numbers.size() != names.size()) continue;
    for (std::size_t i = 0; i < names.size(); ++i) out[names[i]].push_back(numbers[i]);
  }
  return out;
}

Curve curve(const std::string& name,
            std::map<std::string, std::vector<double>>& columns,
            const std::string& x,
            const std::string& y) {
  Curve out{name, {}};
  const std::vector<double>& from = columns[x];
  const std::vector<double>& to = columns[y];
  for (std::size_t i = 0; i < std::min(from.size(), to.size()); ++i)
    out.points.emplace_back(from[i], to[i]);
  return out;
}

Curve evaluated(const std::string& name,
                const std::vector<Json>& evaluations,
                const char* x,
                const char* y) {
  Curve out{name, {}};
  for (const Json& each : evaluations) out.points.emplace_back(number(each, x), number(each, y));
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

/// The picture of a view (photo, render, error side by side); "" where there is none.
std::string picture(const fs::path& folder, const Json& view, const std::string& what) {
  const std::string name = view.value("name", "");
  const fs::path file = folder / fs::path(name).stem().concat(".png");
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return "";
  io::ImageEncoding encoding;
  encoding.format = "jpeg";
  encoding.quality = kPictureQuality;
  const std::vector<unsigned char> bytes =
      io::image_codec().encode("picture.jpg", read_image(file), encoding);
  return fmt::format(
      "<figure><img alt=\"{0}\" src=\"{1}\"/><figcaption>{2}: {0}, {3:.2f} dB (photo, render, "
      "error)</figcaption></figure>\n",
      escaped(name), report::data_url("image/jpeg", bytes), escaped(what), number(view, "psnr"));
}

std::string held_out(const fs::path& run, const std::vector<Json>& evaluations) {
  if (evaluations.empty()) return "<p>The run has no held-out views.</p>\n";
  const fs::path folder =
      run / "eval" / fmt::format("iteration_{:.0f}", number(evaluations.back(), "iteration"));
  std::error_code error;
  if (!fs::is_regular_file(folder / "metrics.json", error)) return "";
  std::vector<Json> views = objects(io::read_json_object(folder / "metrics.json"), "images");
  if (views.empty()) return "";
  std::stable_sort(views.begin(), views.end(), [](const Json& a, const Json& b) {
    return number(a, "psnr") < number(b, "psnr");
  });
  std::string out = picture(folder, views.front(), "Worst");
  if (views.size() > 2) out += picture(folder, views[views.size() / 2], "Typical");
  if (views.size() > 1) out += picture(folder, views.back(), "Best");
  out +=
      "<details><summary>All views</summary><table>\n<tr><th>view</th><th>PSNR</th><th>SSIM</th>"
      "</tr>\n";
  for (const Json& view : views) {
    out += fmt::format("<tr><td>{}</td><td>{:.2f}</td><td>{:.4f}</td></tr>\n",
                       escaped(view.value("name", "")), number(view, "psnr"), number(view, "ssim"));
  }
  return out + "</table></details>\n";
}

/// "key = value" lines of a configuration.
std::map<std::string, std::string> settings(const std::string& toml) {
  std::map<std::string, std::string> out;
  std::istringstream stream(toml);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t equals = line.find(" = ");
    if (!line.starts_with("#") && equals != std::string::npos)
      out[line.substr(0, equals)] = line.substr(equals + 3);
  }
  return out;
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
  std::error_code error;
  if (!fs::is_regular_file(run / "metrics.json", error)) {
    throw DataError(fmt::format("{} is no training run: it holds no metrics.json", run.string()));
  }
  const Json metrics = io::read_json_object(run / "metrics.json");
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  const std::string name = escaped(fs::absolute(run).lexically_normal().filename().string());
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
  facts += row("Device", metrics.value("device", ""));
  std::string warnings;
  for (const std::string& each : warnings_of(metrics, evaluations))
    warnings += fmt::format("<p class=\"warn\">{}.</p>\n", escaped(each));
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n<meta "
      "http-equiv=\"Content-Security-Policy\" content=\"default-src &#39;none&#39;; img-src data:; "
      "style-src &#39;unsafe-inline&#39;\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width\"/><title>{0}</title>\n<style>{1}</style></head>\n<body><h1>{0}"
      "</h1>\n{2}<table>\n{3}</table>\n<h2>Curves</h2>\n{4}<h2>Held-out views</h2>\n{5}"
      "<h2>Settings that differ from the defaults</h2>\n{6}<p>RaySplats-CL "
      "{7}</p>\n</body></html>\n",
      name, kStyle, warnings, facts, charts(run, evaluations), held_out(run, evaluations),
      configuration(run), RAYSPLATS_VERSION);
}

void write_run_report(const fs::path& run, const fs::path& file) {
  write_text_file(file, run_report(run));
}

}  // namespace raysplats
