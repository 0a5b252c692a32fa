// SPDX-License-Identifier: Apache-2.0
#include "io/toml_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"
#include "util/nearest_name.hpp"
#include "util/number_text.hpp"

namespace raysplats::io {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{16} << 20;
constexpr std::size_t kMaxKeyParts = 64;
constexpr double kMaxInt = std::numeric_limits<int>::max();

/// What a range accepts, after "a number" or "three numbers"; "" where it accepts all.
std::string range(double low, double high) {
  return number_words(false, low, high).substr(std::string_view("a number").size());
}

}  // namespace

namespace {

/// The end of the string that begins at `begin` with a quote; the end of its line, or of the text,
/// when it has none.
std::size_t string_end(std::string_view text, std::size_t begin) {
  const char quote = text[begin];
  const std::string_view triple = quote == '"' ? "\"\"\"" : "'''";
  const bool lines = text.substr(begin, 3) == triple;
  std::size_t i = begin + (lines ? 3 : 1);
  while (i < text.size()) {
    if (quote == '"' && text[i] == '\\') {
      i += 2;
    } else if (!lines && (text[i] == quote || text[i] == '\n')) {
      return text[i] == quote ? i + 1 : i;
    } else if (lines && text.substr(i, 3) == triple) {
      i += 3;
      // Up to two quotes before the closing ones belong to the text.
      for (int extra = 0; extra < 2 && i < text.size() && text[i] == quote; ++extra) ++i;
      return i;
    } else {
      ++i;
    }
  }
  return text.size();
}

/// The parts of the keys around a place outside of strings and comments.
class KeyDepth {
 public:
  /// Of the place behind the letter.
  std::size_t behind(char letter) {
    if (letter == '.') {
      ++dots_;
    } else if (letter == '=') {
      key_ = dots_ + 1;
      dots_ = 0;
    } else if (letter == '{' || letter == '[') {
      open_.push_back(outer_);
      outer_ += key_;
      key_ = dots_ = 0;
    } else if (letter == '}' || letter == ']') {
      if (!open_.empty()) {
        outer_ = open_.back();
        open_.pop_back();
      }
      key_ = dots_ = 0;
    } else if (letter == ',' || letter == '\n') {
      key_ = dots_ = 0;
    }
    return outer_ + dots_ + 1;
  }

 private:
  std::vector<std::size_t> open_;  // outer_ before each open brace or bracket
  std::size_t outer_ = 0;          // of the keys that these belong to
  std::size_t key_ = 0;            // of the one whose value it is
  std::size_t dots_ = 0;           // one in numbers and dates
};

/// Refuses what toml++ 3.1 is not safe from. TOML has letters beyond ASCII in strings and comments
/// alone, and some of them get elsewhere to where its authors say that no program gets
/// (is_non_ascii_horizontal_whitespace). Each part of a key is a table in a table, which are
/// destroyed one within the other.
void check_text(std::string_view text, const std::filesystem::path& path) {
  KeyDepth depth;
  std::size_t i = text.starts_with("\xef\xbb\xbf") ? 3 : 0;
  const auto fail = [&](const std::string& what) {
    throw UsageError(fmt::format(
        "{}, line {}: {}", path.string(),
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n'), what));
  };
  while (i < text.size()) {
    if (text[i] == '#') {
      i = std::min(text.find('\n', i), text.size());
    } else if (text[i] == '"' || text[i] == '\'') {
      i = string_end(text, i);
    } else if ((static_cast<unsigned char>(text[i]) & 0x80u) != 0) {
      fail("a letter beyond ASCII stands outside of quotes");
    } else if (depth.behind(text[i]) > kMaxKeyParts) {
      fail(fmt::format("a key has more than {} parts: write a shorter one", kMaxKeyParts));
    } else {
      ++i;
    }
  }
}

}  // namespace

void fail_toml_assertion() { throw std::logic_error("an assertion of toml++"); }

std::string type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "a list";
    case toml::node_type::string:
      return "a text";
    case toml::node_type::integer:
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "true or false";
    default:
      return "a date";
  }
}

std::optional<std::vector<std::string>> value_texts(const toml::node& node) {
  std::vector<std::string> out;
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& item : *list) {
      if (item.is_array()) return std::nullopt;
      std::optional<std::vector<std::string>> text = value_texts(item);
      if (!text) return std::nullopt;
      out.push_back(std::move(text->front()));
    }
    return out;
  }
  if (node.is_string()) {
    out.push_back(node.value<std::string>().value_or(""));
  } else if (node.is_integer()) {
    out.push_back(fmt::format("{}", node.value<std::int64_t>().value_or(0)));
  } else if (node.is_floating_point()) {
    out.push_back(fmt::format("{}", node.value<double>().value_or(0.0)));
  } else if (node.is_boolean()) {
    out.emplace_back(node.value<bool>().value_or(false) ? "true" : "false");
  } else {
    return std::nullopt;
  }
  return out;
}

std::string read_toml_text(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_file(path, kMaxBytes);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

toml::table parse_toml(std::string_view text, const std::filesystem::path& path) {
  check_text(text, path);
  try {
    return toml::parse(text, path.string());
  } catch (const toml::parse_error& error) {
    std::string reason(error.description());
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    throw UsageError(
        fmt::format("{}, line {}: {}", path.string(), error.source().begin.line, reason));
  } catch (const std::logic_error&) {
    throw UsageError(fmt::format("{} is no TOML: look for '[', quotes and keys without their rest",
                                 path.string()));
  }
}

std::string dashed(std::string_view key) {
  std::string out(key);
  std::replace(out.begin(), out.end(), '_', '-');
  return out;
}

toml::table read_toml(const std::filesystem::path& path) {
  return parse_toml(read_toml_text(path), path);
}

TomlTable::TomlTable(const toml::table& table, const std::filesystem::path& file, std::string name)
    : table_(&table), file_(&file), name_(std::move(name)) {}

const toml::node* TomlTable::find(std::string_view key) const {
  const toml::node* found = nullptr;
  for (const auto& [name, node] : *table_) {
    if (dashed(name.str()) != key) continue;
    if (found != nullptr) fail(key, fmt::format("'{}' is there twice, with - and with _", key));
    found = &node;
  }
  return found;
}

const toml::node* TomlTable::take(std::string_view key) {
  known_.emplace(key);
  return find(key);
}

std::string TomlTable::place(std::string_view key) const {
  const toml::node* node = nullptr;
  for (const auto& [name, value] : *table_) {
    if (node == nullptr && dashed(name.str()) == key) node = &value;
  }
  const auto line = (node != nullptr ? node : table_)->source().begin.line;
  return line == 0 ? file_->string() : fmt::format("{}, line {}", file_->string(), line);
}

void TomlTable::fail(std::string_view key, const std::string& message) const {
  throw UsageError(fmt::format("{}: {}", place(key), message));
}

void TomlTable::not_one_of(std::string_view key,
                           const std::string& value,
                           const std::vector<std::string>& names) const {
  fail(key, fmt::format("'{}' in {} is {}, not '{}'", key, name_, fmt::join(names, " or "), value));
}

void TomlTable::only_for(std::string_view key, bool used, std::string_view what) {
  if (!used && has(key)) fail(key, fmt::format("'{}' is for {}", key, what));
}

bool TomlTable::has(std::string_view key) { return take(key) != nullptr; }

double TomlTable::finite(const toml::node& node,
                         std::string_view key,
                         std::string_view wanted) const {
  const std::optional<double> value =
      node.is_number() ? node.value<double>() : std::optional<double>();
  if (!value) {
    fail(key, fmt::format("'{}' in {} has to be {}, not {}", key, name_, wanted, type_name(node)));
  }
  if (!std::isfinite(*value)) {
    fail(key, fmt::format("'{}' in {} is not a finite number", key, name_));
  }
  return *value;
}

std::optional<double> TomlTable::number(std::string_view key, double low, double high) {
  const toml::node* node = take(key);
  if (node == nullptr) return std::nullopt;
  const double value = finite(*node, key, "a number");
  if (value < low || value > high) {
    fail(key, fmt::format("'{}' in {} has to be a number{}, not {:g}", key, name_, range(low, high),
                          value));
  }
  return value;
}

void TomlTable::number(std::string_view key, double& target, double low, double high) {
  target = number(key, low, high).value_or(target);
}

void TomlTable::number(std::string_view key, float& target, double low, double high) {
  const std::optional<double> value = number(key, low, high);
  if (value) target = static_cast<float>(*value);
}

void TomlTable::number(std::string_view key, int& target, double low, double high) {
  const std::optional<double> value = number(key, low, std::min(high, kMaxInt));
  if (!value) return;
  if (*value != std::floor(*value)) {
    fail(key, fmt::format("'{}' in {} has to be a whole number, not {:g}", key, name_, *value));
  }
  target = static_cast<int>(*value);
}

void TomlTable::flag(std::string_view key, bool& target) {
  const toml::node* node = take(key);
  if (node == nullptr) return;
  if (!node->is_boolean()) {
    fail(key,
         fmt::format("'{}' in {} has to be true or false, not {}", key, name_, type_name(*node)));
  }
  target = node->value<bool>().value_or(target);
}

std::optional<std::string> TomlTable::text(std::string_view key) {
  const toml::node* node = take(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_string()) {
    fail(key, fmt::format("'{}' in {} has to be a text in quotes, not {}", key, name_,
                          type_name(*node)));
  }
  return node->value<std::string>();
}

void TomlTable::option(std::string_view key,
                       const std::function<void(const std::vector<std::string>&)>& set) {
  const toml::node* node = take(key);
  if (node == nullptr) return;
  const std::optional<std::vector<std::string>> texts = value_texts(*node);
  if (!texts) {
    fail(key,
         fmt::format("'{}' in {} has to be a value or a list of values, not {}", key, name_,
                     node->is_array() ? "a list of lists, tables or dates" : type_name(*node)));
  }
  try {
    set(*texts);
  } catch (const UsageError& error) {
    fail(key, fmt::format("{} ({})", error.what(), name_));
  }
}

std::optional<std::vector<double>> TomlTable::numbers(std::string_view key, std::size_t count) {
  const toml::node* node = take(key);
  if (node == nullptr) return std::nullopt;
  const std::string wanted =
      count == 0 ? "a list of numbers" : fmt::format("a list of {} numbers", count);
  const toml::array* list = node->as_array();
  if (list == nullptr) {
    fail(key, fmt::format("'{}' in {} has to be {}, not {}", key, name_, wanted, type_name(*node)));
  }
  if (count != 0 && list->size() != count) {
    fail(key, fmt::format("'{}' in {} has to be {}, not of {}", key, name_, wanted, list->size()));
  }
  std::vector<double> out;
  for (const toml::node& item : *list) out.push_back(finite(item, key, wanted));
  return out;
}

std::optional<glm::dvec3> TomlTable::vector(std::string_view key) {
  const auto values = numbers(key, 3);
  if (!values) return std::nullopt;
  return glm::dvec3((*values)[0], (*values)[1], (*values)[2]);
}

std::optional<glm::dvec3> TomlTable::direction(std::string_view key) {
  const std::optional<glm::dvec3> value = vector(key);
  if (value && *value == glm::dvec3(0.0)) {
    fail(key,
         fmt::format("'{}' in {} is no direction: one of its numbers must not be 0", key, name_));
  }
  return value;
}

void TomlTable::vector(std::string_view key,
                       std::array<float, 3>& target,
                       double low,
                       double high) {
  // One number is a grey.
  const std::optional<glm::dvec3> value =
      is_number(key) ? glm::dvec3(*number(key, -kNoBound, kNoBound)) : vector(key);
  if (!value) return;
  for (std::size_t k = 0; k < 3; ++k) {
    const double number = (*value)[static_cast<int>(k)];
    if (number < low || number > high) {
      fail(key, fmt::format("'{}' in {} has to be three numbers{}, not {:g}", key, name_,
                            range(low, high), number));
    }
    target[k] = static_cast<float>(number);
  }
}

std::optional<std::filesystem::path> TomlTable::existing(std::string_view key) {
  const std::optional<std::string> value = text(key);
  if (!value) return std::nullopt;
  if (value->empty()) fail(key, fmt::format("'{}' in {} is empty: name a file", key, name_));
  const std::filesystem::path path = file_->parent_path() / *value;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw DataError(fmt::format("{}: {} does not exist: paths are relative to the scene file",
                                place(key), path.string()));
  }
  return path;
}

bool TomlTable::is_table(std::string_view key) {
  const toml::node* node = take(key);
  return node != nullptr && node->is_table();
}

bool TomlTable::is_number(std::string_view key) {
  const toml::node* node = take(key);
  return node != nullptr && node->is_number();
}

std::optional<TomlTable> TomlTable::table(std::string_view key) {
  const toml::node* node = take(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_table()) {
    fail(key, fmt::format("'{}' in {} has to be a table, not {}", key, name_, type_name(*node)));
  }
  return TomlTable(*node->as_table(), *file_, fmt::format("[{}]", key));
}

std::vector<TomlTable> TomlTable::list(std::string_view key) {
  const toml::node* node = take(key);
  std::vector<TomlTable> out;
  if (node == nullptr) return out;
  const std::string name = fmt::format("[[{}]]", key);
  const toml::array* items = node->as_array();
  if (items == nullptr) {
    fail(key, fmt::format("'{}' has to be written {}, once per {}", key, name, key));
  }
  for (const toml::node& item : *items) {
    if (!item.is_table()) fail(key, fmt::format("{} holds {}", name, type_name(item)));
    out.emplace_back(*item.as_table(), *file_, name);
  }
  return out;
}

std::vector<std::pair<std::string, std::string>> TomlTable::texts() {
  std::vector<std::pair<std::string, std::string>> out;
  for (const auto& [name, node] : *table_) {
    if (!node.is_string()) {
      throw UsageError(fmt::format("{}, line {}: '{}' in {} has to be a text in quotes, not {}",
                                   file_->string(), node.source().begin.line, name.str(), name_,
                                   type_name(node)));
    }
    out.emplace_back(std::string(name.str()), node.value<std::string>().value_or(""));
  }
  return out;
}

void TomlTable::finish() const {
  for (const auto& [name, node] : *table_) {
    const std::string key = dashed(name.str());
    if (known_.contains(key)) continue;
    throw UsageError(
        fmt::format("{}, line {}: unknown key '{}' in {}{}", file_->string(),
                    node.source().begin.line, name.str(), name_,
                    did_you_mean(key, {known_.begin(), known_.end()},
                                 fmt::format(": use one of {}", fmt::join(known_, ", ")))));
  }
}

}  // namespace raysplats::io
