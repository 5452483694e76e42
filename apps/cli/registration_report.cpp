#include "registration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dupin/base/version.h"
#include "dupin/render/ticks.h"
#include "surface_picture.h"

namespace dupin::cli {
namespace {

using Eigen::Index;

constexpr int kWidth = 800;  // px
constexpr int kHeight = 600;
constexpr std::size_t kMostAgreeing = 60;  // lines that can still be followed
constexpr std::size_t kMostOthers = 30;
constexpr int kBars = 60;
constexpr double kDegrees = 180.0 / std::numbers::pi;

// As many digits as anybody reads; a table of them is no place for sixteen.
std::string number(double value) { return fmt::format("{:.6g}", value); }

std::string number(const std::optional<double>& value) {
  return value ? number(*value) : "not known";
}

DrawnMatches matches_of(const RegistrationAnswer& answer, const std::vector<FeaturePair>& pairs,
                        std::size_t most) {
  const auto count = static_cast<Index>(std::min(most, pairs.size()));
  Points from(count, 3);
  DrawnMatches out;
  out.to.resize(count, 3);
  for (Index k = 0; k < count; ++k) {
    const FeaturePair& pair = pairs[static_cast<std::size_t>(k)];
    from.row(k) = answer.moving.points.row(pair.moving);
    out.to.row(k) = answer.fixed.points.row(pair.fixed);
  }
  out.from = transformed(from, answer.pose);
  return out;
}

std::string matches_caption(const RegistrationAnswer& answer) {
  const auto told = [](std::size_t drawn, std::size_t all) {
    return drawn == all ? std::to_string(all) : fmt::format("{} of {}", drawn, all);
  };
  const std::size_t agreeing = answer.correspondences.size();
  const std::size_t others = answer.other_matches.size();
  std::string text =
      fmt::format("Green: {} matches that agree on the pose, their lines nearly level.",
                  told(std::min(agreeing, kMostAgreeing), agreeing));
  if (others > 0) {
    text += fmt::format(" Red: the most outstanding of those that do not, {}.",
                        told(std::min(others, kMostOthers), others));
  }
  return text;
}

// Share of `contact` in percent.
double percent(const std::vector<Contact>& contacts, Contact contact) {
  const auto count = std::count(contacts.begin(), contacts.end(), contact);
  return contacts.empty()
             ? 0.0
             : 100.0 * static_cast<double>(count) / static_cast<double>(contacts.size());
}

// Half of what the axis of the distances holds: nearly all that is in contact, in local units.
double widest_of(const ScanResiduals& residuals) {
  std::vector<double> size;
  const auto take = [&](const Eigen::VectorXd& height, const std::vector<Contact>& contact) {
    for (Index i = 0; i < height.size(); ++i) {
      if (contact[static_cast<std::size_t>(i)] != Contact::none)
        size.push_back(std::abs(height[i]));
    }
  };
  take(residuals.moving, residuals.moving_contact);
  take(residuals.fixed, residuals.fixed_contact);
  const double bound = 2.0 * residuals.touching_bound;
  if (size.empty()) return bound;
  const auto nearly =
      size.begin() + static_cast<std::ptrdiff_t>(0.97 * static_cast<double>(size.size()));
  std::nth_element(size.begin(), nearly, size.end());
  return std::clamp(1.5 * *nearly, 1e-3 * bound, bound);
}

// Outline of a histogram of the heights of points in contact, in percent of all points.
PlotSeries bars_of(const Eigen::VectorXd& height, const std::vector<Contact>& contact,
                   double widest, double unit) {
  std::vector<double> count(kBars, 0.0);
  for (Index i = 0; i < height.size(); ++i) {
    if (contact[static_cast<std::size_t>(i)] == Contact::none) continue;
    // What lies farther counts in the outermost bars.
    const double place = (std::clamp(height[i] / widest, -1.0, 1.0) + 1.0) / 2.0 * kBars;
    count[std::min<std::size_t>(static_cast<std::size_t>(place), kBars - 1)] += 1.0;
  }
  PlotSeries series;
  series.is_filled = true;
  for (int b = 0; b < kBars; ++b) {
    const double share = 100.0 * count[static_cast<std::size_t>(b)] /
                         static_cast<double>(std::max<Index>(1, height.size()));
    for (const int edge : {b, b + 1}) {
      series.x.push_back(unit * widest * (2.0 * edge / kBars - 1.0));
      series.y.push_back(share);
    }
  }
  return series;
}

RegistrationPicture distance_picture(const LoadedSurface& scan, const Points& normals,
                                     const Pose& pose, const Eigen::VectorXd& height,
                                     const std::vector<Contact>& contact, double unit,
                                     double widest, const Camera& camera, const std::string& name) {
  RegistrationPicture picture = overlay_picture(
      {drawn_scan(scan, normals, pose, kNoValueColor)}, camera, name + " by its distance",
      name +
          " by its distance from the other scan: red outside, blue inside, grey where the other "
          "one has no surface.");
  ColorSignal signal;
  signal.values = unit * height;
  signal.label = "distance";
  signal.absent_label = "none";
  for (const Contact one : contact) signal.is_absent.push_back(one == Contact::none ? 1 : 0);
  color_by(picture.scene, signal);
  ColorScale scale;
  scale.map = ColorMap::diverging;
  scale.range = {-unit * widest, unit * widest};
  set_color_scale(picture.scene, signal, scale);
  return picture;
}

void add_figures(HtmlReport& report, const RegistrationAnswer& answer) {
  report.add_section("Pose",
                     "Lengths in the unit of the fixed scan. The names are those of the "
                     "JSON document.");
  std::vector<std::vector<std::string>> rows;
  const auto row = [&](const char* name, const std::string& value, const char* meaning) {
    rows.push_back({name, value, meaning});
  };
  row("accepted", answer.accepted ? "true" : "false", answer.sentence.c_str());
  if (answer.has_pose) {
    row("scale", number(answer.pose.scale), "length in the fixed scan of one in the moving");
    row("scale_sd", number(answer.scale_sd), "standard deviation of the scale");
    row("rotation",
        number(rotation_angle(Eigen::Matrix3d::Identity(), answer.pose.rotation) * kDegrees),
        "angle of the turn, degrees");
    row("rotation_sd", number(answer.rotation_sd), "standard deviation of the turn, degrees");
    row("translation",
        fmt::format("{} {} {}", number(answer.pose.translation[0]),
                    number(answer.pose.translation[1]), number(answer.pose.translation[2])),
        "of the origin");
    row("translation_sd", number(answer.translation_sd),
        "standard deviation of the place of the overlap");
  }
  // The thesis knows its features alone.
  const bool is_thesis = answer.is_of_features;
  row("overlap", number(answer.overlap),
      is_thesis ? "share of the moving features that meet a fixed one"
                : "part of the moving scan that rests on the fixed one");
  row("overlap_fixed", number(answer.overlap_fixed),
      is_thesis ? "share of the fixed features that meet a moving one"
                : "part of the fixed scan that rests on the moving one");
  row("conflict", number(answer.conflict), "part of what both saw where they are apart");
  row("rmse", number(answer.rmse),
      is_thesis ? "distance of the features that meet" : "distance where they rest on each other");
  row("inliers", std::to_string(answer.inliers),
      is_thesis ? "fixed features that meet a moving one" : "samples that rest on the other scan");
  row("correspondences", std::to_string(answer.correspondences.size()),
      "features that agree on the pose");
  row("confidence", number(answer.confidence), "orders poses; no measured frequency");
  row("alternatives",
      answer.alternatives ? std::to_string(answer.alternatives->size()) : "not known",
      "other poses that fit as well");
  report.add_table({"figure", "value", "meaning"}, rows, "What is known of the pose.");
  if (!answer.has_pose) return;
  report.add_heading("From the moving to the fixed scan");
  std::vector<std::string> lines;
  for (Index r = 0; r < 3; ++r) {
    const Eigen::Vector3d m = answer.pose.scale * answer.pose.rotation.row(r).transpose();
    lines.push_back(fmt::format("{:16.9g} {:16.9g} {:16.9g} {:16.9g}", m[0], m[1], m[2],
                                answer.pose.translation[r]));
  }
  report.add_commands(lines);
}

void add_alternatives(HtmlReport& report, const RegistrationAnswer& answer) {
  if (!answer.alternatives || answer.alternatives->empty()) return;
  report.add_section("Other poses",
                     "These fit as well: the object is symmetric, and the scans cannot tell which "
                     "pose is meant.");
  std::vector<std::vector<std::string>> rows;
  const auto row = [&](const std::string& name, const Pose& local, const PoseFit& fit,
                       double confidence) {
    const Pose pose = between_inputs(local, answer.moving, answer.fixed);
    const double turn = rotation_angle(pose.rotation, answer.pose.rotation) * kDegrees;
    rows.push_back({name, number(turn), number(pose.scale), number(fit.overlap_moving),
                    number(fit.overlap_fixed), number(fit.conflict), number(confidence)});
  };
  PoseFit best;
  best.overlap_moving = answer.overlap.value_or(0.0);
  best.overlap_fixed = answer.overlap_fixed.value_or(0.0);
  best.conflict = answer.conflict.value_or(0.0);
  row("best", answer.local, best, answer.confidence.value_or(0.0));
  for (std::size_t k = 0; k < answer.alternatives->size(); ++k) {
    const PoseCandidate& other = (*answer.alternatives)[k];
    row(std::to_string(k + 1), other.pose, other.fit, other.confidence);
  }
  report.add_table(
      {"pose", "turned by", "scale", "overlap", "overlap_fixed", "conflict", "confidence"}, rows,
      "The turn is from the best pose, in degrees.");
}

void add_warnings(HtmlReport& report, const std::vector<std::pair<std::string, WarningList>>& all) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& [file, warnings] : all) {
    for (const Warning& w : warnings.all())
      rows.push_back({file, w.code, std::to_string(w.count), w.first, w.message});
  }
  if (rows.empty()) return;
  report.add_section("Repairs");
  report.add_table({"file", "code", "count", "first", "what"}, rows,
                   "What was repaired before the scans were looked at.");
}

std::string verdict(const RegistrationAnswer& answer, const std::string& moving,
                    const std::string& fixed) {
  if (answer.accepted) return moving + " was brought onto " + fixed + ".";
  return fmt::format("{} was not brought onto {}: {}.{}", moving, fixed, answer.sentence,
                     answer.has_pose ? " What follows shows the best candidate." : "");
}

}  // namespace

RegistrationPictures pictures_of(const RegistrationAnswer& answer) {
  RegistrationPictures out;
  const SceneSurface there =
      drawn_scan(answer.fixed, answer.fixed_scan.normals, Pose(), fixed_color());
  const SceneSurface given =
      drawn_scan(answer.moving, answer.moving_scan.normals, Pose(), moving_color());
  const SceneSurface here =
      drawn_scan(answer.moving, answer.moving_scan.normals, answer.pose, moving_color());
  const auto cameras = two_cameras(answer.has_pose ? std::vector<SceneSurface>{there, here}
                                                   : std::vector<SceneSurface>{there});
  const char* const views[] = {"", " From another side."};
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    out.before.push_back(overlay_or_row({given, there}, cameras[v], "the scans before",
                                        "Before: as the files give them." + std::string(views[v])));
    if (!answer.has_pose) continue;
    out.after.push_back(
        overlay_picture({here, there}, cameras[v], "the scans after",
                        (answer.accepted ? "After: in the frame of the fixed scan."
                                         : "The best candidate, which was refused.") +
                            std::string(views[v])));
  }
  if (!answer.has_pose) return out;
  std::vector<DrawnMatches> matches = {matches_of(answer, answer.correspondences, kMostAgreeing),
                                       matches_of(answer, answer.other_matches, kMostOthers)};
  matches[0].color = agreeing_color();
  matches[0].width_px = 2.2;
  matches[1].color = other_color();
  matches[1].width_px = 1.2;
  out.matches.push_back(matches_picture(here, there, matches, cameras[0], "matches of features",
                                        matches_caption(answer)));
  return out;
}

Plot distance_plot(const RegistrationAnswer& answer, const ScanResiduals& residuals) {
  const double unit = answer.fixed.unit;
  const double bound = residuals.touching_bound;
  const double widest = widest_of(residuals);
  Plot plot;
  plot.x_label = "distance from the other scan (unit of the fixed scan)";
  plot.y_label = "percent of the points";
  plot.has_zero_line = false;
  plot.width = 960;
  plot.height = 340;
  PlotSeries fixed = bars_of(residuals.fixed, residuals.fixed_contact, widest, unit);
  fixed.label = "fixed";
  fixed.color = 0;
  PlotSeries moving = bars_of(residuals.moving, residuals.moving_contact, widest, unit);
  moving.label = "moving";
  moving.color = 4;
  plot.series = {std::move(fixed), std::move(moving)};
  if (bound < widest)
    plot.guides = {{-bound * unit, "limit of contact"}, {bound * unit, "limit of contact"}};
  return plot;
}

std::string distance_caption(const RegistrationAnswer& answer, const ScanResiduals& residuals) {
  return fmt::format(
      "Distances of single points, with their noise, from the smooth surface of the other scan. "
      "Within {} a point rests on it: {:.1f} % of the moving and {:.1f} % of the fixed points do; "
      "{:.1f} and {:.1f} % lie over it but farther away, the rest where it has no surface. The "
      "outermost bars hold all that lies beyond.",
      format_number(residuals.touching_bound * answer.fixed.unit),
      percent(residuals.moving_contact, Contact::touching),
      percent(residuals.fixed_contact, Contact::touching),
      percent(residuals.moving_contact, Contact::apart),
      percent(residuals.fixed_contact, Contact::apart));
}

std::string registration_page(const RegistrationAnswer& answer, const std::string& moving,
                              const std::string& fixed, const std::string& command,
                              const RunControl& run) {
  HtmlReport report(answer.accepted ? "Registered" : "Not registered",
                    verdict(answer, moving, fixed));
  const std::vector<ReportColor> colors = {legend_of(moving_color(), moving + ", moving"),
                                           legend_of(fixed_color(), fixed + ", fixed")};
  const auto draw_all = [&](const std::vector<RegistrationPicture>& pictures) {
    std::vector<ReportPicture> out;
    for (const RegistrationPicture& picture : pictures)
      out.push_back(embedded(picture, kWidth, kHeight, run));
    if (!out.empty()) report.add_pictures(out);
  };
  const RegistrationPictures pictures = pictures_of(answer);
  report.add_section(answer.has_pose ? "Before and after" : "The scans");
  report.add_colors(colors);
  draw_all(pictures.before);
  run.report(0.35);
  draw_all(pictures.after);
  run.report(0.7);
  if (answer.has_pose) {
    report.add_section("Matches", "The scans in the pose found, drawn apart.");
    draw_all(pictures.matches);
    const ScanResiduals residuals = compute_residuals(answer.moving_scan, answer.fixed_scan,
                                                      answer.local, answer.is_flipped, run);
    run.throw_if_cancelled();
    report.add_section("Distances");
    const Camera& camera = pictures.after.front().camera;
    const double unit = answer.fixed.unit;
    const double widest = widest_of(residuals);
    draw_all(
        {distance_picture(answer.moving, answer.moving_scan.normals, answer.pose, residuals.moving,
                          residuals.moving_contact, unit, widest, camera, moving),
         distance_picture(answer.fixed, answer.fixed_scan.normals, Pose(), residuals.fixed,
                          residuals.fixed_contact, unit, widest, camera, fixed)});
    report.add_svg(format_svg(distance_plot(answer, residuals)),
                   distance_caption(answer, residuals));
  }
  add_figures(report, answer);
  add_alternatives(report, answer);
  add_warnings(report, {{moving, answer.moving.warnings}, {fixed, answer.fixed.warnings}});
  report.add_section("Make this page yourself");
  report.add_commands({command});
  return report.page(fmt::format("Made by dupin {}.", kVersion));
}

}  // namespace dupin::cli
