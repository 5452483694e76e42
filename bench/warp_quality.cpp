// What warping reaches where the truth is known: the tables of docs/methods/warp_deformation.md and
// docs/methods/warp_contours.md.
//
// warp_quality                      # the sleeve that hangs beside its torso
// warp_quality --limbs DIR          # limbs of drawn figures and of cut-outs, turned about joints
// warp_quality --pairs DIR          # garments on two bodies with a dense true flow, X_src.png,
//                                   # X_dst.png, X_flow.npy.gz (float32, rows by columns by 2)
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/io/file.h"
#include "dupin/io/formats.h"
#include "dupin/io/png.h"
#include "dupin/warp/deform.h"
#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/shape_from_image.h"
#include "dupin/warp/silhouette_fit.h"
#include "dupin/warp/triangulate_outline.h"
#include "tests/support/limb_cases.h"
#include "tests/support/planar_shapes.h"

namespace {

using dupin::Points2;
using Eigen::Index;

// The values below which `share` of all lie.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto at = std::min(values.size() - 1,
                           static_cast<std::size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

// ---- the sleeve ------------------------------------------------------------------------------

double torso_motion(dupin::WarpMetric metric, double alpha, int iterations) {
  const dupin::PlanarMesh mesh = dupin::test::sleeve_shape();
  const double places[][4] = {{20, 145, -35, 130}, {20, 90, -12, 82},  {45, 15, 45, 15},
                              {95, 15, 95, 15},    {50, 190, 50, 190}, {140, 190, 140, 190},
                              {50, 60, 50, 60},    {140, 60, 140, 60}};
  std::vector<dupin::Pin> pins;
  for (const auto& place : places) {
    dupin::Pin pin;
    pin.source = {place[0], place[1]};
    pin.target = {place[2], place[3]};
    pins.push_back(pin);
  }
  dupin::DeformOptions options;
  options.warp.metric = metric;
  options.warp.iterations = iterations;
  options.warp.mls.alpha = alpha;
  options.is_polished = false;
  const Points2 moved = deform(mesh, pins, options).points;
  double largest = 0.0;
  for (Index v = 0; v < moved.rows(); ++v) {
    if (mesh.points(v, 0) >= 45.0 && mesh.points(v, 1) > 75.0)
      largest = std::max(largest, (moved.row(v) - mesh.points.row(v)).norm());
  }
  return largest / (pins[0].target - pins[0].source).norm();
}

void print_sleeve() {
  std::printf(
      "\nLargest motion of the torso over that of the cuff [%%].\n\n"
      "| distances | alpha | MLS alone | 1 iteration | 10 | 50 |\n|---|---|---|---|---|---|\n");
  for (const auto metric : {dupin::WarpMetric::geodesic, dupin::WarpMetric::euclidean}) {
    for (const double alpha : {2.0, 4.0}) {
      std::printf("| %s | %.0f |",
                  metric == dupin::WarpMetric::geodesic ? "inside the shape" : "Euclidean", alpha);
      for (const int iterations : {0, 1, 10, 50})
        std::printf(" %.2f |", 100.0 * torso_motion(metric, alpha, iterations));
      std::printf("\n");
    }
  }
}

// ---- garments on two bodies ------------------------------------------------------------------

// For every pixel of the second picture the pixel of the first, both counted from 0 (their centres
// lie half a pixel on); NaN outside.
struct Flow {
  Index rows = 0;
  Index columns = 0;
  std::vector<float> source;
};

Flow read_flow(const std::string& path) {
  const dupin::FileBytes file = dupin::FileBytes::open(path, {});
  const std::vector<std::uint8_t> bytes = dupin::detail::gunzip(file.bytes(), path, {});
  const auto bad = [&] {
    return dupin::IoError(dupin::Errc::malformed, "E_PARSE",
                          "not a float32 array of rows by columns by 2", {path});
  };
  if (bytes.size() < 10 || std::memcmp(bytes.data(), "\x93NUMPY\x01", 7) != 0) throw bad();
  const std::size_t start = 10U + bytes[8] + 256U * bytes[9];
  if (bytes.size() < start) throw bad();
  const std::string header(bytes.begin() + 10, bytes.begin() + static_cast<std::ptrdiff_t>(start));
  const std::size_t shape = header.find("'shape': (");
  long rows = 0;
  long columns = 0;
  if (header.find("'<f4'") == std::string::npos || header.find("False") == std::string::npos ||
      shape == std::string::npos ||
      std::sscanf(header.c_str() + shape, "'shape': (%ld, %ld, 2)", &rows, &columns) != 2 ||
      rows < 1 || columns < 1 || rows > 32768 || columns > 32768)
    throw bad();
  Flow flow{rows, columns, {}};
  flow.source.resize(static_cast<std::size_t>(2 * rows * columns));
  if (bytes.size() != start + flow.source.size() * sizeof(float)) throw bad();
  std::memcpy(flow.source.data(), bytes.data() + start, flow.source.size() * sizeof(float));
  return flow;
}

Points2 contour_of(const std::string& path) {
  const dupin::ImageShape shape = dupin::shape_from_image(dupin::read_png(path).raster);
  return shape.outline.loops.at(0);
}

// Places inside the first picture whose place in the second is known: rows (source, target).
Eigen::Matrix<double, Eigen::Dynamic, 4> true_pairs(const Flow& flow, Index count) {
  dupin::Rng rng(7);
  Eigen::Matrix<double, Eigen::Dynamic, 4> pairs(count, 4);
  for (Index found = 0; found < count;) {
    const auto y = static_cast<Index>(rng.below(static_cast<std::uint64_t>(flow.rows)));
    const auto x = static_cast<Index>(rng.below(static_cast<std::uint64_t>(flow.columns)));
    const float* at = flow.source.data() + 2 * (y * flow.columns + x);
    if (!std::isfinite(at[0]) || !std::isfinite(at[1])) continue;
    pairs.row(found++) << static_cast<double>(at[0]) + 0.5, static_cast<double>(at[1]) + 0.5,
        static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5;
  }
  return pairs;
}

// A garment as a mesh with its border, and the fine stage that pulls it to a silhouette.
struct Garment {
  dupin::TriangulatedOutline mesh;
  std::vector<std::int32_t> component;  // of the loops
};

Garment mesh_of(const std::string& path, double rows) {
  const dupin::ImageShape shape = dupin::shape_from_image(dupin::read_png(path).raster);
  const Points2& outer = shape.outline.loops.at(0);
  dupin::OutlineOptions outline;
  outline.spacing_px = (outer.col(1).maxCoeff() - outer.col(1).minCoeff()) / rows;
  dupin::MeshingOptions meshing;
  meshing.spacing_px = outline.spacing_px;
  const dupin::PreparedOutline prepared = dupin::prepare_outline(shape.outline, outline);
  return {dupin::triangulate_outline(prepared.outline, {}, meshing), prepared.outline.component};
}

struct Measured {
  double iou = 0.0;
  Index flipped = 0;
  double median = 0.0;
  double most = 0.0;
};

Measured measure_fit(const Garment& garment, const dupin::SilhouetteFit& fit, const Points2& to,
                     const Eigen::Matrix<double, Eigen::Dynamic, 4>& pairs,
                     const dupin::DeformOptions& options) {
  dupin::DeformStage stage;
  stage.mode = dupin::DeformMode::fine;
  for (const dupin::WarpPin& given : fit.pins) {
    dupin::Pin pin;
    pin.source = given.source.transpose();
    pin.target = given.target.transpose();
    stage.pins.push_back(pin);
  }
  const dupin::PlanarMesh& mesh = garment.mesh.mesh;
  const dupin::Deformation result = dupin::deform(mesh, {stage}, options);
  dupin::Outline border;
  border.component = {0};
  border.loops = {dupin::border_loops(garment.mesh.border, result.points).at(0)};
  std::vector<double> errors;
  for (Index i = 0; i < pairs.rows(); ++i) {
    const dupin::MeshPoint place =
        dupin::closest_mesh_point(mesh, pairs.row(i).head<2>().transpose());
    errors.push_back(
        (dupin::position(result.points, mesh.triangles, place) - pairs.row(i).tail<2>().transpose())
            .norm());
  }
  return {dupin::compute_overlap(border, dupin::Outline{{to}, {0}}).iou,
          static_cast<Index>(result.quality.flipped.size()), quantile(errors, 0.5),
          quantile(errors, 0.9)};
}

void print_pairs(const std::string& directory, double rows) {
  std::printf(
      "\nGarments on two bodies, through the mesh: overlap of the border of the warped mesh with "
      "the "
      "silhouette, errors of 1500 places inside, median and 90 %% [px].\n\n"
      "| garment | pins | IoU before | contour | mesh | flipped | image-space IoU | unwarped | "
      "mesh | image-space |\n|---|---|---|---|---|---|---|---|---|---|\n");
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    const std::string name = entry.path().filename().string();
    if (name.size() > 8 && name.ends_with("_src.png"))
      names.push_back(name.substr(0, name.size() - 8));
  }
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) {
    const std::string path = directory + "/" + name;
    const Points2 from = contour_of(path + "_src.png");
    const Points2 to = contour_of(path + "_dst.png");
    const dupin::SilhouetteFit fit = dupin::fit_silhouette(from, to);
    const auto pairs = true_pairs(read_flow(path + "_flow.npy.gz"), 1500);
    const Garment garment = mesh_of(path + "_src.png", rows);
    const Measured warped = measure_fit(garment, fit, to, pairs, {});
    const Measured image = measure_fit(garment, fit, to, pairs, dupin::test::image_space_options());
    std::vector<double> still;
    for (Index i = 0; i < pairs.rows(); ++i)
      still.push_back((pairs.row(i).head<2>() - pairs.row(i).tail<2>()).norm());
    std::printf(
        "| %s | %zu | %.3f | %.3f | %.3f | %ld | %.3f | %.2f, %.1f | %.2f, %.1f | %.2f, "
        "%.1f |\n",
        name.c_str(), fit.pins.size(), fit.before.iou, fit.fitted.iou, warped.iou,
        static_cast<long>(warped.flipped), image.iou, quantile(still, 0.5), quantile(still, 0.9),
        warped.median, warped.most, image.median, image.most);
    std::fflush(stdout);
  }
}

// ---- limbs -----------------------------------------------------------------------------------

void print_limb(const std::string& picture, const dupin::PlanarMesh& mesh,
                const dupin::test::LimbCase& limb) {
  const dupin::test::LimbErrors all[] = {
      measure_limb(mesh, limb, {}), measure_limb(mesh, limb, dupin::test::thesis_options()),
      measure_limb(mesh, limb, dupin::test::image_space_options())};
  std::printf("| %s, %s, %.0f |", picture.c_str(), limb.name.c_str(), limb.angle_deg);
  for (const dupin::test::LimbErrors& errors : all)
    std::printf(" %.2f, %.2f | %.2f, %.2f | %ld |", 100.0 * errors.limb_median,
                100.0 * errors.limb_most, 100.0 * errors.body_median, 100.0 * errors.body_most,
                static_cast<long>(errors.flipped));
  std::printf("\n");
  std::fflush(stdout);
}

void print_limbs(const std::string& directory, double rows) {
  std::printf(
      "\nA limb turned about its joint: errors of the dense map, median and 90 %% [%% of the "
      "height], flipped triangles.\n\n"
      "| limb, angle | limb | body | flipped | thesis: limb | body | flipped | image-space: limb | "
      "body | flipped |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const dupin::test::LimbPicture& figure : dupin::test::drawn_figures()) {
    const dupin::PlanarMesh mesh = dupin::test::mesh_of_picture(figure.raster, rows);
    for (const dupin::test::LimbCase& limb : figure.limbs) print_limb(figure.name, mesh, limb);
  }
  for (dupin::test::LimbPicture& cut_out : dupin::test::cut_out_limbs()) {
    const std::string path = directory + "/" + cut_out.name + ".png";
    const dupin::test::LimbPicture picture =
        dupin::test::with_picture(std::move(cut_out), dupin::read_png(path).raster);
    const dupin::PlanarMesh mesh = dupin::test::mesh_of_picture(picture.raster, rows);
    for (const dupin::test::LimbCase& limb : picture.limbs) print_limb("cut-out", mesh, limb);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string pairs;
  std::string limbs;
  double rows = 60.0;
  CLI::App app("What warping reaches where the truth is known");
  app.add_option("--pairs", pairs, "folder with X_src.png, X_dst.png and X_flow.npy.gz");
  app.add_option("--limbs", limbs, "folder of cut-outs; drawn figures are built in");
  app.add_option("--rows", rows, "triangles in the height of a shape (60)");
  CLI11_PARSE(app, argc, argv);
  try {
    if (!limbs.empty()) print_limbs(limbs, rows);
    if (!pairs.empty()) print_pairs(pairs, rows);
    if (limbs.empty() && pairs.empty()) print_sleeve();
  } catch (const dupin::Error& error) {
    std::cerr << error.diagnostic() << '\n';
    return 1;
  }
  return 0;
}
