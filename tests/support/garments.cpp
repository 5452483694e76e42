#include "tests/support/garments.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dupin/base/random.h"
#include "dupin/warp/contour_curvature.h"

namespace dupin::test {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

constexpr Index kDense = 2400;

struct Node {
  const char* name = "";  // "" : part of the outline, but no mark
  RowVector2d place;
  double bulge = 0.0;  // of the run to the next node, in shares of its chord, outwards
};

struct Inner {
  const char* name;
  RowVector2d place;
};

struct Pattern {
  std::vector<Node> nodes;  // clockwise as seen, heights in [0, 1], x about 0
  std::vector<Inner> inner;
};

// A parameter of the kind: its mean, and how far it may be from it.
struct Draw {
  Rng* rng;
  double variation;
  double operator()(double low, double high) const {
    return 0.5 * (low + high) + 0.5 * (high - low) * variation * rng->uniform(-1.0, 1.0);
  }
};

RowVector2d mirrored(const RowVector2d& p) { return {-p.x(), p.y()}; }

struct Sleeve {
  RowVector2d shoulder, top, bottom, armpit;
};

Sleeve make_sleeve(double width, double length, double cuff, double angle, double drop) {
  Sleeve sleeve;
  sleeve.shoulder << 0.29 * width, drop;
  sleeve.armpit << 0.26 * width, drop + 0.2;
  for (;; angle -= 0.02) {
    const RowVector2d along(std::cos(angle), std::sin(angle));
    sleeve.top = sleeve.shoulder + length * along;
    sleeve.bottom = sleeve.top + cuff * RowVector2d(-along.y(), along.x());
    const double clear = sleeve.bottom.y() > sleeve.armpit.y() ? 0.05 : 0.02;
    if (sleeve.bottom.x() > sleeve.armpit.x() + clear) return sleeve;
  }
}

Pattern t_shirt(const Draw& draw) {
  const double width = draw(0.85, 1.2);
  const double length = draw(0.14, 0.42);
  const double cuff = draw(0.12, 0.17);
  const double angle = draw(0.2, 1.0);
  const double drop = draw(0.05, 0.1);
  const double neck = draw(0.08, 0.12);
  const double dip = draw(0.05, 0.12);
  const double flare = draw(-0.03, 0.03);
  const double sleeve_bend = draw(-0.04, 0.08);
  const Sleeve right = make_sleeve(width, length, cuff, angle + draw(-0.12, 0.12), drop);
  const Sleeve left = make_sleeve(width, length, cuff, angle + draw(-0.12, 0.12), drop);
  const RowVector2d hem(0.26 * width + flare, 1.0);
  const double side = draw(-0.02, 0.02);
  Pattern p;
  p.nodes = {{"neck_r", {neck, 0.0}, 0.0},
             {"shoulder_r", right.shoulder, sleeve_bend},
             {"cuff_top_r", right.top, 0.0},
             {"cuff_bottom_r", right.bottom, 0.0},
             {"armpit_r", right.armpit, side},
             {"hem_r", hem, draw(-0.02, 0.03)},
             {"hem_l", mirrored(hem), side},
             {"armpit_l", mirrored(left.armpit), 0.0},
             {"cuff_bottom_l", mirrored(left.bottom), 0.0},
             {"cuff_top_l", mirrored(left.top), sleeve_bend},
             {"shoulder_l", mirrored(left.shoulder), 0.0},
             {"neck_l", {-neck, 0.0}, -dip / (2.0 * neck)}};
  const auto middle = [](const Sleeve& s) -> RowVector2d {
    return 0.25 * (s.shoulder + s.top + s.bottom + s.armpit);
  };
  p.inner = {{"sleeve_r", middle(right)},
             {"sleeve_l", mirrored(middle(left))},
             {"chest", {0.0, right.armpit.y()}},
             {"belly", {0.0, 0.5 * (right.armpit.y() + 1.0)}}};
  return p;
}

Pattern trousers(const Draw& draw) {
  const double waist = draw(0.15, 0.19);
  const double hip = waist + draw(0.03, 0.06);
  const double crotch = draw(0.25, 0.34);
  const double ankle = draw(0.09, 0.15);
  const double spread = draw(0.02, 0.16);
  const double bulge = draw(-0.02, 0.02);
  const auto leg = [&](double angle) {
    const RowVector2d along(std::sin(angle), std::cos(angle));
    const double length = (1.0 - crotch) / along.y();
    const RowVector2d inside(0.02, crotch);
    const RowVector2d hem_in = inside + length * along;
    const RowVector2d hem_out = hem_in + ankle * RowVector2d(along.y(), -along.x());
    return std::pair(hem_in, hem_out);
  };
  const auto right = leg(spread + draw(-0.02, 0.04));
  const auto left = leg(spread + draw(-0.02, 0.04));
  const RowVector2d hips(hip, 0.6 * crotch);
  const RowVector2d fork(0.0, crotch);
  Pattern p;
  p.nodes = {{"waist_r", {waist, 0.0}, 0.04},
             {"", hips, bulge},
             {"hem_out_r", right.second, 0.0},
             {"hem_in_r", right.first, bulge},
             {"crotch", fork, bulge},
             {"hem_in_l", mirrored(left.first), 0.0},
             {"hem_out_l", mirrored(left.second), bulge},
             {"", mirrored(hips), 0.04},
             {"waist_l", {-waist, 0.0}, draw(-0.05, 0.02)}};
  const auto knee = [&](const std::pair<RowVector2d, RowVector2d>& hem) -> RowVector2d {
    return 0.25 * (hem.first + hem.second + fork + hips);
  };
  p.inner = {
      {"knee_r", knee(right)}, {"knee_l", mirrored(knee(left))}, {"pelvis", {0.0, 0.6 * crotch}}};
  return p;
}

Pattern dress(const Draw& draw) {
  const double neck = draw(0.06, 0.1);
  const double strap = draw(0.03, 0.06);
  const double chest = neck + strap + draw(0.02, 0.06);
  const double waist = chest - draw(0.03, 0.06);
  const double waist_y = draw(0.3, 0.4);
  const double hem = draw(0.2, 0.42);
  const double armpit_y = draw(0.13, 0.18);
  const double sway = draw(-0.06, 0.06);
  const double dip = draw(0.06, 0.12);
  const double skirt = draw(-0.02, 0.06);
  Pattern p;
  p.nodes = {{"strap_in_r", {neck, 0.0}, 0.0},
             {"strap_out_r", {neck + strap, 0.012}, -0.12},
             {"armpit_r", {chest, armpit_y}, -0.03},
             {"waist_r", {waist, waist_y}, skirt},
             {"hem_r", {hem + sway, 1.0}, 0.04},
             {"hem_l", {-hem + sway, 1.0}, skirt},
             {"waist_l", {-waist, waist_y}, -0.03},
             {"armpit_l", {-chest, armpit_y}, -0.12},
             {"strap_out_l", {-neck - strap, 0.012}, 0.0},
             {"strap_in_l", {-neck, 0.0}, -dip / (2.0 * neck)}};
  p.inner = {{"breast", {0.0, 0.5 * (armpit_y + waist_y)}},
             {"navel", {0.0, waist_y}},
             {"skirt", {0.5 * sway, 0.5 * (waist_y + 1.0)}}};
  return p;
}

// The run from one node to the next, `count` points without the last.
void append_run(const Node& from, const Node& to, Index count, std::vector<RowVector2d>& dense) {
  const RowVector2d chord = to.place - from.place;
  const RowVector2d outwards(chord.y(), -chord.x());
  for (Index k = 0; k < count; ++k) {
    const double t = static_cast<double>(k) / static_cast<double>(count);
    dense.emplace_back(from.place + t * chord + 4.0 * t * (1.0 - t) * from.bulge * outwards);
  }
}

}  // namespace

SyntheticGarment make_garment(Garment kind, std::uint64_t seed, const GarmentOptions& options) {
  Rng rng(seed);
  const Draw draw{&rng, options.variation};
  const Pattern pattern = kind == Garment::t_shirt    ? t_shirt(draw)
                          : kind == Garment::trousers ? trousers(draw)
                                                      : dress(draw);
  double length = 0.0;
  const std::size_t num_nodes = pattern.nodes.size();
  for (std::size_t i = 0; i < num_nodes; ++i)
    length += (pattern.nodes[(i + 1) % num_nodes].place - pattern.nodes[i].place).norm();
  std::vector<RowVector2d> dense;
  std::vector<Index> node_at;
  for (std::size_t i = 0; i < num_nodes; ++i) {
    const Node& from = pattern.nodes[i];
    const Node& to = pattern.nodes[(i + 1) % num_nodes];
    node_at.push_back(static_cast<Index>(dense.size()));
    const double share = (to.place - from.place).norm() / length;
    append_run(from, to, std::max<Index>(2, std::lround(share * kDense)), dense);
  }
  Points2 curve(static_cast<Index>(dense.size()), 2);
  for (Index i = 0; i < curve.rows(); ++i)
    curve.row(i) = options.height_px * dense[static_cast<std::size_t>(i)];
  const double rounding = 0.006 / length * static_cast<double>(curve.rows());
  curve = smooth_contour(curve, std::max(1.0, rounding));

  // Folds: a few waves along the outline.
  const double amplitude = options.wrinkles * 0.0025 * options.height_px / std::sqrt(3.0);
  const double turn = 2.0 * std::numbers::pi / static_cast<double>(curve.rows());
  Points2 folded = curve;
  for (int wave = 0; wave < 6; ++wave) {
    const double cycles = std::floor(rng.uniform(8.0, 40.0));
    const double phase = rng.uniform(0.0, 2.0 * std::numbers::pi);
    for (Index i = 0; i < curve.rows(); ++i) {
      const RowVector2d along = curve.row((i + 1) % curve.rows()) - curve.row(i);
      const double size =
          amplitude * std::sin(cycles * turn * static_cast<double>(i) + phase) / along.norm();
      folded.row(i) += size * RowVector2d(along.y(), -along.x());
    }
  }

  SyntheticGarment garment;
  std::vector<RowVector2d> marks;
  for (std::size_t i = 0; i < num_nodes; ++i) {
    if (*pattern.nodes[i].name == '\0') continue;
    garment.names.emplace_back(pattern.nodes[i].name);
    marks.emplace_back(folded.row(node_at[i]));
  }
  garment.num_outline = static_cast<Index>(marks.size());
  for (const Inner& inner : pattern.inner) {
    garment.names.emplace_back(inner.name);
    marks.emplace_back(options.height_px * inner.place);
  }
  garment.marks.resize(static_cast<Index>(marks.size()), 2);
  for (Index i = 0; i < garment.marks.rows(); ++i)
    garment.marks.row(i) = marks[static_cast<std::size_t>(i)];

  const Points2 even = resample_loop(folded, options.num_corners).points;
  const auto start = static_cast<Index>(rng.below(static_cast<std::uint64_t>(options.num_corners)));
  garment.outline.resize(options.num_corners, 2);
  for (Index i = 0; i < options.num_corners; ++i) {
    garment.outline.row(i) = even.row((start + i) % options.num_corners);
    for (Index k = 0; k < 2; ++k) garment.outline(i, k) += options.noise_px * rng.normal();
  }
  garment.height = garment.outline.col(1).maxCoeff() - garment.outline.col(1).minCoeff();
  return garment;
}

}  // namespace dupin::test
