// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace raysplats::io {
/// Throws std::logic_error, which read_toml() turns into a UsageError.
[[noreturn]] void fail_toml_assertion();
}  // namespace raysplats::io

// In optimised builds toml++ takes its own assertions for granted, and files exist that break them
// ("[[" before a line end): they throw instead, whatever the build.
#pragma push_macro("NDEBUG")
#undef NDEBUG
#define TOML_ASSERT(condition) \
  ((condition) ? static_cast<void>(0) : ::raysplats::io::fail_toml_assertion())
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

namespace raysplats::io {

/// Parses a TOML file. Throws DataError when it cannot be read, UsageError with the line when it is
/// no TOML or a key has more than 64 parts, those of inline tables around it included.
toml::table read_toml(const std::filesystem::path& path);
/// The same of a text; `path` is named in errors.
toml::table parse_toml(std::string_view text, const std::filesystem::path& path);
/// The whole text of a TOML file. Throws DataError when it cannot be read.
std::string read_toml_text(const std::filesystem::path& path);

/// A key with - in place of _.
std::string dashed(std::string_view key);
/// "a list", "true or false" and so on: what a value is, for messages.
std::string type_name(const toml::node& node);
/// A number, text or truth value as text, or a list of them; none for tables, dates and lists that
/// hold such or lists.
std::optional<std::vector<std::string>> value_texts(const toml::node& node);

/// One table of a TOML file, read key by key: every reading marks its key as known, and finish()
/// refuses what nobody asked for. Keys are written with - or _. What is wrong is a UsageError of
/// one sentence with file and line, a file that a key names and that is not there a DataError.
class TomlTable {
 public:
  /// `name` is how messages call the table. The table and `file` have to outlive this.
  TomlTable(const toml::table& table, const std::filesystem::path& file, std::string name);

  bool has(std::string_view key);
  /// Refuses a key that is there but has no use: it "is for" something else.
  void only_for(std::string_view key, bool used, std::string_view what);
  /// Reads a number into `target` if the key is there; whole ones for integer types.
  void number(std::string_view key, double& target, double low, double high);
  void number(std::string_view key, float& target, double low, double high);
  void number(std::string_view key, int& target, double low, double high);
  std::optional<double> number(std::string_view key, double low, double high);
  void flag(std::string_view key, bool& target);
  std::optional<std::string> text(std::string_view key);
  /// Hands the value of an option to `set` (OptionRow::set) if the key is there: a number, text or
  /// truth value, or a list of them, as texts.
  void option(std::string_view key,
              const std::function<void(const std::vector<std::string>&)>& set);
  /// Three numbers.
  void vector(std::string_view key, std::array<float, 3>& target, double low, double high);
  std::optional<glm::dvec3> vector(std::string_view key);
  /// The same, not all zero.
  std::optional<glm::dvec3> direction(std::string_view key);
  /// A list of `count` finite numbers, or of any length for 0.
  std::optional<std::vector<double>> numbers(std::string_view key, std::size_t count);
  /// A file or folder that exists; relative ones lie beside the TOML file.
  std::optional<std::filesystem::path> existing(std::string_view key);
  template <class E>
  void choice(std::string_view key, E& target, const std::vector<std::pair<std::string, E>>& names);

  bool is_table(std::string_view key);
  bool is_number(std::string_view key);
  /// Tables below this one; `list` are those of [[key]].
  std::optional<TomlTable> table(std::string_view key);
  std::vector<TomlTable> list(std::string_view key);
  /// Every key with its text, for tables that map names to names.
  std::vector<std::pair<std::string, std::string>> texts();

  /// Refuses keys that were not asked for, with the nearest one that was.
  void finish() const;
  /// Refuses a key, or the table where it has no such key.
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  /// "FILE, line N".
  std::string place(std::string_view key = {}) const;
  const std::string& name() const { return name_; }
  const std::filesystem::path& file() const { return *file_; }

 private:
  const toml::node* find(std::string_view key) const;
  const toml::node* take(std::string_view key);
  double finite(const toml::node& node, std::string_view key, std::string_view wanted) const;
  [[noreturn]] void not_one_of(std::string_view key,
                               const std::string& value,
                               const std::vector<std::string>& names) const;

  const toml::table* table_;
  const std::filesystem::path* file_;
  std::string name_;
  std::set<std::string, std::less<>> known_;
};

template <class E>
void TomlTable::choice(std::string_view key,
                       E& target,
                       const std::vector<std::pair<std::string, E>>& names) {
  const std::optional<std::string> value = text(key);
  if (!value) return;
  std::vector<std::string> all;
  for (const auto& [label, meaning] : names) {
    if (label == *value) {
      target = meaning;
      return;
    }
    all.push_back(label);
  }
  not_one_of(key, *value, all);
}

}  // namespace raysplats::io
