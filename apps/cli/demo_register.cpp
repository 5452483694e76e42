#include "demo_register.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "dupin/base/random.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"
#include "dupin/render/range_view.h"
#include "dupin/render/ticks.h"
#include "registration_report.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kApart = 40.0;     // degrees between the two positions of the camera
constexpr double kNoise = 20.0;     // percent of a pixel
constexpr double kUnit = 25.4;      // of the moving scan: millimetres for inches
constexpr int kMovingPixels = 150;  // along either side of the range picture
constexpr int kFixedPixels = 110;
constexpr int kHeight = 720;  // of a picture [px]
constexpr double kDegrees = 180.0 / std::numbers::pi;

// Bumps and hollows of three sizes on a sphere, stretched: no symmetry, and not two places alike.
Mesh rugged_body() {
  constexpr Eigen::Index kVertices = 20'000;
  Mesh body = make_sphere(1.0, kVertices).mesh;
  const BumpOptions layers[] = {{12, 0.14, 0.3, 1}, {30, -0.07, 0.17, 2}, {60, 0.05, 0.1, 3}};
  Eigen::VectorXd radius = Eigen::VectorXd::Ones(body.points.rows());
  for (const BumpOptions& layer : layers) {
    // All spheres of so many vertices have them in the same directions.
    radius.array() *=
        make_bumpy_sphere(1.0, kVertices, layer).surface.mesh.points.rowwise().norm().array();
  }
  body.points = body.points.array().colwise() * radius.array();
  body.points *= Eigen::Vector3d(1.4, 1.15, 1.0).asDiagonal();
  return body;
}

struct Scan {
  Mesh mesh;
  Pose world;  // from the points of the scan to the surface
};

// What a range camera sees, in a random pose of its own.
Scan scan_from(const Mesh& surface, const Camera& view, int pixels, double unit, Rng& rng,
               const RunControl& run) {
  const RangeCamera camera = fit_range_camera(surface.points, view, pixels, pixels);
  const Eigen::Vector3d middle =
      0.5 * (surface.points.colwise().minCoeff() + surface.points.colwise().maxCoeff()).transpose();
  RangeViewOptions options;
  options.noise_sigma = kNoise / 100.0 * camera.pixel * (camera.position - middle).norm();
  options.max_incidence_deg = 80.0;
  options.seed = rng.next();
  Scan scan;
  scan.mesh = scan_range_view(surface, camera, options, run).mesh;
  run.throw_if_cancelled();
  Pose motion;
  motion.scale = unit;
  motion.rotation = random_rotation(rng);
  const double size = unit * (camera.position - middle).norm();
  for (Eigen::Index k = 0; k < 3; ++k) motion.translation[k] = 0.2 * rng.uniform(-size, size);
  scan.mesh.points = transformed(scan.mesh.points, motion);
  scan.world = compose({1.0, camera.rotation.transpose(), camera.position}, inverse(motion));
  return scan;
}

// x -> -x in the unit of the fixed scan, with faces turned over so that they still look outward: no
// rotation undoes it.
Mesh mirrored(Mesh mesh) {
  mesh.points /= kUnit;
  mesh.points.col(0) *= -1.0;
  mesh.triangles.col(1).swap(mesh.triangles.col(2));
  return mesh;
}

DemoSubject subject_of(const fs::path& directory, const std::string& name, const Mesh& mesh) {
  DemoSubject out;
  out.name = name;
  out.title = name;
  out.file = (directory / (name + ".ply")).string();
  out.mesh = to_polygon_mesh(mesh);
  write_subject(out);
  return out;
}

RegistrationAnswer registered(const DemoSubject& moving, const DemoSubject& fixed,
                              const std::string& scale, Context& context) {
  RegistrationQuestion question;
  question.scale = scale;
  question.try_given_pose = false;
  return answer_registration(to_loaded_surface(moving.mesh, moving.name, context),
                             to_loaded_surface(fixed.mesh, fixed.name, context), question,
                             moving.name, context.run);
}

void add_figures(HtmlReport& report, const RegistrationAnswer& answer, const Pose& truth) {
  const double turn = rotation_angle(answer.pose.rotation, truth.rotation) * kDegrees;
  const Points middle = answer.moving.points.colwise().mean();
  const double shift = (transformed(middle, answer.pose) - transformed(middle, truth)).norm();
  const auto known = [](const std::optional<double>& value) {
    return value ? format_number(*value) : "not known";
  };
  report.add_table(
      {"figure", "found", "standard deviation", "error"},
      {{"scale", format_number(answer.pose.scale, 6), known(answer.scale_sd),
        format_number(std::abs(answer.pose.scale - truth.scale), 2)},
       {"turn (degrees)",
        format_number(rotation_angle(Eigen::Matrix3d::Identity(), answer.pose.rotation) * kDegrees,
                      5),
        known(answer.rotation_sd), format_number(turn, 2)},
       {"place of the moving scan", "", known(answer.translation_sd), format_number(shift, 2)}},
      fmt::format("The pose against the truth, which the cameras know. {:.0f} % of the moving and "
                  "{:.0f} % of the fixed scan rest on each other; confidence {}.",
                  100.0 * answer.overlap.value_or(0.0), 100.0 * answer.overlap_fixed.value_or(0.0),
                  format_number(answer.confidence.value_or(0.0))));
}

nlohmann::ordered_json figures_of(const RegistrationAnswer& answer) {
  return {{"accepted", answer.accepted},
          {"refusal", name_of(answer.refusal)},
          {"scale", answer.pose.scale},
          {"overlap", number_or_null(answer.overlap)},
          {"confidence", number_or_null(answer.confidence)},
          {"seconds", answer.seconds}};
}

}  // namespace

nlohmann::ordered_json add_registration(HtmlReport& report, const fs::path& directory,
                                        Context& context) {
  const Mesh surface = rugged_body();
  Rng rng(context.seed);
  Camera view = camera_of("35,15");
  view.perspective = 0.2;
  const Scan fixed_scan = scan_from(surface, view, kFixedPixels, 1.0, rng, context.run);
  view.azimuth_deg += kApart;
  const Scan moving_scan = scan_from(surface, view, kMovingPixels, kUnit, rng, context.run);
  const DemoSubject fixed = subject_of(directory, "rugged-fixed", fixed_scan.mesh);
  const DemoSubject moving = subject_of(directory, "rugged-moving", moving_scan.mesh);
  const DemoSubject mirror = subject_of(directory, "rugged-mirror", mirrored(moving_scan.mesh));

  report.add_section(
      "Registration",
      fmt::format(
          "Two range pictures of a rugged body made here, {:.0f} degrees apart, in poses and "
          "units of their own ({} and {} points, noise {:.0f} % of a pixel), brought "
          "together from their shapes alone.",
          kApart, moving_scan.mesh.points.rows(), fixed_scan.mesh.points.rows(), kNoise));
  const RegistrationAnswer answer = registered(moving, fixed, "estimate", context);
  const auto draw_one = [&](const RegistrationPicture& picture, const std::string& name) {
    return drawn_beside(picture, directory.string(), "rugged-" + name + ".png", kDemoWidth, kHeight,
                        context.run);
  };
  const RegistrationPictures pictures = pictures_of(answer);
  report.add_colors({legend_of(moving_color(), "moving scan"),
                     legend_of(fixed_color(), "fixed scan"),
                     legend_of(agreeing_color(), "matches that agree on the pose"),
                     legend_of(other_color(), "matches that do not")});
  report.add_pictures(
      {draw_one(pictures.before[0], "before"), draw_one(pictures.after[0], "after")});
  report.add_pictures({draw_one(pictures.matches[0], "matches")});
  const ScanResiduals residuals = compute_residuals(answer.moving_scan, answer.fixed_scan,
                                                    answer.local, answer.is_flipped, context.run);
  context.run.throw_if_cancelled();
  report.add_svg(format_svg(distance_plot(answer, residuals)), distance_caption(answer, residuals));
  add_figures(report, answer, compose(inverse(fixed_scan.world), moving_scan.world));

  report.add_heading("What must be refused");
  const RegistrationAnswer refused = registered(mirror, fixed, "fixed", context);
  report.add_paragraph(fmt::format(
      "The mirror image of the moving scan has the same bumps and hollows, but no motion takes it "
      "onto the other one. The answer is {}: {}.",
      refused.accepted ? "a pose all the same" : "no", refused.sentence));
  report.add_pictures({draw_one(pictures_of(refused).after[0], "mirror")});
  report.add_heading("Make such pages yourself");
  report.add_commands({fmt::format("dupin register {} {} --report registered.html",
                                   shell_quoted(moving.file), shell_quoted(fixed.file)),
                       fmt::format("dupin register {} {} --scale fixed --report refused.html",
                                   shell_quoted(mirror.file), shell_quoted(fixed.file))});
  return {{"pair", figures_of(answer)}, {"mirror_image", figures_of(refused)}};
}

}  // namespace dupin::cli
