// SPDX-License-Identifier: Apache-2.0
#include "report/run_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>

#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"
#include "util/number_text.hpp"

namespace raysplats::report {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::uint64_t kMostText = std::uint64_t{64} << 20;

}  // namespace

nlohmann::json metrics_of(const fs::path& run) {
  std::error_code error;
  if (!fs::is_regular_file(run / "metrics.json", error)) {
    throw DataError(
        is_there(run)
            ? fmt::format("{} is no training run: it holds no metrics.json", run.string())
            : fmt::format("{} does not exist: name the folder of a training run", run.string()));
  }
  return io::read_json_object(run / "metrics.json");
}

std::string run_name(const fs::path& run) { return run_names({run}).front(); }

std::vector<std::string> run_names(const std::vector<fs::path>& runs) {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>> above;  // the nearest folder last
  for (const fs::path& run : runs) {
    std::vector<std::string> parts;
    for (const fs::path& part : fs::absolute(run).lexically_normal().relative_path())
      if (!part.empty()) parts.push_back(part.string());
    names.push_back(parts.empty() ? "" : parts.back());
    if (!parts.empty()) parts.pop_back();
    above.push_back(std::move(parts));
  }
  for (bool longer = true; longer;) {
    longer = false;
    std::map<std::string, std::size_t> count;
    for (const std::string& name : names) ++count[name];
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (count[names[i]] == 1 || above[i].empty()) continue;
      names[i] = above[i].back() + "/" + names[i];
      above[i].pop_back();
      longer = true;
    }
  }
  return names;
}

std::string text_of(const fs::path& path) {
  std::error_code error;
  if (fs::file_size(path, error) > kMostText && !error)
    throw DataError(fmt::format("{} is too large for a file of a run", path.string()));
  std::ifstream stream(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

double number(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : 0.0;
}

std::string text(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

std::string last_command(const Json& metrics) {
  const auto list = metrics.find("commands");
  const bool some = list != metrics.end() && list->is_array() && !list->empty();
  return some && list->back().is_string() ? list->back().get<std::string>() : "";
}

std::vector<Json> objects(const Json& json, const char* key) {
  std::vector<Json> out;
  const auto found = json.find(key);
  if (found == json.end() || !found->is_array()) return out;
  std::copy_if(found->begin(), found->end(), std::back_inserter(out),
               [](const Json& each) { return each.is_object(); });
  return out;
}

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
  for (const std::string& name : names) out[name];
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
            const std::map<std::string, std::vector<double>>& columns,
            const std::string& x,
            const std::string& y) {
  Curve out{name, {}};
  const auto from = columns.find(x), to = columns.find(y);
  if (from == columns.end() || to == columns.end()) return out;
  for (std::size_t i = 0; i < std::min(from->second.size(), to->second.size()); ++i)
    out.points.emplace_back(from->second[i], to->second[i]);
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

fs::path pictures_of(const fs::path& run, const std::vector<Json>& evaluations) {
  if (evaluations.empty()) return {};
  return run / "eval" / fmt::format("iteration_{:.0f}", number(evaluations.back(), "iteration"));
}

std::vector<Json> views_of(const fs::path& run, const std::vector<Json>& evaluations) {
  const fs::path file = pictures_of(run, evaluations) / "metrics.json";
  std::error_code error;
  if (evaluations.empty() || !fs::is_regular_file(file, error)) return {};
  return objects(io::read_json_object(file), "images");
}

Figure picture(const fs::path& folder, const Json& view, const std::string& what) {
  Figure out;
  out.name = text(view, "name");
  out.caption = fmt::format("{}: {}, {:.2f} dB", what, out.name, number(view, "psnr"));
  fs::path name = text(view, "picture");
  // Runs of older versions do not say it.
  if (name.empty()) name = fs::path(out.name).stem().concat(".png");
  const fs::path file = folder / name.filename();
  std::error_code error;
  if (fs::is_regular_file(file, error)) out.file = file;
  return out;
}

}  // namespace raysplats::report
