// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "device/context_impl.hpp"
#include "device/kernel_sources.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

std::string load(const std::string& path, const std::string& directory) {
  if (!directory.empty()) {
    std::ifstream file(directory + "/" + path, std::ios::binary);
    if (!file) {
      throw DeviceError(fmt::format(
          "Kernel file {}/{} cannot be read: give --kernels, or RAYSPLATS_KERNEL_DIR, a whole "
          "folder of kernels like cl/ of the source",
          directory, path));
    }
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  const auto found = kernel_sources().find(path);
  if (found == kernel_sources().end())
    throw DeviceError(fmt::format("No kernel file '{}' is built in", path));
  return found->second;
}

void append(const std::string& path,
            const std::string& directory,
            std::set<std::string>& seen,
            std::string& out) {
  if (!seen.insert(path).second) return;
  std::istringstream lines(load(path, directory));
  out += fmt::format("#line 1 \"{}\"\n", path);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    static const std::string kInclude = "#include \"";
    if (line.compare(0, kInclude.size(), kInclude) == 0) {
      const std::size_t end = line.find('"', kInclude.size());
      append(line.substr(kInclude.size(), end - kInclude.size()), directory, seen, out);
      out += fmt::format("#line {} \"{}\"\n", number + 1, path);
    } else {
      out += line + "\n";
    }
  }
}

}  // namespace

std::string kernel_folder(const std::string& directory) {
  const char* named = std::getenv("RAYSPLATS_KERNEL_DIR");
  return !directory.empty() || named == nullptr ? directory : named;
}

std::string resolve_kernel_source(const std::string& path, const std::string& directory) {
  std::set<std::string> seen;
  std::string out;
  append(path, kernel_folder(directory), seen, out);
  return out;
}

}  // namespace raysplats
