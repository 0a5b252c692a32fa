// SPDX-License-Identifier: Apache-2.0
#include "io/model/ply_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <functional>
#include <string_view>

#include "io/model/ply_origin.hpp"
#include "io/ply_file.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/options/trace_option_table.hpp"

namespace raysplats {
namespace {

constexpr std::string_view kPrefix = "comment raysplats ";
constexpr std::string_view kOrigin = "origin";
constexpr std::size_t kMaxHeaderLines = 4096;
constexpr std::size_t kMaxLine = 4096;

// A line without its end, cut off where no header would be as long. False at the end of the file.
bool next_line(std::istream& stream, std::string& line) {
  line.clear();
  for (int c = stream.get(); c != '\n'; c = stream.get()) {
    if (c == std::istream::traits_type::eof() || line.size() == kMaxLine) return false;
    line.push_back(static_cast<char>(c));
  }
  if (!line.empty() && line.back() == '\r') line.pop_back();
  return true;
}

template <class T>
bool parse(std::string_view text, T& value) {
  const char* end = text.data() + text.size();
  const auto [next, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && next == end;
}

template <class T>
bool parse_triple(std::string_view text, std::array<T, 3>& values) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t comma = k < 2 ? text.find(',') : text.size();
    if (comma == std::string_view::npos || !parse(text.substr(0, comma), values[k]) ||
        !std::isfinite(values[k])) {
      return false;
    }
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return true;
}

// Coefficients as triples with spaces between them.
bool parse_sky(std::string_view text, SkyLight& sky) {
  constexpr std::array<std::size_t, 5> kSizes{1, 4, 9, 16, 25};  // of degree 0 to 4
  sky.clear();
  while (!text.empty()) {
    const std::size_t space = std::min(text.find(' '), text.size());
    if (!parse_triple(text.substr(0, space), sky.emplace_back())) return false;
    text.remove_prefix(std::min(space + 1, text.size()));
  }
  return std::find(kSizes.begin(), kSizes.end(), sky.size()) != kSizes.end();
}

// What an option of tracing is called in a header.
std::string header_key(std::string name) {
  if (name == "near") return "near_depth";
  std::ranges::replace(name, '-', '_');
  return name;
}

// The options of tracing that a header names.
constexpr std::array kOptions{"hit-order",         "quantile", "adaptive-radius", "near",
                              "min-transmittance", "max-hits", "view-footprint"};

// False for a value that the option cannot have. Keys that are unknown, of a later version perhaps,
// are left alone.
bool set_option(std::string_view key, std::string_view value, TraceOptions& out) {
  // Of any size here: the light of a scene may be brighter than what a picture shows.
  if (key == "background") return parse_triple(value, out.background);
  if (key == "sky") return parse_sky(value, out.sky);
  const std::vector<OptionRow> rows = trace_option_rows(out);
  for (const char* name : kOptions) {
    if (key != header_key(name)) continue;
    try {
      find_row(rows, name)->set({std::string(value)});
    } catch (const UsageError&) {
      return false;
    }
  }
  return true;
}

// Gives every line of the header of a PLY to `take`.
void for_each_line(const std::filesystem::path& path,
                   const std::function<void(const std::string&)>& take) {
  std::ifstream stream(path, std::ios::binary);
  std::string line;
  if (!next_line(stream, line)) return;
  if (line.starts_with(io::kByteOrderMark)) line.erase(0, io::kByteOrderMark.size());
  if (line != "ply") return;
  for (std::size_t n = 0; n < kMaxHeaderLines && next_line(stream, line); ++n) {
    if (line == "end_header") break;
    take(line);
  }
}

// Gives every comment of this program to `take`, which returns false for one that cannot be.
void for_each_comment(const std::filesystem::path& path,
                      const std::function<bool(std::string_view, std::string_view)>& take) {
  for_each_line(path, [&](const std::string& line) {
    if (!line.starts_with(kPrefix)) return;
    const std::string_view text = std::string_view(line).substr(kPrefix.size());
    const std::size_t space = text.find(' ');
    const std::string_view value =
        space == std::string_view::npos ? std::string_view() : text.substr(space + 1);
    if (!take(text.substr(0, space), value)) {
      throw DataError(
          fmt::format("{}: '{}' is nothing that raysplats writes: correct the line of the header, "
                      "or remove it",
                      path.string(), line));
    }
  });
}

std::optional<std::array<double, 3>> said_origin(const std::filesystem::path& path) {
  std::optional<std::array<double, 3>> origin;
  for_each_comment(path, [&](std::string_view key, std::string_view value) {
    return key != kOrigin || parse_triple(value, origin.emplace());
  });
  return origin;
}

bool names_doubles(const std::filesystem::path& path) {
  bool found = false;
  for_each_line(path, [&](const std::string& line) {
    found = found || (line.starts_with("property") && (line.find("double") != std::string::npos ||
                                                       line.find("float64") != std::string::npos));
  });
  return found;
}

}  // namespace

std::string io::ply_option_comments(const TraceOptions& options) {
  const auto& background = options.background;
  std::string out;
  const auto add = [&](std::string_view key, const auto& value) {
    out += fmt::format("{}{} {}\n", kPrefix, key, value);
  };
  TraceOptions written = options;
  const std::vector<OptionRow> rows = trace_option_rows(written);
  for (const char* name : kOptions) {
    std::string text = find_row(rows, name)->text();
    std::erase(text, '"');
    add(header_key(name), text);
  }
  add("background", fmt::format("{},{},{}", background[0], background[1], background[2]));
  if (options.sky.empty()) return out;
  std::string sky;
  for (const auto& [r, g, b] : options.sky)
    sky += fmt::format("{}{},{},{}", sky.empty() ? "" : " ", r, g, b);
  add("sky", sky);
  return out;
}

std::string io::ply_origin_comment(const std::array<double, 3>& origin) {
  if (origin == std::array<double, 3>{}) return "";
  return fmt::format("{}{} {},{},{}\n", kPrefix, kOrigin, origin[0], origin[1], origin[2]);
}

std::string io::flags_to_show(const TraceOptions& shown) {
  TraceOptions told = shown;
  TraceOptions taken = peak_order();
  const std::vector<OptionRow> rows = trace_option_rows(told), defaults = trace_option_rows(taken);
  std::string out;
  const auto add = [&](const std::string& flag) { out += (out.empty() ? "" : " ") + flag; };
  for (const char* name : kOptions) {
    const OptionRow& row = *find_row(rows, name);
    std::string text = row.text();
    if (text == find_row(defaults, name)->text()) continue;
    std::erase(text, '"');
    add(row.flag ? fmt::format("--{}{}", text == "true" ? "" : "no-", name)
                 : fmt::format("--{} {}", name, text));
  }
  // Behind a sky there is no colour.
  const auto& color = shown.background;
  if (shown.sky.empty() && color != taken.background)
    add(fmt::format("--background {},{},{}", color[0], color[1], color[2]));
  return out;
}

std::optional<TraceOptions> read_ply_options(const std::filesystem::path& path) {
  std::optional<TraceOptions> out;
  for_each_comment(path, [&](std::string_view key, std::string_view value) {
    if (key == kOrigin) return true;
    if (!out) out.emplace();
    return set_option(key, value, *out);
  });
  return out;
}

bool io::lacks_origin(const std::filesystem::path& path) {
  return names_doubles(path) && !said_origin(path);
}

std::array<double, 3> read_ply_origin(const std::filesystem::path& path) {
  if (io::lacks_origin(path)) return io::origin_of_doubles(io::PlyFile(path));
  return said_origin(path).value_or(std::array<double, 3>{});
}

}  // namespace raysplats
