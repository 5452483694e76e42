#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <sstream>
#include <string_view>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/io/file.h"
#include "dupin/io/npz.h"
#include "dupin/io/png.h"
#include "dupin/render/renderer.h"
#include "line_files.h"
#include "surface_picture.h"

namespace dupin::cli {
namespace {

struct Settings {
  std::string mesh;
  std::string output;
  std::string color = "none";
  int level = 20;
  std::string keypoints;
  std::string lines;
  double line_width = 2.0;
  std::string view = "iso";
  double perspective = Camera{}.perspective;
  std::string size = "1600x1200";
  std::string map;
  std::string range;
  std::string title;
  std::string caption;
  bool no_legend = false;
  std::string background = "white";
  double largest_ball = 9.0;
  std::optional<double> no_value;  // of FILE.npy
  std::string no_value_label = "no value";
};

std::pair<double, double> parse_pair(const std::string& text, char separator,
                                     const std::string& what) {
  std::pair<double, double> out;
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, out.first);
  if (first.ec == std::errc() && first.ptr != end && *first.ptr == separator) {
    const auto second = std::from_chars(first.ptr + 1, end, out.second);
    if (second.ec == std::errc() && second.ptr == end && std::isfinite(out.first) &&
        std::isfinite(out.second)) {
      return out;
    }
  }
  throw InvalidArgument(what + " is \"" + escaped(text, 40) + "\", expected two numbers as in A" +
                        separator + "B");
}

std::string text_of(const std::string& path, const ReadLimits& limits) {
  const FileBytes file = FileBytes::open(path, limits);
  return file.judge(path, [&] { return std::string(file.bytes().begin(), file.bytes().end()); });
}

// Values of FILE.npy: one a vertex of the input, or levels by vertices of which `level` is taken.
ColorSignal npy_signal(const LoadedSurface& surface, const Settings& settings,
                       const ReadLimits& limits) {
  const std::string& path = settings.color;
  const int level = settings.level;
  const NpyArray array = read_npy(path, limits);
  const Eigen::Index num_vertices = surface.num_input_vertices;
  Eigen::VectorXd given;
  if (array.values.rows() == num_vertices && array.values.cols() == 1) {
    given = array.values.col(0);
  } else if (array.values.cols() == num_vertices && level < array.values.rows()) {
    given = array.values.row(level).transpose();
  } else {
    throw AnalysisError(
        "E_SIZE",
        fmt::format("the array is {} x {}, expected {} values or levels x {}", array.values.rows(),
                    array.values.cols(), num_vertices, num_vertices),
        "one value a vertex of the input file");
  }
  ColorSignal signal;
  signal.is_signed = false;
  signal.values.resize(surface.points.rows());
  for (Eigen::Index v = 0; v < signal.values.size(); ++v) {
    signal.values[v] = given[surface.input_vertex[static_cast<std::size_t>(v)]];
  }
  if (settings.no_value) {
    for (const double value : signal.values) {
      signal.is_absent.push_back(value == *settings.no_value ? 1 : 0);
    }
    signal.absent_label = settings.no_value_label;
  }
  for (Eigen::Index v = 0; v < signal.values.size(); ++v) {
    const bool is_there =
        signal.is_absent.empty() || signal.is_absent[static_cast<std::size_t>(v)] == 0;
    signal.is_signed = signal.is_signed || (is_there && signal.values[v] < 0.0);
  }
  signal.label = path.substr(path.find_last_of('/') + 1);
  return signal;
}

struct DrawnKeypoint {
  SceneSphere sphere;
  double snr = 0.0;
  bool has_snr = false;
};

// What `dupin keypoints --json` printed.
std::vector<DrawnKeypoint> read_keypoints(const std::string& path, const ReadLimits& limits) {
  std::vector<DrawnKeypoint> out;
  try {
    const auto document = nlohmann::json::parse(text_of(path, limits));
    for (const auto& item : document.at("keypoints")) {
      DrawnKeypoint keypoint;
      for (int k = 0; k < 3; ++k) {
        keypoint.sphere.center[k] = item.at("position").at(static_cast<std::size_t>(k));
      }
      keypoint.sphere.radius = item.at("radius");
      keypoint.sphere.color = keypoint_color(item.at("kind").get<std::string>() == "max");
      if (item.contains("snr") && item["snr"].is_number()) {
        keypoint.snr = item["snr"];
        keypoint.has_snr = true;
      }
      out.push_back(keypoint);
    }
  } catch (const nlohmann::json::exception& error) {
    throw IoError(Errc::malformed, "E_SYNTAX", error.what(), {path, 0, -1},
                  "expected the output of dupin keypoints --json");
  }
  return out;
}

// `scale` with what --map and --range say instead.
ColorScale wanted_scale(ColorScale scale, const Settings& settings) {
  if (settings.map == "sequential") scale.map = ColorMap::sequential;
  if (settings.map == "diverging") scale.map = ColorMap::diverging;
  if (!settings.range.empty()) {
    const auto [low, high] = parse_pair(settings.range, ',', "range");
    if (!(low < high)) throw InvalidArgument("range needs LOW < HIGH");
    scale.range = {low, high};
  }
  return scale;
}

// Balls coloured by their signal-to-noise ratio instead of their kind.
void color_by_snr(Scene& scene, std::vector<DrawnKeypoint>& keypoints, const Settings& settings) {
  Eigen::VectorXd snr(static_cast<Eigen::Index>(keypoints.size()));
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    if (!keypoints[i].has_snr) {
      throw AnalysisError("E_NO_SNR", "the keypoints carry no snr",
                          "write them with dupin keypoints --noise auto --json; noise 0 has none");
    }
    snr[static_cast<Eigen::Index>(i)] = keypoints[i].snr;
  }
  scene.scale = wanted_scale({ColorMap::sequential, robust_range(snr)}, settings);
  for (DrawnKeypoint& keypoint : keypoints) {
    keypoint.sphere.color = scene.scale.color(keypoint.snr);
    keypoint.sphere.opacity = 0.5;
  }
  scene.legend.scale_label = "SNR";
  scene.legend.has_color_bar = true;
}

Scene make_scene(const LoadedSurface& surface, const Settings& settings, std::size_t& num_keypoints,
                 Context& context) {
  Scene scene;
  scene.surfaces.push_back(to_scene_surface(surface));
  scene.legend.has_scale_bar = true;
  const bool is_file = settings.color.ends_with(".npy");
  if (settings.no_value && !is_file) {
    throw InvalidArgument("--no-value is of a file", "--color FILE.npy");
  }
  ColorSignal signal;
  if (is_file) {
    signal = npy_signal(surface, settings, context.read.limits);
    color_by(scene, signal);
  } else if (settings.color != "none" && settings.color != "snr") {
    signal =
        compute_color_signal(surface, settings.color, settings.level, context.run.stage(0.2, 0.6));
    require_range(std::all_of(signal.values.data(), signal.values.data() + signal.values.size(),
                              [](double x) { return std::isfinite(x); }),
                  "the colour " + settings.color, settings.mesh);
    color_by(scene, signal);
  }
  if (!settings.keypoints.empty()) {
    auto keypoints = read_keypoints(settings.keypoints, context.read.limits);
    if (settings.color == "snr") color_by_snr(scene, keypoints, settings);
    std::vector<SceneSphere> balls;
    for (const DrawnKeypoint& keypoint : keypoints) balls.push_back(keypoint.sphere);
    add_keypoint_balls(scene, balls, settings.largest_ball / 100.0);
    num_keypoints = balls.size();
  } else if (settings.color == "snr") {
    throw InvalidArgument("--color snr colours keypoints", "give them with --keypoints KP.json");
  }
  if (!settings.lines.empty()) {
    scene.polylines = read_lines(settings.lines, settings.line_width, context.read.limits);
  }
  scene.scale = wanted_scale(scene.scale, settings);
  if (signal.values.size() > 0) set_color_scale(scene, signal, scene.scale);
  scene.legend.title = settings.title;
  scene.legend.caption = settings.caption;
  if (settings.no_legend) scene.legend = {};
  return scene;
}

void render(const Settings& settings, Context& context) {
  const auto [width, height] = parse_pair(settings.size, 'x', "size");
  RenderOptions options;
  if (!(width >= 16.0 && width <= 16384.0 && height >= 16.0 && height <= 16384.0) ||
      width != std::floor(width) || height != std::floor(height)) {
    throw InvalidArgument("size is \"" + escaped(settings.size, 40) +
                          "\", legal: whole numbers from 16x16 to 16384x16384");
  }
  options.width = static_cast<int>(width);
  options.height = static_cast<int>(height);
  options.camera = camera_of(settings.view);
  options.camera.perspective = settings.perspective;
  if (settings.background == "transparent") options.background = Background::transparent;
  output_format(context, settings.output, "", {"png"});
  const auto start = std::chrono::steady_clock::now();
  Scene scene;
  Image image;
  std::size_t num_keypoints = 0;
  Eigen::Index num_vertices = 0;
  WarningList warnings;
  with_progress(context, "render", [&] {
    const LoadedSurface surface = load_surface(settings.mesh, context);
    num_vertices = surface.num_input_vertices;
    warnings = surface.warnings;
    scene = make_scene(surface, settings, num_keypoints, context);
    image = render_surface(scene, options, context.run.stage(0.6, 1.0));
  });
  write_png(settings.output, image);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  context.say(fmt::format("{}: {} vertices, {} faces, {} keypoints, {:.2f} s", settings.output,
                          num_vertices, scene.surfaces[0].triangles.rows(), num_keypoints,
                          seconds.count()));
  nlohmann::ordered_json document{{"output", settings.output},
                                  {"width", options.width},
                                  {"height", options.height},
                                  {"vertices", num_vertices},
                                  {"faces", scene.surfaces[0].triangles.rows()},
                                  {"keypoints", num_keypoints},
                                  {"lines", scene.polylines.size()}};
  document["range"] = scene.surfaces[0].scalar.size() + scene.surfaces[0].colors.size() > 0
                          ? nlohmann::ordered_json{scene.scale.range.low, scene.scale.range.high}
                          : nlohmann::ordered_json();
  document["seconds"] = seconds.count();
  document["warnings"] = to_json(warnings);
  context.print_json(document);
}

}  // namespace

void add_render(CLI::App& app, Context& context) {
  auto settings = std::make_shared<Settings>();
  CLI::App* verb = app.add_subcommand("render", "Draw a surface, its signals and keypoints as PNG");
  verb->footer(
      "Examples:\n"
      "  dupin render armadillo.off -o plain.png --view 210,15\n"
      "  dupin render armadillo.off -o loc.png --color si_loc --level 20\n"
      "  dupin keypoints armadillo.off --json > kp.json\n"
      "  dupin render armadillo.off -o keypoints.png --keypoints kp.json\n"
      "  dupin render armadillo.off -o crest.png --lines lines.ply");
  add_global_options(*verb, context);
  add_input_format(*verb, context);
  verb->add_option("mesh", settings->mesh, "Surface; - is standard input")->required();
  verb->add_option("-o,--output", settings->output, "PNG to write")->required();
  verb->add_option("--color", settings->color,
                   "none, height, H, K, k1, k2, loc, si_loc, snr (of keypoints) or FILE.npy")
      ->capture_default_str();
  verb->add_option("--level", settings->level, "Level of loc and si_loc, row of FILE.npy")
      ->check(CLI::Range(0, 10'000))
      ->capture_default_str();
  verb->add_option("--keypoints", settings->keypoints, "Output of dupin keypoints --json");
  verb->add_option("--largest-ball", settings->largest_ball,
                   "Widest radius drawn as a ball, in percent of the box diagonal; wider ones get "
                   "a pin only")
      ->check(in_range(0.0, 1000.0))
      ->capture_default_str();
  verb->add_option(
      "--lines", settings->lines,
      "Lines to draw: OBJ with l elements, or the PLY of dupin crest, as thick as its scales");
  verb->add_option("--line-width", settings->line_width,
                   "Width of the lines, of scales at their median [px]")
      ->check(in_range(0.1, 100.0))
      ->capture_default_str();
  verb->add_option("--view", settings->view,
                   "front, back, left, right, top, bottom, iso, or AZIMUTH,ELEVATION in degrees")
      ->capture_default_str();
  verb->add_option("--perspective", settings->perspective,
                   "Size of the scene over the distance of the eye; 0: parallel projection")
      ->check(in_range(0.0, 0.8))
      ->capture_default_str();
  verb->add_option("--size", settings->size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  verb->add_option("--map", settings->map, "Colour map (default: by the sign of the values)")
      ->check(CLI::IsMember({"diverging", "sequential"}));
  verb->add_option("--range", settings->range, "LOW,HIGH of the colours (default: 2 % left out)");
  verb->add_option("--no-value", settings->no_value,
                   "Number that stands for no value in FILE.npy: grey in the picture");
  verb->add_option("--no-value-label", settings->no_value_label, "Its name in the legend")
      ->capture_default_str();
  verb->add_option("--title", settings->title, "Title over the picture");
  verb->add_option("--caption", settings->caption, "Line under the picture");
  verb->add_flag("--no-legend", settings->no_legend, "The picture alone");
  verb->add_option("--background", settings->background, "white or transparent")
      ->check(CLI::IsMember({"white", "transparent"}))
      ->capture_default_str();
  verb->callback([settings, &context] { render(*settings, context); });
}

}  // namespace dupin::cli
