// How well partial scans are brought together: tables in Markdown.
//
// A pair is a success when its rotation is within one degree and the mean point of the moving part
// within 0.5 % of the diameter of where it belongs. CPU seconds are those of the whole process,
// without reading.
//
// registration_quality --surfaces DIR --write FILES
//
// With --open3d PYTHON in place of --write, the peer bench/peers/open3d_registration.py runs too.
//
// DIR holds armadillo.off, bunny00.off and refined_elephant.off as Debian's libcgal-demo packs
// them; a bumpy sphere is built in.
#include <CLI/CLI.hpp>
#include <cstdint>
#include <iostream>
#include <string>
#include <vector>

#include "bench/registration_pairs.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"

int main(int argc, char** argv) {
  CLI::App app{"Success of the registration of partial scans"};
  std::string directory;
  std::string write_directory;
  std::uint64_t draw = 1;
  int threads = 2;
  app.add_option("--surfaces", directory,
                 "Folder with armadillo, bunny00, refined_elephant (.off)");
  app.add_option("--write", write_directory, "Write the pairs here as PLY, the truth as JSON");
  app.add_option("--draw", draw, "Other cuts, poses and noise");
  app.add_option("--threads", threads, "Threads (figures do not depend on it)");
  CLI11_PARSE(app, argc, argv);
  try {
    dupin::set_thread_count(threads);
    if (directory.empty()) {
      std::cerr << "no --surfaces DIR: armadillo, bunny00 and refined_elephant are left out\n";
    }
    const auto surfaces = dupin::bench::registration_surfaces(directory);
    const auto pairs = dupin::bench::overlap_pairs(surfaces, 1.0, draw);
    if (!write_directory.empty()) dupin::bench::write_pairs(write_directory, pairs);
    for (const auto& named : pairs) {
      std::cout << named.name << ": " << named.pair.moving.points.rows() << " and "
                << named.pair.fixed.points.rows() << " points, overlap " << named.pair.overlap
                << "\n";
    }
  } catch (const dupin::Error& error) {
    std::cerr << error.diagnostic() << '\n';
    return static_cast<int>(error.errc());
  }
  return 0;
}
