// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "../skip_test.hpp"
#include "program.hpp"

TEST_CASE("doctor tests every device and says that it works") {
  const Outcome text = raysplats_program({"doctor", "-q"});
  INFO(text.err);
  CHECK(text.code == 0);
  CHECK(contains(text.out, ".icd: "));
  CHECK(contains(text.out, "14 of 14 quantities"));
  CHECK(contains(text.out, "verdict        works\n"));
  const Outcome json = raysplats_program({"doctor", "--json", "-q"});
  CHECK(json.code == 0);
  CHECK(nlohmann::json::parse(json.out).at("works") == true);
  CHECK(nlohmann::json::parse(json.out).at("process_limit").is_null());
  Surroundings limited;
  limited.memory_limit = rlim_t{60'000} << 20;
  const Outcome within = raysplats_program({"doctor", "--json", "-q"}, limited);
  CHECK(contains(nlohmann::json::parse(within.out).at("process_limit").get<std::string>(),
                 "this process may take 60000 MiB"));
}

TEST_CASE("doctor without any driver says what to install, exit code 4") {
  const TemporaryFolder folder;
  const Outcome outcome =
      raysplats_program({"doctor"}, {{{"OCL_ICD_VENDORS", folder.path().string()}}});
  CHECK(outcome.code == 4);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.out, "(by OCL_ICD_VENDORS)\n  none\n"));
  CHECK(contains(outcome.out, "advice           No OpenCL platform"));
  CHECK(contains(outcome.out, "pocl-opencl-icd"));
}

TEST_CASE("doctor names a driver that cannot be loaded") {
  const TemporaryFolder folder;
  write_file(folder / "none.icd", "libnone_of_that_name.so\n");
  const Outcome outcome =
      raysplats_program({"doctor"}, {{{"OCL_ICD_VENDORS", folder.path().string()}}});
  CHECK(outcome.code == 4);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.out, "none.icd: libnone_of_that_name.so, "));
  CHECK(contains(outcome.out, "install it anew"));
}

TEST_CASE("doctor has no use for a device that is too small") {
  SKIP_TEST_UNLESS(contains(raysplats_program({"devices"}).out, "Portable Computing Language"),
                   "there is no PoCL");
  const Outcome outcome = raysplats_program({"doctor"}, {{{"POCL_MAX_WORK_GROUP_SIZE", "16"}}});
  CHECK(outcome.code == 4);
  CHECK(contains(outcome.out, "not usable: its work-groups hold 16"));
  CHECK(contains(outcome.out, "advice           No device is usable"));
}
