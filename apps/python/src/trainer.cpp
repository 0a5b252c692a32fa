// SPDX-License-Identifier: Apache-2.0
#include "raysplats/trainer.hpp"

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bindings.hpp"
#include "context.hpp"
#include "pickling.hpp"
#include "raysplats/error.hpp"
#include "run/train_config.hpp"
#include "run/train_option_table.hpp"
#include "signals.hpp"
#include "train/busy_trainer.hpp"
#include "util/nearest_name.hpp"

namespace raysplats::python {
namespace {

namespace nb = nanobind;

/// A trainer, which one call of run() or step() has at a time.
class HeldTrainer : public Held<Trainer> {
 public:
  using Held::Held;
  std::atomic<bool> taken = false;
};

/// A value of Python as the words that configuration files have.
std::string word(nb::handle value) {
  auto text = nb::cast<std::string>(nb::str(value));
  if (nb::isinstance<nb::str>(value)) return text;
  // So Python and numpy call theirs.
  return text == "True" ? "true" : text == "False" ? "false" : text;
}

std::vector<std::string> words(nb::handle value) {
  if (!nb::isinstance<nb::list>(value) && !nb::isinstance<nb::tuple>(value)) return {word(value)};
  std::vector<std::string> out;
  for (const nb::handle each : value) out.push_back(word(each));
  return out;
}

[[noreturn]] void refuse_option(const std::string& key, const std::vector<std::string>& names) {
  throw UsageError(fmt::format("unknown option '{}'{}", key,
                               did_you_mean(key, names, ": docs/cli.md lists those of train")));
}

void set_option(TrainOptions& options, std::string key, nb::handle value) {
  std::replace(key.begin(), key.end(), '_', '-');
  std::vector<std::string> names;
  for (const OptionRow& known : train_option_rows(options)) {
    if (known.name == key) return known.set(words(value));
    names.push_back(known.name);
  }
  if (!take_retired_key(key)) refuse_option(key, names);
}

std::string option_text(TrainOptions& options, std::string key) {
  std::replace(key.begin(), key.end(), '_', '-');
  std::vector<std::string> names;
  for (const OptionRow& known : train_option_rows(options)) {
    if (known.name == key) return known.text();
    names.push_back(known.name);
  }
  refuse_option(key, names);
}

void make_options(TrainOptions* self,
                  const std::optional<std::filesystem::path>& config,
                  const nb::kwargs& keys) {
  TrainOptions options;
  if (config) read_train_config(*config, options);
  for (const auto& [key, value] : keys) {
    set_option(options, nb::cast<std::string>(key), value);
  }
  validate(options);
  new (self) TrainOptions(std::move(options));
}

using Callback = std::optional<nb::callable>;

/// Takes the trainer and sets what an iteration calls; gives both back at the end: a trainer that
/// kept its callback could keep itself alive by it. A trainer that is taken is refused before its
/// callback is touched, which the call that has it needs until it is over. Made and gone without
/// the interpreter's lock.
class Steps {
 public:
  Steps(HeldTrainer& held, const Callback& callback) : trainer_(*held), taken_(held.taken) {
    if (taken_.exchange(true)) refuse_busy_trainer("run() and step()");
    trainer_.on_step([&callback](const TrainProgress& progress) {
      heed_signals(0);
      const nb::gil_scoped_acquire acquire;
      if (callback) (*callback)(progress);
    });
  }
  ~Steps() {
    trainer_.on_step(nullptr);
    taken_ = false;
  }
  Steps(const Steps&) = delete;
  Steps& operator=(const Steps&) = delete;
  Trainer* operator->() { return &trainer_; }

 private:
  Trainer& trainer_;
  std::atomic<bool>& taken_;
};

TrainSummary run(HeldTrainer& self, bool show_progress, const Callback& on_step) {
  const nb::gil_scoped_release release;
  return Steps(self, on_step)->run(show_progress);
}

bool step(HeldTrainer& self, std::int64_t count, const Callback& on_step) {
  const nb::gil_scoped_release release;
  return Steps(self, on_step)->step(count);
}

void bind_records(nb::module_& module) {
  nb::class_<EvaluationRow> row(module, "EvaluationRow",
                                "Mean over the test views at one iteration.");
  row.def_ro("iteration", &EvaluationRow::iteration)
      .def_ro("training_seconds", &EvaluationRow::training_seconds)
      .def_ro("psnr", &EvaluationRow::psnr, "Decibels.")
      .def_ro("ssim", &EvaluationRow::ssim)
      .def_ro("views", &EvaluationRow::views)
      .def_ro("gaussians", &EvaluationRow::gaussians)
      .def_ro("psnr_corrected", &EvaluationRow::psnr_corrected)
      .def_ro("psnr_all", &EvaluationRow::psnr_all)
      .def_ro("psnr_aligned", &EvaluationRow::psnr_aligned);
  def_pickling(row, &EvaluationRow::iteration, &EvaluationRow::training_seconds,
               &EvaluationRow::psnr, &EvaluationRow::ssim, &EvaluationRow::views,
               &EvaluationRow::gaussians, &EvaluationRow::psnr_corrected, &EvaluationRow::psnr_all,
               &EvaluationRow::psnr_aligned);
  nb::class_<TrainSummary> summary(module, "TrainSummary");
  summary.def_ro("iterations", &TrainSummary::iterations)
      .def_ro("gaussians", &TrainSummary::gaussians)
      .def_ro("loss", &TrainSummary::loss, "Of the last view reported.")
      .def_ro("training_seconds", &TrainSummary::training_seconds)
      .def_ro("evaluation_seconds", &TrainSummary::evaluation_seconds)
      .def_ro("kernel_build_seconds", &TrainSummary::kernel_build_seconds)
      .def_ro("evaluations", &TrainSummary::evaluations);
  def_pickling(summary, &TrainSummary::iterations, &TrainSummary::gaussians, &TrainSummary::loss,
               &TrainSummary::training_seconds, &TrainSummary::evaluation_seconds,
               &TrainSummary::kernel_build_seconds, &TrainSummary::evaluations);
  nb::class_<TrainProgress> progress(module, "TrainProgress", "Where a run is after a step.");
  progress.def_ro("iteration", &TrainProgress::iteration, "Completed.")
      .def_ro("iterations", &TrainProgress::iterations, "Of the whole run.")
      .def_ro("gaussians", &TrainProgress::gaussians);
  def_pickling(progress, &TrainProgress::iteration, &TrainProgress::iterations,
               &TrainProgress::gaussians);
  nb::class_<TrainLoss> loss(module, "TrainLoss", "The view that the last step was made with.");
  loss.def_ro("total", &TrainLoss::total).def_ro("psnr", &TrainLoss::psnr, "Decibels.");
  def_pickling(loss, &TrainLoss::total, &TrainLoss::psnr);
}

void bind_options(nb::module_& module) {
  nb::class_<TrainOptions>(module, "TrainOptions",
                           "Every key of the configuration files (docs/training.md), with _ or -.")
      .def("__init__", &make_options, nb::arg("config") = nb::none(), nb::arg("keys"),
           nb::sig("def __init__(self, config: str | os.PathLike | None = None, **keys: object) -> "
                   "None"),
           "The defaults, then a TOML file, then keywords.")
      .def("__setitem__", &set_option, nb::arg("key"), nb::arg("value").none())
      .def("text", &option_text, nb::arg("key"), "The value of a key as TOML.")
      .def_static(
          "keys",
          [] {
            TrainOptions options;
            std::vector<std::string> names;
            for (const OptionRow& key : train_option_rows(options)) names.push_back(key.name);
            return names;
          },
          "The name of every key.")
      .def("to_toml", &to_toml, "A configuration file with every key and what it means.")
      .def("__getstate__", &to_toml)
      .def(
          "__setstate__",
          [](TrainOptions& self, const std::string& state) {
            new (&self) TrainOptions(parse_train_config(state));
          },
          nb::arg("state"));
}

}  // namespace

void bind_trainer(nb::module_& module) {
  bind_records(module);
  bind_options(module);
  using Guard = nb::call_guard<nb::gil_scoped_release>;
  nb::class_<HeldTrainer>(
      module, "Trainer",
      "Trains a model of a data set and writes a run folder. Either run() does everything that the "
      "options say, or step(), evaluate() and save() in a loop of your own.")
      .def(
          "__init__",
          [](HeldTrainer* self, HeldContext& context, const Dataset& dataset,
             const std::filesystem::path& run_folder, const std::optional<TrainOptions>& options,
             bool overwrite) {
            new (self) HeldTrainer(*context, dataset, options.value_or(TrainOptions{}), run_folder,
                                   overwrite);
          },
          nb::arg("context"), nb::arg("dataset"), nb::arg("run_folder"),
          nb::arg("options") = nb::none(), nb::kw_only(), nb::arg("overwrite") = false,
          nb::keep_alive<1, 2>())
      .def(
          "resume",
          [](HeldTrainer& self, const std::filesystem::path& source) { self->resume(source); },
          nb::arg("source") = "latest", Guard(),
          "Continues from a run folder, a checkpoint file, or 'latest': the run's own folder.")
      .def("run", &run, nb::arg("show_progress") = false, nb::kw_only(),
           nb::arg("on_step") = nb::none(),
           "Trains up to the options' iterations. Ctrl-C saves a checkpoint and raises "
           "KeyboardInterrupt. on_step(progress) hears of every iteration.")
      .def("step", &step, nb::arg("count") = 1, nb::kw_only(), nb::arg("on_step") = nb::none(),
           "At most `count` iterations more, without files and evaluations; returns whether any "
           "are still to come.")
      .def(
          "stop", [](HeldTrainer& self) { self->stop(); },
          "Ends run() or step() after the iteration under way; from any thread.")
      .def(
          "evaluate", [](HeldTrainer& self) { return self->evaluate(); }, Guard(),
          "Traces the test views, writes RUN/eval and RUN/metrics.json.")
      .def(
          "save", [](HeldTrainer& self) { self->save(); }, Guard(),
          "Writes the model and a checkpoint into the run folder.")
      .def(
          "loss", [](HeldTrainer& self) { return self->loss(); }, Guard(),
          "Loss and PSNR of the last step's view.")
      .def(
          "gaussians", [](HeldTrainer& self) { return self->model(); }, Guard(),
          "The model as it is now.")
      .def_prop_ro(
          "iteration", [](HeldTrainer& self) { return self->iteration(); }, "Completed iterations.")
      .def_prop_ro(
          "iterations", [](HeldTrainer& self) { return self->iterations(); },
          "Those of the whole run, as it is planned now.");
}

}  // namespace raysplats::python
