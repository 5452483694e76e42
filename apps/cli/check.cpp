#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "check_image.h"
#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

using nlohmann::ordered_json;

struct Judgement {
  std::string format;
  HealedSurface surface;
  WarningList warnings;  // of the reader, then of the repair
};

Judgement judge_surface(const Context& context, const FileBytes& bytes, const std::string& file) {
  Judgement judgement;
  SurfaceFile input = bytes.judge(file, [&] {
    return parse_surface(bytes.bytes(), file, context.read, context.run.stage(0.0, 0.5));
  });
  judgement.format = input.format + (input.format == "ply" || input.format == "stl"
                                         ? (input.is_binary ? " (binary)" : " (text)")
                                         : "");
  HealOptions options;
  options.drop_nonfinite = context.read.drop_nonfinite;
  judgement.surface = heal(input.mesh, options, context.run.stage(0.5, 1.0));
  judgement.warnings = std::move(input.warnings);
  judgement.warnings.append(judgement.surface.warnings);
  return judgement;
}

// Input faces that have a part in the repaired surface; input_face is ascending.
std::int64_t used_faces(const HealedSurface& surface) {
  std::int64_t count = 0;
  for (std::size_t t = 0; t < surface.input_face.size(); ++t) {
    if (t == 0 || surface.input_face[t] != surface.input_face[t - 1]) ++count;
  }
  return count;
}

std::int64_t used_vertices(const HealedSurface& surface) {
  return std::count_if(surface.analysis_vertex.begin(), surface.analysis_vertex.end(),
                       [](std::int32_t v) { return v >= 0; });
}

// null for a measure beyond the range of double.
ordered_json measure(double value) {
  if (std::abs(value) < std::numeric_limits<double>::max()) return value;
  return nullptr;
}

ordered_json to_json(const Judgement& judgement, const std::string& file) {
  const HealedSurface& s = judgement.surface;
  ordered_json document;
  document["file"] = file;
  document["format"] = judgement.format.substr(0, judgement.format.find(' '));
  document["vertices"] = s.num_input_vertices;
  document["faces"] = used_faces(s);
  document["edges"] = s.num_edges;
  document["components"] = s.num_components;
  document["boundary_loops"] = s.num_boundary_loops;
  document["euler"] = s.euler;
  document["manifold"] = s.is_manifold;
  document["oriented"] = s.is_oriented;
  document["area"] = measure(s.area);
  document["volume"] = s.is_closed ? measure(s.volume) : ordered_json(nullptr);
  document["mean_edge_length"] = measure(s.mean_edge_length);
  document["bounding_box"] = {{s.box_min(0), s.box_min(1), s.box_min(2)},
                              {s.box_max(0), s.box_max(1), s.box_max(2)}};
  document["used_vertices"] = used_vertices(s);
  document["input_faces"] = s.num_input_faces;
  document["triangles"] = s.mesh.triangles.rows();
  document["warnings"] = dupin::cli::to_json(judgement.warnings);
  return document;
}

void tell(const Context& context, const Judgement& judgement, const std::string& file) {
  const HealedSurface& s = judgement.surface;
  const auto line = [&](const char* name, const std::string& value) {
    context.say(fmt::format("  {:<17} {}", name, value));
  };
  const auto part = [](std::int64_t used, std::int64_t all) {
    return used == all ? fmt::format("{}", all) : fmt::format("{} ({} used)", all, used);
  };
  const auto number = [](double value) {
    return std::abs(value) < std::numeric_limits<double>::max() ? fmt::format("{:.8g}", value)
                                                                : std::string("out of range");
  };
  context.say(fmt::format("{}: {}", escaped(file, 4096), judgement.format));
  line("vertices", part(used_vertices(s), s.num_input_vertices));
  line("faces", part(used_faces(s), s.num_input_faces));
  line("edges", fmt::format("{}", s.num_edges));
  line("components", fmt::format("{}", s.num_components));
  line("boundary loops", fmt::format("{}", s.num_boundary_loops));
  line("Euler number", fmt::format("{}", s.euler));
  line("manifold", s.is_manifold ? "yes" : "no, cut where it is not");
  line("oriented", s.is_oriented ? "yes" : "no, turned to agree");
  line("area", number(s.area));
  line("volume", s.is_closed ? number(s.volume) : "open");
  line("mean edge length", number(s.mean_edge_length));
  line("bounding box",
       fmt::format("({:.8g}, {:.8g}, {:.8g}) to ({:.8g}, {:.8g}, {:.8g})", s.box_min(0),
                   s.box_min(1), s.box_min(2), s.box_max(0), s.box_max(1), s.box_max(2)));
  line("warnings", judgement.warnings.empty() ? "none" : "");
  for (const Warning& w : judgement.warnings.all()) {
    context.say(
        fmt::format("    {:<22} {:>8}  {}; first: {}", w.code, w.count, w.message, w.first));
  }
}

// A picture under the name of a surface is a mistake, which the reader of surfaces names.
bool is_picture(const FileBytes& bytes, const std::string& file) {
  std::string end = file.size() < 4 ? file : file.substr(file.size() - 4);
  std::transform(end.begin(), end.end(), end.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return is_png(bytes.bytes()) && (end == ".png" || file == "-");
}

ordered_json judge(Context& context, const std::string& file) {
  std::optional<ImageJudgement> picture;
  Judgement surface;
  try {
    // Opening waits for standard input, so it is part of what --timeout and signals end.
    with_progress(context, "check", [&] {
      const FileBytes bytes = FileBytes::open(file, context.read.limits, context.run);
      if (is_picture(bytes, file)) {
        picture = judge_image(context, bytes, file);
      } else {
        surface = judge_surface(context, bytes, file);
      }
    });
  } catch (const Error& error) {
    throw in_file(error, file);
  }
  if (picture) {
    context.report(file, picture->warnings);
    tell(context, *picture, file);
    return to_json(*picture, file);
  }
  context.report(file, surface.warnings);
  tell(context, surface, file);
  return to_json(surface, file);
}

void check(Context& context, const std::vector<std::string>& files) {
  if (files.size() == 1) {
    context.print_json(judge(context, files.front()));
    return;
  }
  // One bad file never hides the others; the first failure gives the exit code.
  auto documents = ordered_json::array();
  for (const std::string& file : files) {
    try {
      documents.push_back(judge(context, file));
    } catch (const Error& error) {
      if (error.errc() == Errc::interrupted) throw;
      tell_error(error);
      documents.push_back({{"file", file}, {"error", dupin::cli::to_json(error)}});
      if (context.exit_code == 0) context.exit_code = static_cast<int>(error.errc());
    }
  }
  context.print_json(documents);
}

}  // namespace

void add_check(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("check", "Read, repair and judge surfaces, or pictures of cut-outs");
  verb->footer(
      "Example:\n  dupin check scan.ply --json\n\nSeveral files give a JSON array; all are judged, "
      "and the first failure gives the\nexit code. A name that starts with '-' needs './' before "
      "it.");
  add_global_options(*verb, context);
  add_input_format(*verb, context);
  auto files = std::make_shared<std::vector<std::string>>();
  verb->add_option("FILE", *files, "Surfaces or PNG pictures; - reads standard input")->required();
  verb->callback([files, &context] { check(context, *files); });
}

}  // namespace dupin::cli
