// SPDX-License-Identifier: Apache-2.0
#include "eval/former_pictures.hpp"

#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "render/output_check.hpp"
#include "util/file_kind.hpp"

namespace raysplats {

std::set<std::string> former_pictures(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "metrics.json";
  if (!is_file(file) || data_set_of(folder)) return {};
  std::ifstream stream(file, std::ios::binary);
  const nlohmann::json json = nlohmann::json::parse(stream, nullptr, false);
  if (!json.is_object() || !json.contains("images")) return {};
  std::set<std::string> out;
  for (const nlohmann::json& image : json["images"]) {
    if (!image.is_object() || !image.contains("picture") || !image["picture"].is_string()) continue;
    const std::filesystem::path name = image["picture"].get<std::string>();
    if (name == name.filename() && name.extension() == ".png") out.insert(name.string());
  }
  return out;
}

std::vector<std::string> replaced_names(const std::set<std::string>& former,
                                        const Dataset& dataset,
                                        Split split,
                                        bool all_shown) {
  std::vector<std::string> names = evaluated_names(dataset, split);
  if (!all_shown)
    std::erase_if(names, [&](const std::string& name) { return !former.contains(name + ".png"); });
  return names;
}

void remove_former_pictures(const std::filesystem::path& folder,
                            std::set<std::string> former,
                            const EvaluationReport& report) {
  for (const EvaluationMetrics& image : report.images) former.erase(image.picture);
  std::error_code error;
  for (const std::string& file : former) std::filesystem::remove(folder / file, error);
}

}  // namespace raysplats
