#include "dupin/base/version.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <memory>

#include "context.h"

namespace dupin::cli {

void add_version(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("version", "Version and the libraries it was built with");
  verb->footer("Example:\n  dupin version --deps");
  add_global_options(*verb, context);
  auto with_deps = std::make_shared<bool>(false);
  verb->add_flag("--deps", *with_deps, "List the libraries inside");
  verb->callback([with_deps, &context] {
    nlohmann::ordered_json document{{"version", kVersion}, {"license", "Apache-2.0"}};
    context.say(fmt::format("dupin {} (Apache-2.0)", kVersion));
    if (*with_deps) {
      document["dependencies"] = {
          {"eigen",
           fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"cli11", CLI11_VERSION},
          {"fmt", fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100,
                              FMT_VERSION % 100)},
          {"nlohmann_json", fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR,
                                        NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH)},
          {"boost", DUPIN_BOOST_VERSION},
          {"zlib", DUPIN_ZLIB_VERSION},
          {"libpng", DUPIN_PNG_VERSION}};
#ifdef DUPIN_TBB_VERSION
      document["dependencies"]["onetbb"] = DUPIN_TBB_VERSION;
#endif
      for (const auto& [name, value] : document["dependencies"].items()) {
        context.say(fmt::format("  {} {}", name, value.get<std::string>()));
      }
    }
    context.print_json(document);
  });
}

}  // namespace dupin::cli
