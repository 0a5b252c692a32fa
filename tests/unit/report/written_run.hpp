// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "raysplats/io.hpp"
#include "unit/temporary_directory.hpp"

namespace raysplats::test {

/// A run with two evaluations, the second below the first, of views with an awkward name.
class Run {
 public:
  explicit Run(const std::string& name = "run") : path_(folder_ / name) {
    const std::filesystem::path eval = path_ / "eval/iteration_200";
    std::filesystem::create_directories(eval);
    write("metrics.csv",
          "iteration,seconds,loss,psnr,gaussians,it_per_s\n10,1.5,0.5,12,100,7\n"
          "200,30,0.1,22,140,6\n210,cut");
    write(
        "metrics.json",
        R"({"complete":true,"iteration":200,"iterations":200,"gaussians":140,"device":"<cpu> & co",
            "command":"raysplats train 'a<b'","model_hash":"00112233445566778899aabbccddeeff",
            "traced_rays":1000,"capped_rays":50,"evaluations":[
            {"iteration":100,"training_seconds":15,"psnr":21.5,"ssim":0.8,"views":3},
            {"iteration":200,"training_seconds":30,"psnr":20.25,"ssim":0.75,"views":3}]})");
    write("config.toml", "# a comment\niterations = 200\nname = \"<script>\"\n");
    write("eval/iteration_200/metrics.json",
          R"({"images":[{"name":"good.png","psnr":30,"ssim":0.9},
            {"name":"a<b>&.png","psnr":10,"ssim":0.5},{"name":"mid.png","psnr":20,"ssim":0.7}]})");
    for (const char* name : {"good.png", "a<b>&.png"})
      write_image(eval / name, Image(12, 4, 3, 0.5f));
  }
  void write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << text;
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  TemporaryDirectory folder_;
  std::filesystem::path path_;
};

}  // namespace raysplats::test
