// SPDX-License-Identifier: Apache-2.0
#include "io/text_reader.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";

template <class T>
bool parse(std::string_view token, T& value) {
  // from_chars takes no plus sign, which printf's %+ writes.
  if (token.size() > 1 && token[0] == '+' && token[1] != '-') token.remove_prefix(1);
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  return error == std::errc() && end == token.data() + token.size();
}

}  // namespace

bool parse_number(std::string_view token, double& value) {
  if (parse(token, value)) return true;
  // from_chars does not say on which side of its range a number lies.
  long double wide = 0;
  if (!parse(token, wide) || std::abs(wide) > 1) return false;
  value = 0;
  return true;
}
bool parse_number(std::string_view token, std::uint64_t& value) { return parse(token, value); }
bool parse_number(std::string_view token, std::int32_t& value) { return parse(token, value); }

std::string excerpt(std::string_view text, std::size_t most) {
  if (text.size() <= most) return std::string(text);
  std::size_t end = most;
  // Bytes within a character have the bits 10 first.
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return std::string(text.substr(0, end)) + "...";
}

TextReader::TextReader(std::span<const std::byte> bytes, std::filesystem::path path)
    : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()), path_(std::move(path)) {
  if (text_.starts_with(kByteOrderMark)) mark_ = kByteOrderMark.size();
  text_.remove_prefix(mark_);
}

bool TextReader::next_line() {
  if (at_end()) return false;
  const std::size_t end = std::min(text_.find('\n', next_), text_.size());
  line_ = text_.substr(next_, end - next_);
  next_ = end + 1;
  ++line_number_;
  return true;
}

bool TextReader::next_content_line() {
  while (next_line()) {
    const std::size_t first = line_.find_first_not_of(kBlanks);
    if (first != std::string_view::npos && line_[first] != '#') return true;
  }
  return false;
}

std::string_view TextReader::word() {
  line_.remove_prefix(std::min(line_.find_first_not_of(kBlanks), line_.size()));
  const std::string_view word =
      line_.substr(0, std::min(line_.find_first_of(kBlanks), line_.size()));
  line_.remove_prefix(word.size());
  return word;
}

double TextReader::number(const char* what) {
  const std::string_view token = word();
  double value = 0;
  if (token.empty()) fail(fmt::format("{} is missing", what));
  if (!parse_number(token, value))
    fail(fmt::format("{} is '{}', not a number", what, excerpt(token)));
  return value;
}

std::uint64_t TextReader::unsigned_integer(const char* what) {
  const std::string_view token = word();
  std::uint64_t value = 0;
  if (token.empty()) fail(fmt::format("{} is missing", what));
  if (!parse_number(token, value)) {
    fail(fmt::format("{} is '{}', not a whole number", what, excerpt(token)));
  }
  return value;
}

std::string_view TextReader::rest() {
  const std::size_t first = line_.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return line_.substr(first, line_.find_last_not_of(kBlanks) - first + 1);
}

void TextReader::fail(const std::string& message) const {
  throw DataError(fmt::format("{}: {} in line {}", path_.string(), message, line_number_));
}

}  // namespace raysplats::io
