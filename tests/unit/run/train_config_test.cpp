// SPDX-License-Identifier: Apache-2.0
#include "run/train_config.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "build_paths.hpp"
#include "raysplats/error.hpp"
#include "run/checkpoint.hpp"
#include "run/train_option_table.hpp"
#include "unit/log_capture.hpp"
#include "unit/temporary_directory.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;

namespace {

std::filesystem::path temporary(const std::string& name) {
  return std::filesystem::temp_directory_path() / ("raysplats_config_test_" + name);
}

std::string message_of(const std::filesystem::path& path) {
  TrainOptions options;
  try {
    read_train_config(path, options);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TrainOptions parse(const std::vector<std::string>& arguments) {
  CLI::App app;
  CLI::App* train = app.add_subcommand("train");
  TrainOptions options;
  add_train_options(*train, options);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  reversed.push_back("train");
  app.parse(reversed);
  return options;
}

}  // namespace

TEST_CASE("the configuration written is the configuration read") {
  TrainOptions options;
  options.iterations = 1234;
  options.background = "0.25,0.5,1";
  options.eval_at = {};
  options.save_at = {10, 20};
  options.position_lr = {3e-4, 7e-7};
  options.scale_activation = ScaleActivation::kSigmoid;
  options.trace.hit_order = HitOrder::kPeak;
  options.trace.adaptive_radius = false;
  options.adam_epsilon = 1e-15;
  options.seed = 12345678901234567890ull;
  options.data.test_list = {"a b.png", "left/it's \"1\".png", "#2.png", "seed = 3"};
  const auto path = temporary("round.toml");
  write_text_file(path, to_toml(options));
  TrainOptions read;
  read_train_config(path, read);
  CHECK(to_toml(read) == to_toml(options));
  CHECK(read.seed == options.seed);
  CHECK(read.data.test_list == options.data.test_list);
  CHECK(read.eval_at.empty());
  CHECK(read.save_at == options.save_at);
  CHECK(read.position_lr.final_value == options.position_lr.final_value);
  CHECK(background_color(read, false) == std::array<float, 3>{0.25f, 0.5f, 1.0f});
  std::filesystem::remove(path);
}

TEST_CASE("the configurations of the project are valid and the default one documents every key") {
  const std::filesystem::path folder = std::filesystem::path(test::source_dir()) / "configs";
  TrainOptions defaults;
  TrainOptions read;
  read.iterations = 1;
  read_train_config(folder / "default.toml", read);
  CHECK(to_toml(read) == to_toml(defaults));
  std::ifstream stream(folder / "default.toml");
  const std::string text((std::istreambuf_iterator<char>(stream)),
                         std::istreambuf_iterator<char>());
  for (const OptionRow& key : train_option_rows(defaults)) {
    INFO(key.name);
    CHECK(text.find("\n" + key.name + " = ") != std::string::npos);
    CHECK(!key.help.empty());
  }
  TrainOptions paper;
  read_train_config(folder / "paper.toml", paper);
  CHECK(paper.trace.hit_order == HitOrder::kEntry);
  CHECK(paper.trace.traversal == Traversal::kBvh);
  CHECK(paper.scale_activation == ScaleActivation::kSigmoid);
  CHECK(paper.sh_degree == 0);
  CHECK(paper.pixel_loss == PixelLoss::kL2);
  TrainOptions quick;
  read_train_config(folder / "quick.toml", quick);
  CHECK(defaults.iterations == kFittedLength);
  CHECK(quick.iterations == 4000);
}

TEST_CASE("an unknown key is refused with the nearest one") {
  const auto path = temporary("typo.toml");
  write_text_file(path, "iteration = 5\n");
  CHECK(message_of(path).find("'iterations'") != std::string::npos);
  write_text_file(path, "[train]\nssim-wight = 0.1\n");
  CHECK(message_of(path).find("'ssim-weight'") != std::string::npos);
  write_text_file(path, "[render]\niterations = 5\n");
  CHECK(message_of(path).find("line 1: the table [render] is unknown") != std::string::npos);
  std::filesystem::remove(path);
  CHECK(message_of(temporary("missing.toml")).find("cannot be read") != std::string::npos);
}

TEST_CASE("keys of earlier versions are taken, and their options") {
  const auto path = temporary("retired.toml");
  write_text_file(path, "exposure-lr = 0.01\nseed = 7\n");
  TrainOptions read;
  read_train_config(path, read);
  CHECK(read.seed == 7);
  CHECK(to_toml(read).find("exposure-lr") == std::string::npos);
  std::filesystem::remove(path);
  CLI::App app;
  TrainOptions options;
  add_train_options(app, options);
  app.parse("--exposure-lr-final 0.001 --seed 8");
  CHECK(options.seed == 8);
  CHECK(app.help().find("exposure-lr") == std::string::npos);
}

TEST_CASE("values out of range and of the wrong kind are refused by name") {
  const auto path = temporary("range.toml");
  for (const std::string line : {"iterations = -2",
                                 "iterations = 1.5",
                                 "iterations = many",
                                 "ssim-weight = 1.5",
                                 "ssim-weight = nan",
                                 "hit-order = \"depth\"",
                                 "adaptive-radius = 2",
                                 "background = \"red\"",
                                 "background = \"1,1\"",
                                 "background = \"1,1,2\"",
                                 "packet-width = 3",
                                 "resolution-schedule = [20, 10]",
                                 "resolution-schedule = [\"4:10\", 20]",
                                 "resolution-schedule = [\"0:10\"]",
                                 "resolution-schedule = [\"4:\"]",
                                 "eval-at = [0.5, 1.5]",
                                 "densify-until = -0.1",
                                 "densify-from = 2.5",
                                 "strategy = \"grow\"",
                                 "eval-at = [0]",
                                 "position-lr-final = 0",
                                 "rotation-lr = -1",
                                 "position-lr = -0.5",
                                 "init-opacity = -0.5",
                                 "init-opacity = 0",
                                 "opacity-decay = -0.1",
                                 "sh-degree = 5",
                                 "iterations = [1, 2]"}) {
    INFO(line);
    write_text_file(path, line + "\n");
    CHECK(message_of(path) != "");
  }
  write_text_file(path, "opacity-lr = 0\n");  // off, to the end
  CHECK(message_of(path) == "");
  write_text_file(
      path, "position-lr = 0 # off\nposition-lr-final = 0\n\n# comment\neval-at = [1,\n 2]\n");
  CHECK(message_of(path) == "");
  std::filesystem::remove(path);
}

TEST_CASE("every spelling of a list is the same list, in files and on the command line") {
  using List = std::vector<RunShare>;
  const List expected{300, 1000};
  const std::vector<ResolutionStep> sizes{{4, 300}, {2, 1000}};
  const auto path = temporary("lists.toml");
  for (const std::string value :
       {"[300, 1000]", "[300,1000,]", "[\n  300, # first\n  1_000,\n]", "\"300,1000\"",
        "\"[300, 1000]\"", "[\"300\", 1000]", "[3e2, 1e3]", "[0x12c, 1000.0]"}) {
    INFO(value);
    for (const std::string key : {"resolution-schedule", "eval-at", "save_at"}) {
      write_text_file(path, key + " = " + value + "\n");
      TrainOptions options;
      read_train_config(path, options);
      if (key == "eval-at") CHECK(options.eval_at == expected);
      if (key == "save_at") CHECK(options.save_at == expected);
      if (key == "resolution-schedule") CHECK(options.resolution_schedule == sizes);
    }
  }
  for (const std::string value : {"[]", "\"\"", "\"[]\""}) {
    write_text_file(path, "eval-at = " + value + "\n");
    TrainOptions options;
    read_train_config(path, options);
    CHECK(options.eval_at.empty());
  }
  write_text_file(path, "eval-at = 7\nbackground = [1, 0.5, 0]\n");
  TrainOptions one;
  read_train_config(path, one);
  CHECK(one.eval_at == List{7});
  CHECK(one.background == "1,0.5,0");
  for (const std::string value :
       {"[[1], [2]]", "[5,,10]", "[0]", "[1.5]", "{ a = 1 }", "2020-01-01", "\"5 x\""}) {
    INFO(value);
    write_text_file(path, "eval-at = " + value + "\n");
    CHECK(message_of(path).find("line 1") != std::string::npos);
  }
  std::filesystem::remove(path);

  for (const auto& words : {std::vector<std::string>{"--eval-at=[300,1000]"},
                            {"--eval-at", "[300, 1000]"},
                            {"--eval-at", "300", "--eval-at", "1000"},
                            {"--eval-at", "=[300, 1000]"},
                            {"--eval-at=300 1000"},
                            {"--eval-at", "300,1000"}}) {
    CHECK(parse(words).eval_at == expected);
  }
  CHECK(parse({"--eval-at", "[]"}).eval_at.empty());
  for (const char* text : {"[\"4:300\", \"2:1000\"]", "4:300,2:1000", "4:300 2:1000", "300,1000"}) {
    CHECK(parse({"--resolution-schedule", text}).resolution_schedule == sizes);
  }
  CHECK(parse({"--background", "[1, 1, 1]"}).background == "1,1,1");
  CHECK(parse({"--mirror", "a b.obj", "--mirror", "/c.obj"}).mirrors.size() == 2);
  CHECK_THROWS_AS(parse({"--eval-at", "5,,10"}), UsageError);
}

TEST_CASE("what is no configuration is not an empty one") {
  const auto path = temporary("none.toml");
  std::filesystem::remove_all(path);
  std::filesystem::create_directory(path);
  CHECK(message_of(path).find("is not a file") != std::string::npos);
  std::filesystem::remove(path);
  for (const std::string text : {"\xff\xfe", "\xc3\x28", "iterations", "iterations 5", "[train",
                                 "iterations = 5 seed = 4", "iterations = 1__0"}) {
    INFO(text);
    write_text_file(path, text);
    CHECK(message_of(path).find("line 1") != std::string::npos);
  }
  write_text_file(path, "\xef\xbb\xbfiterations = 1_000\r\n[train]\nssim_weight = 0.5\n");
  TrainOptions options;
  read_train_config(path, options);
  CHECK(options.iterations == 1000);
  CHECK(options.ssim_weight == 0.5);
  write_text_file(path, "iterations = 5\n[train]\niterations = 6\n");
  CHECK(message_of(path).find("twice") != std::string::npos);
  write_text_file(path, "[[train]]\niterations = 6\n");
  CHECK(message_of(path).find("[train]") != std::string::npos);
  std::filesystem::remove(path);
}

TEST_CASE("the configurations of runs of older versions are read") {
  const auto path = temporary("old.toml");
  write_text_file(path,
                  "# ---- Run ----\n# training steps\niterations = 7\nseed = "
                  "18446744073709551615\n# \"colmap\" \\ or\ninit = \"C:\\points\\new.ply\"\n"
                  "exposure-lr = 0.03\nexposure-lr-final = 0.003\n");
  TrainOptions options;
  read_train_config(path, options);
  CHECK(options.iterations == 7);
  CHECK(options.seed == 18446744073709551615u);
  CHECK(options.init == "C:\\points\\new.ply");
  write_text_file(path, to_toml(options));
  TrainOptions again;
  read_train_config(path, again);
  CHECK(again.seed == options.seed);
  CHECK(again.init == options.init);
  write_text_file(path, "seed = 18446744073709551616\n");
  CHECK(message_of(path) != "");
  std::filesystem::remove(path);
}

TEST_CASE("a run that is older than the key for borders keeps them") {
  const TemporaryDirectory folder;
  const std::filesystem::path path = folder.path() / "config.toml";
  for (const bool of_run : {true, false}) {
    folder.write("config.toml",
                 std::string(of_run ? "# ---- Run ----\n" : "") + "iterations = 5\n");
    TrainOptions options;
    read_train_config(path, options);
    CHECK(options.data.borders == (of_run ? BorderUse::kKeep : BorderUse::kAuto));
  }
}

TEST_CASE("limits of scales that nothing can keep are refused") {
  const auto path = temporary("scales.toml");
  write_text_file(path, "scale-min = 0.2\nscale-max = 0.1\n");
  CHECK(message_of(path).find("above 'scale-max'") != std::string::npos);
  write_text_file(path, "scale-min = 0.2\nscale-max = 0\n");
  CHECK(message_of(path) == "");
  std::filesystem::remove(path);
}

TEST_CASE("a deterministic run with atomic sums is refused as a contradiction") {
  const auto path = temporary("atomic.toml");
  for (const char* sum : {"atomic", "swap"}) {
    const std::string both = fmt::format("deterministic = true\ngradient-sum = \"{}\"\n", sum);
    write_text_file(path, both);
    CHECK(message_of(path).find("contradict") != std::string::npos);
    write_text_file(path, "[train]\n" + both);
    CHECK(message_of(path).find(fmt::format("= {} contradict", sum)) != std::string::npos);
  }
  for (const char* sum : {"auto", "copies", "exact"}) {
    write_text_file(path, fmt::format("deterministic = true\ngradient-sum = \"{}\"\n", sum));
    CHECK(message_of(path) == "");
  }
  write_text_file(path, "deterministic = false\ngradient-sum = \"atomic\"\n");
  CHECK(message_of(path) == "");
  std::filesystem::remove(path);
}

TEST_CASE("a number beyond a bound that goes without saying is told the bound") {
  const auto path = temporary("bound.toml");
  write_text_file(path, "prune-scale-min = 1e300\n");
  CHECK(message_of(path).find("needs a number of at least 0 and at most 1e+30, not") !=
        std::string::npos);
  write_text_file(path, "scale-min = 1e30\n");
  CHECK(message_of(path).find("'scale-min' needs a number from 0 to 1000000, not") !=
        std::string::npos);
  write_text_file(path, "prune-scale-min = -1\n");
  CHECK(message_of(path).find("needs a number of at least 0, not '-1'") != std::string::npos);
  std::filesystem::remove(path);
}

TEST_CASE("the command line beats the file, wherever --config stands") {
  const auto path = temporary("beats.toml");
  write_text_file(path, "iterations = 77\nseed = 5\nadaptive-radius = false\neval-at = [3, 4]\n");
  for (const auto& arguments :
       {std::vector<std::string>{"--config", path.string(), "-n", "9", "--eval-at", "1,2"},
        std::vector<std::string>{"-n", "9", "--eval-at", "1,2", "--config", path.string()}}) {
    const TrainOptions options = parse(arguments);
    CHECK(options.iterations == 9);
    CHECK(options.seed == 5);
    CHECK(!options.trace.adaptive_radius);
    CHECK(options.eval_at == std::vector<RunShare>{1, 2});
  }
  CHECK(parse({"--config", path.string(), "--adaptive-radius"}).trace.adaptive_radius);
  CHECK(!parse({"--no-adaptive-radius"}).trace.adaptive_radius);
  CHECK(parse({"--background", "1,1,1"}).background == "1,1,1");
  CHECK_THROWS_AS(parse({"--iterations", "x"}), UsageError);
  std::filesystem::remove(path);
}

namespace {

// The options of a run that goes on from `source`, by a command line of these words.
TrainOptions resumed(const std::filesystem::path& source,
                     std::vector<std::string> words = {},
                     const std::set<std::string>& chosen = {},
                     const std::set<std::string>& anew = {}) {
  TrainOptions options;
  CLI::App app;
  std::string from;
  app.add_option("--resume", from);
  add_train_options(app, options);
  words.insert(words.end(), {"--resume", source.string()});
  app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  apply_resumed_options(app, options, source, chosen, anew);
  return options;
}

}  // namespace

TEST_CASE("a resumed run that is older than a key goes on as it began") {
  const TemporaryDirectory run;
  const auto options_of = [&run](const std::string& text, const std::vector<std::string>& words) {
    run.write("config.toml", text);
    return resumed(run.path(), words);
  };
  const TrainOptions old = options_of("resolution-schedule = [300, 1000]\nsave-at = [7000]\n", {});
  CHECK(old.strategy == DensityStrategy::kAdc);
  CHECK(old.footprint == 0.0);
  CHECK(old.data.borders == BorderUse::kKeep);
  CHECK(old.resolution_schedule == std::vector<ResolutionStep>{{4, 300}, {2, 1000}});
  const TrainOptions asked = options_of("save-at = [7000]\n", {"--strategy", "budget"});
  CHECK(asked.strategy == DensityStrategy::kBudget);
  CHECK(asked.footprint == 0.0);
  // One key had been for two.
  CHECK_FALSE(old.uncovered_points);
  CHECK(options_of("photo-points = true\n", {}).uncovered_points);
  CHECK_FALSE(options_of("photo-points = false\n", {}).uncovered_points);
  CHECK(options_of("photo-points = false\n", {"--uncovered-points"}).uncovered_points);
  const TrainOptions now = options_of("strategy = \"budget\"\nfootprint = 0.5\n", {});
  CHECK(now.strategy == DensityStrategy::kBudget);
  CHECK(now.footprint == 0.5);
}

TEST_CASE("a resumed run keeps its options below those of a file and of the command line") {
  const TemporaryDirectory folder;
  TrainOptions of_run;
  of_run.iterations = 900;
  of_run.end_iteration = 850;
  of_run.validate_views = 2;
  of_run.seed = 7;
  of_run.sh_degree = 1;
  folder.write("run/config.toml", to_toml(of_run));
  // Patience alone is refused for new runs: it is the run that validates.
  folder.write("more.toml", "patience = 3\nseed = 8\nsh-degree = 2\n");
  const TrainOptions options =
      resumed(folder / "run", {"--config", (folder / "more.toml").string(), "--sh-degree", "0"});
  CHECK(options.iterations == 900);
  CHECK(options.end_iteration == 850);
  CHECK(options.validate_views == 2);
  CHECK(options.patience == 3);
  CHECK(options.seed == 8);
  CHECK(options.sh_degree == 0);

  // A number goes before the run's list of test photos, as on the command line.
  TrainOptions listed;
  listed.data.test_list = {"a.png"};
  folder.write("listed/config.toml", to_toml(listed));
  folder.write("every.toml", "test-every = 4\n");
  folder.write("both.toml", "test-every = 4\ntest-list = \"\"\"\nb.png\n\"\"\"\n");
  const auto list_with = [&](const char* config) {
    return resumed(folder / "listed", {"--config", (folder / config).string()}).data.test_list;
  };
  CHECK(resumed(folder / "listed").data.test_list == listed.data.test_list);
  CHECK_FALSE(list_with("every.toml").has_value());
  CHECK(list_with("both.toml") == std::set<std::string>{"b.png"});

  // Another length has another end, whoever gives it.
  folder.write("length.toml", "iterations = 1000\n");
  CHECK(resumed(folder / "run", {"--config", (folder / "length.toml").string()}).end_iteration ==
        0);
  CHECK(resumed(folder / "run", {"--iterations", "1000"}).end_iteration == 0);
  CHECK(resumed(folder / "run", {"--iterations", "1000", "--end-iteration", "950"}).end_iteration ==
        950);

  // What the run chose in place of the file's keys stays.
  const TrainOptions kept_length =
      resumed(folder / "run", {"--config", (folder / "length.toml").string()},
              {"iterations", "end-iteration"});
  CHECK(kept_length.iterations == 900);
  CHECK(kept_length.end_iteration == 850);

  // What is to be chosen anew is as in a new run, and nothing that this one goes on with.
  {
    const LogCapture log;
    const TrainOptions anew =
        resumed(folder / "run", {"--config", (folder / "length.toml").string()}, {},
                {"iterations", "end-iteration", "photo-points"});
    CHECK(anew.iterations == 1000);
    CHECK(anew.end_iteration == 0);
    CHECK(anew.photo_points);
    CHECK(anew.seed == 7);
    CHECK(log.lines() == 0);
  }

  // A checkpoint has them too: in a run without the file, and outside of one beside a file that is
  // not its run's.
  Checkpoint checkpoint;
  checkpoint.scale_activation = "exp";
  checkpoint.config = to_toml(of_run);
  write_checkpoint(checkpoint_path(folder / "bare", 7), checkpoint);
  write_checkpoint(folder / "kept/step.rsck", checkpoint);
  folder.write("config.toml", "iterations = 5\n");
  for (const std::filesystem::path& source :
       {folder / "bare", checkpoint_path(folder / "bare", 7), folder / "kept/step.rsck"}) {
    CAPTURE(source);
    const TrainOptions kept = resumed(source);
    CHECK(kept.iterations == 900);
    CHECK(kept.seed == 7);
    CHECK(kept.validate_views == 2);
  }
  CHECK(resumed(folder / "none").iterations == TrainOptions().iterations);

  // A run that is older than a key goes on without what that would change.
  CHECK(resumed(folder / "run").alpha_weight == TrainOptions().alpha_weight);
  std::string older = to_toml(of_run);
  for (const char* key : {"alpha-weight", "prune-weight", "view-footprint"}) {
    const std::size_t begin = older.find(key);
    REQUIRE(begin != std::string::npos);
    older.erase(begin, older.find('\n', begin) + 1 - begin);
  }
  std::filesystem::create_directories(folder / "older");
  folder.write("older/config.toml", older);
  CHECK(resumed(folder / "older").alpha_weight == 0);
  CHECK(resumed(folder / "older", {"--alpha-weight", "0.5"}).alpha_weight == 0.5);
  CHECK(resumed(folder / "run").prune_weight == TrainOptions().prune_weight);
  CHECK(resumed(folder / "older").prune_weight == 0);
  CHECK(resumed(folder / "older").trace.view_footprint == 0);
  TrainOptions shown;
  read_train_config(folder / "older/config.toml", shown);
  CHECK(shown.trace.view_footprint == 0);
  CHECK_THROWS_AS(resumed(folder / "run", {"--validate-views", "0", "--patience", "2"}),
                  UsageError);
}

TEST_CASE("a file that makes another run of the one that is resumed is said to, once") {
  const TemporaryDirectory folder;
  TrainOptions of_run;
  of_run.iterations = 1500;
  of_run.seed = 7;
  of_run.background = "0,0,0";
  folder.write("run/config.toml", to_toml(of_run));
  // A background that the photos choose stays what they have chosen.
  {
    folder.write("fitted.toml", "iterations = -1\n");
    const LogCapture log;
    resumed(folder / "run", {"--config", (folder / "fitted.toml").string()});
    CHECK(log.lines() == 0);
  }
  folder.write("other.toml",
               "iterations = 48000\nseed = 7\nsh-degree = 1\nbackground = \"auto\"\n");
  const std::string file = (folder / "other.toml").string();
  {
    const LogCapture log;
    CHECK(resumed(folder / "run", {"--config", file}).iterations == 48000);
    CHECK(log.lines() == 1);
    CHECK(log.contains("iterations 48000 (1500)"));
    CHECK(log.contains("sh-degree 1 (3)"));
    CHECK_FALSE(log.contains("seed"));
    CHECK_FALSE(log.contains("background"));
  }
  const LogCapture log;
  // What the command line says is meant, and without a run there is nothing to change.
  resumed(folder / "run", {"--config", file, "-n", "2000", "--sh-degree", "2"});
  resumed(folder / "run", {"--seed", "7", "-n", "3000"});
  resumed(folder / "none", {"--config", file});
  CHECK(log.lines() == 0);
}

TEST_CASE("texts and paths that no configuration can hold are refused") {
  const std::string bad = "/photos/b\xE4ll.obj";
  for (const std::string option : {"--mirror", "--init"}) {
    CAPTURE(option);
    std::string message;
    try {
      parse({option, bad});
    } catch (const UsageError& error) {
      message = error.what();
    }
    CHECK(message.find("UTF-8") != std::string::npos);
  }
  CHECK(parse({"--mirror", "/photos/b\xC3\xA4ll.obj"}).mirrors.size() == 1);
}
