// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "completion.hpp"
#include "raysplats/error.hpp"
#include "render/output_check.hpp"
#include "util/atomic_file.hpp"
#include "util/output_directory.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string shell;
  std::string folder;
};

void print_completion(const CLI::App& app, const std::string& shell) {
  const CommandEntry program = command_tree(app);
  fmt::print("{}", shell == "bash"  ? bash_completion(program)
                   : shell == "zsh" ? zsh_completion(program)
                                    : fish_completion(program));
}

void write_manual(const CLI::App& app, const std::filesystem::path& folder) {
  const CommandEntry program = command_tree(app);
  if (const auto data = data_set_of(folder)) {
    throw UsageError(fmt::format("The folder {} belongs to the data set {}: choose another",
                                 folder.string(), data->string()));
  }
  make_output_directory(folder);
  write_text_file(folder / "raysplats.1", manual_page(program, RAYSPLATS_VERSION));
  for (const CommandEntry& command : program.commands) {
    write_text_file(folder / fmt::format("raysplats-{}.1", command.name),
                    manual_page(program, command, RAYSPLATS_VERSION));
  }
  fmt::print("{} manual pages in {}\n", program.commands.size() + 1, folder.string());
}

}  // namespace

Command add_completion_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("completion", "Print the completion of commands and options for a shell");
  auto options = std::make_shared<Options>();
  command->add_option("SHELL", options->shell, "bash, zsh or fish")
      ->required()
      ->check(one_of({"bash", "zsh", "fish"}))
      ->type_name("");
  return {command, [&app, options] { print_completion(app, options->shell); }};
}

Command add_manual_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("manual", "Write the manual pages into a folder");
  auto options = std::make_shared<Options>();
  command->add_option("DIR", options->folder, "Folder for raysplats.1 and a page for each command")
      ->required()
      ->check(not_empty())
      ->type_name("");
  return {command, [&app, options] { write_manual(app, options->folder); }};
}

}  // namespace raysplats::cli
