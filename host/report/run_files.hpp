// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "report/chart.hpp"
#include "report/figures.hpp"

/// What the files of a training run say, for pages about runs. Members of a run's JSON that are
/// missing or of another type count as 0 or as nothing.
namespace raysplats::report {

/// metrics.json. Throws DataError where there is none.
nlohmann::json metrics_of(const std::filesystem::path& run);
/// Name of the folder, however it was given.
std::string run_name(const std::filesystem::path& run);
/// Names of several: the ends of their paths, each as long as it takes to tell it from the others.
std::vector<std::string> run_names(const std::vector<std::filesystem::path>& runs);
/// Content of a file of at most 64 MiB. Throws DataError for a larger one.
std::string text_of(const std::filesystem::path& path);

/// A number of a JSON object; 0 when it has none.
double number(const nlohmann::json& json, const char* key);
/// A text of a JSON object; "" when it has none.
std::string text(const nlohmann::json& json, const char* key);
/// The command that the run was last resumed by, of its metrics.json; "" for one that never was.
std::string last_command(const nlohmann::json& metrics);
/// The objects of a list.
std::vector<nlohmann::json> objects(const nlohmann::json& json, const char* key);

/// What somebody needs to make a run again: what it is called, and the text of metrics.json.
struct Origin {
  const char* name;
  const char* key;
};
constexpr std::array<Origin, 6> kOrigins{{{"Device", "device"},
                                          {"Driver", "driver"},
                                          {"RaySplats-CL", "version"},
                                          {"Command", "command"},
                                          {"Fingerprint of the data set", "data"},
                                          {"Hash of the model (XXH3, 128 bits)", "model_hash"}}};

/// Columns of metrics.csv by name, empty ones too; rows that are incomplete or no numbers are left
/// out.
std::map<std::string, std::vector<double>> columns_of(const std::filesystem::path& path);
/// One column over another.
Curve curve(const std::string& name,
            const std::map<std::string, std::vector<double>>& columns,
            const std::string& x,
            const std::string& y);
/// One number of all evaluations over another.
Curve evaluated(const std::string& name,
                const std::vector<nlohmann::json>& evaluations,
                const char* x,
                const char* y);

/// "key = value" lines of a configuration.
std::map<std::string, std::string> settings(const std::string& toml);

/// Folder of the last evaluation's pictures, and its views as metrics.json there has them.
std::filesystem::path pictures_of(const std::filesystem::path& run,
                                  const std::vector<nlohmann::json>& evaluations);
std::vector<nlohmann::json> views_of(const std::filesystem::path& run,
                                     const std::vector<nlohmann::json>& evaluations);
/// The picture of a view in that folder, captioned by `what` it is, its name and its PSNR.
Figure picture(const std::filesystem::path& folder,
               const nlohmann::json& view,
               const std::string& what);

}  // namespace raysplats::report
