// What the parts of registration are worth one by one, on parts of 70 % overlap with known truth:
// frames of feature points (thesis 5.5.3) and descriptors (5.5.4), and the matches of the product.
//
// registration_features --surfaces DIR [--draw N]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <iostream>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "bench/registration/pairs.h"
#include "dupin/base/error.h"
#include "dupin/registration/height_maps.h"
#include "dupin/registration/scan_features.h"
#include "dupin/registration/thesis_features.h"
#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/spatial/neighborhoods.h"
#include "dupin/surface/surface_graph.h"

namespace {

using dupin::bench::NamedPair;
using Eigen::Index;
using Eigen::VectorXd;

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Probability that a true pair has the smaller distance; ties count half.
double area_under_roc(std::vector<double> truth, std::vector<double> other) {
  if (truth.empty() || other.empty()) return std::nan("");
  std::sort(other.begin(), other.end());
  double sum = 0.0;
  for (const double one : truth) {
    const auto [low, high] = std::equal_range(other.begin(), other.end(), one);
    sum += static_cast<double>(other.end() - high) + 0.5 * static_cast<double>(high - low);
  }
  return sum / static_cast<double>(truth.size()) / static_cast<double>(other.size());
}

enum class Relation { same, different, unclear };

// Features of one structure lie within half its radius; those two radii apart are different ones.
Relation relation(const Eigen::RowVector3d& moving, const Eigen::RowVector3d& fixed,
                  double moving_radius, double fixed_radius) {
  const double radius = std::sqrt(moving_radius * fixed_radius);
  const double away = (moving - fixed).norm();
  if (away < 0.5 * radius) return Relation::same;
  return away > 2.0 * radius ? Relation::different : Relation::unclear;
}

// ---- the thesis's features -------------------------------------------------------------------

struct FrameScore {
  std::vector<double> angles;  // of the first tangent [deg]
};

std::vector<VectorXd> histograms(const dupin::ThesisFeatures& features, double range) {
  std::vector<VectorXd> all;
  for (const auto& one : features.features)
    all.push_back(dupin::loc_histogram(one.values, range, 32));
  return all;
}

double largest_value(const dupin::ThesisFeatures& features) {
  double largest = 0.0;
  for (const auto& one : features.features) {
    for (const double value : one.values) largest = std::max(largest, std::abs(value));
  }
  return largest;
}

struct Described {
  dupin::ThesisFeatures moving;
  dupin::ThesisFeatures fixed;
};

Described describe(const NamedPair& named, dupin::FrameRule frame, dupin::DescriptorValue value) {
  dupin::ThesisFeatureOptions options;
  options.frame = frame;
  options.value = value;
  return {describe_by_thesis(dupin::surface_graph(named.pair.moving), options),
          describe_by_thesis(dupin::surface_graph(named.pair.fixed), options)};
}

// Calls visit(moving feature, fixed feature, relation) for all pairs of one kind.
template <class Visit>
void visit_pairs(const NamedPair& named, const Described& described, const Visit& visit) {
  for (std::size_t i = 0; i < described.moving.features.size(); ++i) {
    const auto& a = described.moving.features[i];
    const Eigen::RowVector3d there =
        transformed(dupin::Points(a.position), named.pair.truth).row(0);
    for (std::size_t j = 0; j < described.fixed.features.size(); ++j) {
      const auto& b = described.fixed.features[j];
      if (a.keypoint.kind != b.keypoint.kind) continue;
      visit(i, j, relation(there, b.position, a.keypoint.radius, b.keypoint.radius));
    }
  }
}

void print_frames(const std::vector<NamedPair>& pairs) {
  std::printf(
      "\nFrames of one structure on both parts: median angle between the first tangents [deg], "
      "share within 20 degrees. By chance: 45 and .22 for a line, 90 and .11 for a direction.\n\n"
      "| noise | LoC | equal weights | Gaussian | gradient | pairs |\n|---|---|---|---|---|---|\n");
  const dupin::FrameRule rules[] = {dupin::FrameRule::loc, dupin::FrameRule::uniform,
                                    dupin::FrameRule::gaussian, dupin::FrameRule::gradient};
  for (const int noise : {0, 20, 50}) {
    std::printf("| %d %% |", noise);
    std::size_t count = 0;
    for (const dupin::FrameRule rule : rules) {
      std::vector<double> angles;
      for (const NamedPair& named : pairs) {
        if (named.noise_percent != noise || named.overlap_percent != 70) continue;
        const Described described = describe(named, rule, dupin::DescriptorValue::loc);
        visit_pairs(named, described, [&](std::size_t i, std::size_t j, Relation relation) {
          if (relation != Relation::same) return;
          const Eigen::Vector3d a =
              named.pair.truth.rotation * described.moving.features[i].frame.col(0);
          double cosine = a.dot(described.fixed.features[j].frame.col(0));
          if (rule != dupin::FrameRule::gradient) cosine = std::abs(cosine);
          angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / std::numbers::pi);
        });
      }
      count = angles.size();
      const auto near =
          std::count_if(angles.begin(), angles.end(), [](double a) { return a < 20; });
      std::printf(" %.1f, %.2f |", median(angles),
                  static_cast<double>(near) / static_cast<double>(std::max<std::size_t>(1, count)));
    }
    std::printf(" %zu |\n", count);
    std::fflush(stdout);
  }
}

void print_histograms(const std::vector<NamedPair>& pairs) {
  std::printf(
      "\nDescriptors of the thesis: area under the ROC of the L2 distance of histograms, features "
      "of one structure against features of different ones.\n\n"
      "| noise | LoC | smoothed curvature |\n|---|---|---|\n");
  for (const int noise : {0, 20, 50}) {
    std::printf("| %d %% |", noise);
    for (const auto value : {dupin::DescriptorValue::loc, dupin::DescriptorValue::signal}) {
      std::vector<double> same;
      std::vector<double> different;
      for (const NamedPair& named : pairs) {
        if (named.noise_percent != noise || named.overlap_percent != 70) continue;
        const Described described = describe(named, dupin::FrameRule::loc, value);
        const double range =
            std::max(largest_value(described.moving), largest_value(described.fixed));
        if (!(range > 0.0)) continue;
        const auto a = histograms(described.moving, range);
        const auto b = histograms(described.fixed, range);
        visit_pairs(named, described, [&](std::size_t i, std::size_t j, Relation relation) {
          if (relation == Relation::unclear) return;
          (relation == Relation::same ? same : different).push_back((a[i] - b[j]).norm());
        });
      }
      std::printf(" %.3f |", area_under_roc(same, different));
    }
    std::printf("\n");
    std::fflush(stdout);
  }
}

// ---- the product's matches -------------------------------------------------------------------

// si-LoC at each keypoint over the levels about its own, what Eq. 5.31 makes comparable.
std::vector<VectorXd> profiles(const dupin::ScanFeatures& scan, int reach) {
  const dupin::SurfaceGraph graph =
      dupin::surface_graph(dupin::PointCloud{scan.coarse, scan.coarse_normals});
  const VectorXd signal = dupin::compute_signal(graph, dupin::Signal::height, 6);
  dupin::ScaleSpaceOptions options;
  options.want_levels = false;
  const dupin::ScaleSpace stack =
      compute_scale_space(dupin::umbrella_operator(graph.topology.ring), signal, options);
  const dupin::LevelMatrix loc =
      dupin::scale_invariant_loc(stack.loc, signal.cwiseAbs().maxCoeff());
  const dupin::NeighborSearch search(scan.coarse);
  std::vector<VectorXd> all;
  for (Index a = 0; a < scan.num_keypoints; ++a) {
    const dupin::Anchor& anchor = scan.anchors[static_cast<std::size_t>(a)];
    const auto nearest = search.nearest(dupin::Points(anchor.position), 1);
    const Index vertex = nearest.index(0, 0);
    const double tau = std::pow(anchor.radius / scan.mean_edge, 2);
    Index level = 0;
    (stack.tau.head(loc.rows()).array() - tau).abs().minCoeff(&level);
    VectorXd profile(2 * reach + 1);
    for (int k = -reach; k <= reach; ++k) {
      const Index l = std::clamp<Index>(level + k, 1, loc.rows() - 1);
      profile[k + reach] = loc(l, vertex);
    }
    all.push_back(profile);
  }
  return all;
}

struct MatchScores {
  std::vector<double> maps_same, maps_different;
  std::vector<double> profile_same, profile_different;
  int with_partner = 0;
  int recalled = 0;
  int best = 0;
};

constexpr double kShares[] = {0.02, 0.05, 0.1, 0.2, 0.4};

void add_scores(const NamedPair& named, MatchScores& scores) {
  const dupin::ScanFeatures moving = dupin::describe_scan(named.pair.moving);
  const dupin::ScanFeatures fixed = dupin::describe_scan(named.pair.fixed);
  const double base = 4.0 * std::max(moving.mean_edge, fixed.mean_edge);
  const auto of_moving = dupin::detail::build_height_maps(moving, base, 8, {});
  const auto of_fixed = dupin::detail::build_height_maps(fixed, base, 8, {});
  dupin::detail::MapMatchOptions options;
  options.candidates = 1'000'000;
  const auto matches =
      match_height_maps(moving, of_moving, fixed, of_fixed, false, options, dupin::RunControl());
  const auto a = profiles(moving, 3);
  const auto b = profiles(fixed, 3);
  std::vector<std::vector<std::pair<double, bool>>> lists(
      static_cast<std::size_t>(moving.num_keypoints));
  for (const auto& match : matches) {
    if (match.moving >= moving.num_keypoints || match.fixed >= fixed.num_keypoints) continue;
    const auto i = static_cast<std::size_t>(match.moving);
    const auto j = static_cast<std::size_t>(match.fixed);
    const Eigen::RowVector3d there =
        transformed(dupin::Points(moving.anchors[i].position), named.pair.truth).row(0);
    const Relation kind = relation(there, fixed.anchors[j].position, moving.anchors[i].radius,
                                   fixed.anchors[j].radius);
    lists[i].emplace_back(match.weight, kind == Relation::same);
    if (kind == Relation::unclear) continue;
    const double map = std::sqrt(-std::log(match.weight + 1e-300) / 4.0);
    const double profile = (a[i] - b[j]).norm();
    (kind == Relation::same ? scores.maps_same : scores.maps_different).push_back(map);
    (kind == Relation::same ? scores.profile_same : scores.profile_different).push_back(profile);
  }
  for (auto& list : lists) {
    const bool has = std::any_of(list.begin(), list.end(), [](const auto& p) { return p.second; });
    if (!has) continue;
    ++scores.with_partner;
    std::stable_sort(list.begin(), list.end(),
                     [](const auto& x, const auto& y) { return x.first > y.first; });
    scores.best += list.front().second ? 1 : 0;
    const auto end =
        list.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(6, list.size()));
    scores.recalled +=
        std::any_of(list.begin(), end, [](const auto& p) { return p.second; }) ? 1 : 0;
  }
}

void print_matches(const std::vector<NamedPair>& pairs) {
  std::printf(
      "\nMatches of the product among keypoints of one kind: share of those with a partner whose "
      "best match, or one of the best six, is it; area under the ROC of the mismatch of height "
      "maps over what is usual (M), of the distance of si-LoC over seven levels (S), and of "
      "M + share S.\n\n| noise | with partner | best | best six | M | S |");
  for (const double share : kShares) std::printf(" %.2f |", share);
  std::printf("\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int noise : {0, 20, 50}) {
    MatchScores scores;
    for (const NamedPair& named : pairs) {
      if (named.noise_percent == noise && named.overlap_percent == 70) add_scores(named, scores);
    }
    const double count = std::max(1, scores.with_partner);
    std::printf("| %d %% | %d | %.3f | %.3f | %.4f | %.4f |", noise, scores.with_partner,
                scores.best / count, scores.recalled / count,
                area_under_roc(scores.maps_same, scores.maps_different),
                area_under_roc(scores.profile_same, scores.profile_different));
    for (const double share : kShares) {
      const auto joined = [&](const std::vector<double>& m, const std::vector<double>& s) {
        std::vector<double> sum(m.size());
        for (std::size_t k = 0; k < m.size(); ++k) sum[k] = m[k] + share * s[k];
        return sum;
      };
      std::printf(" %.4f |",
                  area_under_roc(joined(scores.maps_same, scores.profile_same),
                                 joined(scores.maps_different, scores.profile_different)));
    }
    std::printf("\n");
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string directory;
  std::uint64_t draw = 1;
  CLI::App app("What frames, descriptors and matches of registration are worth");
  app.add_option("--surfaces", directory, "folder with armadillo.off, bunny00.off, ...");
  app.add_option("--draw", draw, "other cuts, poses and noise");
  CLI11_PARSE(app, argc, argv);
  try {
    const auto surfaces = dupin::bench::registration_surfaces(directory);
    const auto pairs = dupin::bench::overlap_pairs(surfaces, 1.0, draw);
    print_frames(pairs);
    print_histograms(pairs);
    print_matches(pairs);
  } catch (const dupin::Error& error) {
    std::cerr << error.diagnostic() << '\n';
    return 1;
  }
  return 0;
}
