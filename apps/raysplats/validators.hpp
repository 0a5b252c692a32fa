// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <string>
#include <vector>

namespace raysplats::cli {

// Validators whose messages are one sentence.

CLI::Validator above(double low);
CLI::Validator between(double low, double high);
/// Whole numbers, in every spelling that configuration files know (1_000, 1e3).
CLI::Validator whole_between(double low, double high);
/// 0 to 2^64 - 1.
CLI::Validator seed();
/// Its name is the words with '|' between them (command_tree()).
CLI::Validator one_of(std::vector<std::string> names);
/// The name of what is written: an empty one, as of a shell's variable that is not set, would be
/// the folder that one is in.
CLI::Validator not_empty();
/// Three numbers with commas, for example a colour or a direction, and what it has accepted.
CLI::Validator triple();
std::array<double, 3> parse_triple(const std::string& text);
/// The six numbers of a box, as --bounds has them, and what it has accepted.
CLI::Validator box();
std::array<double, 6> parse_box(const std::string& text);

}  // namespace raysplats::cli
