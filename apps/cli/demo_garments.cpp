#include "demo_garments.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <utility>

namespace dupin::cli {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::Vector3d;

constexpr int kSide = 480;          // px
constexpr double kRounding = 12.0;  // px
constexpr int kSamples = 4;         // across a pixel, for the soft fringe

using Paint = std::function<Vector3d(double x, double y)>;

// Every corner gives way to two on its sides, a quarter of them away but at most so many pixels:
// three times, so that seams are round and hems nearly straight (after Chaikin 1974).
Points2 rounded(Points2 loop) {
  for (int round = 0; round < 3; ++round) {
    Points2 finer(2 * loop.rows(), 2);
    for (Index i = 0; i < loop.rows(); ++i) {
      const RowVector2d here = loop.row(i);
      const RowVector2d side = loop.row((i + 1) % loop.rows()) - here;
      const double share = std::min(0.25, kRounding / std::max(side.norm(), 1.0));
      finer.row(2 * i) = here + share * side;
      finer.row(2 * i + 1) = here + (1.0 - share) * side;
    }
    loop = finer;
  }
  return loop;
}

RowVector2d mirrored(const RowVector2d& place) { return {kSide - place.x(), place.y()}; }

// The left half follows the right one, mirrored about the middle of the picture.
Points2 symmetric(std::vector<RowVector2d> right) {
  for (std::size_t i = right.size(); i-- > 0;) right.push_back(mirrored(right[i]));
  Points2 loop(static_cast<Index>(right.size()), 2);
  for (std::size_t i = 0; i < right.size(); ++i) loop.row(static_cast<Index>(i)) = right[i];
  return loop;
}

// Share of every pixel that lies inside the loop.
std::vector<double> coverage(const Points2& loop) {
  std::vector<double> share(static_cast<std::size_t>(kSide) * kSide, 0.0);
  std::vector<double> crossings;
  for (int line = 0; line < kSide * kSamples; ++line) {
    const double y = (line + 0.5) / kSamples;
    crossings.clear();
    for (Index i = 0; i < loop.rows(); ++i) {
      const RowVector2d a = loop.row(i);
      const RowVector2d b = loop.row((i + 1) % loop.rows());
      if ((a.y() <= y) != (b.y() <= y))
        crossings.push_back(a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
    }
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) {
      for (int s = std::max(0, static_cast<int>(std::ceil(crossings[k] * kSamples - 0.5)));
           s < kSide * kSamples && (s + 0.5) / kSamples < crossings[k + 1]; ++s)
        share[static_cast<std::size_t>(line / kSamples) * kSide +
              static_cast<std::size_t>(s / kSamples)] += 1.0 / (kSamples * kSamples);
    }
  }
  return share;
}

void paint(Raster& picture, const Points2& loop, const Paint& color) {
  const std::vector<double> share = coverage(loop);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x);
      const double over = share[at];
      if (!(over > 0.0)) continue;
      std::uint8_t* pixel = &picture.rgba8[4 * at];
      const double under = (1.0 - over) * pixel[3] / 255.0;
      const Vector3d ink = color(x + 0.5, y + 0.5);
      for (Index k = 0; k < 3; ++k) {
        const double mixed = (over * 255.0 * ink[k] + under * pixel[k]) / (over + under);
        pixel[k] = static_cast<std::uint8_t>(std::lround(std::clamp(mixed, 0.0, 255.0)));
      }
      pixel[3] = static_cast<std::uint8_t>(std::lround(255.0 * std::min(1.0, over + under)));
    }
  }
}

// Soft steps between two colours along a line, darker towards the sides: cloth, not paper.
Paint striped(const Vector3d& ground, const Vector3d& stripe, double period, double slope) {
  return [=](double x, double y) -> Vector3d {
    const double phase = std::numbers::pi * (y + slope * std::abs(x - kSide / 2.0)) / period;
    const double share = 0.5 + 0.5 * std::tanh(4.0 * std::sin(2.0 * phase));
    const double light = 1.0 - 0.18 * std::pow(2.0 * x / kSide - 1.0, 2.0);
    return light * ((1.0 - share) * ground + share * stripe);
  };
}

WarpPin pin(const char* name, const RowVector2d& source, const RowVector2d& target,
            double depth = 0.0) {
  WarpPin made;
  made.name = name;
  made.source = source;
  made.target = target;
  made.depth = depth;
  return made;
}

// Turned about a joint, from x towards y.
RowVector2d turned(const RowVector2d& place, const RowVector2d& joint, double degrees) {
  const double angle = degrees * std::numbers::pi / 180.0;
  const RowVector2d arm = place - joint;
  return joint + RowVector2d(std::cos(angle) * arm.x() - std::sin(angle) * arm.y(),
                             std::sin(angle) * arm.x() + std::cos(angle) * arm.y());
}

using NamedPlace = std::pair<const char*, RowVector2d>;

// An empty picture, and pins that stay.
DemoGarment held(const char* name, const char* title, const char* note,
                 const std::vector<NamedPlace>& places) {
  DemoGarment made{name, title, note, make_raster(kSide, kSide, 8), {}};
  for (const auto& [label, place] : places) made.pins.push_back(pin(label, place, place));
  return made;
}

DemoGarment shirt() {
  const RowVector2d right(322, 108);
  DemoGarment made =
      held("shirt", "A shirt that hangs its arms",
           "Three pins hold the body, each sleeve turns about a pin at its shoulder.",
           {{"chest", {240, 150}},
            {"waist left", {172, 320}},
            {"waist right", {308, 320}},
            {"shoulder left", mirrored(right)},
            {"shoulder right", right}});
  const std::vector<RowVector2d> half = {{240, 84},  {275, 58},  {320, 72},  {446, 128},
                                         {424, 188}, {338, 152}, {330, 260}, {336, 420}};
  paint(made.picture, rounded(symmetric(half)),
        striped({0.93, 0.93, 0.90}, {0.13, 0.30, 0.55}, 44.0, 0.0));
  paint(made.picture, rounded(symmetric({{240, 98}, {280, 52}, {270, 58}, {240, 82}})),
        [](double, double) { return Vector3d(0.75, 0.15, 0.15); });
  const double down = 34.0;
  for (const RowVector2d& place : {RowVector2d{372, 128}, RowVector2d{420, 150}}) {
    const RowVector2d target = turned(place, right, down);
    made.pins.push_back(pin("", place, target, 1.0));
    made.pins.push_back(pin("", mirrored(place), mirrored(target), 1.0));
  }
  return made;
}

DemoGarment trousers() {
  DemoGarment made = held("trousers", "Trousers that take a step",
                          "Waist and hips stay, the legs turn about the hips and one knee bends.",
                          {{"waist left", {180, 50}},
                           {"waist right", {300, 50}},
                           {"middle", {240, 130}},
                           {"hip left", {190, 160}},
                           {"hip right", {290, 160}}});
  const std::vector<RowVector2d> half = {{312, 30},  {318, 60},  {336, 250}, {328, 450},
                                         {262, 450}, {254, 300}, {240, 176}};
  paint(made.picture, rounded(symmetric(half)),
        striped({0.24, 0.33, 0.28}, {0.30, 0.41, 0.35}, 14.0, 3.0));
  paint(made.picture, rounded(symmetric({{316, 26}, {320, 64}})),
        [](double, double) { return Vector3d(0.42, 0.27, 0.16); });
  const RowVector2d knee(294, 300);
  const RowVector2d ankle(294, 425);
  const RowVector2d bent = turned(knee, {290, 160}, -24.0);
  made.pins.push_back(pin("knee", knee, bent, 1.0));
  made.pins.push_back(pin("ankle", ankle, bent + turned(ankle, knee, 4.0) - knee, 1.0));
  for (const RowVector2d& place : {RowVector2d{186, 300}, RowVector2d{186, 425}})
    made.pins.push_back(pin("", place, turned(place, {190, 160}, 10.0)));
  return made;
}

DemoGarment dress() {
  DemoGarment made = held("dress", "A dress whose hem swings",
                          "Straps and waist stay, three pins at the hem turn about the waist.",
                          {{"left", {202, 100}},
                           {"right", {278, 100}},
                           {"waist left", {208, 190}},
                           {"waist right", {272, 190}}});
  const std::vector<RowVector2d> half = {{272, 26},  {290, 26},  {300, 110}, {286, 190},
                                         {330, 320}, {384, 446}, {300, 456}, {240, 452}};
  paint(made.picture, symmetric(half),
        striped({0.72, 0.20, 0.36}, {0.95, 0.72, 0.35}, 60.0, -0.45));
  for (const RowVector2d& place :
       {RowVector2d{126, 430}, RowVector2d{240, 436}, RowVector2d{354, 430}})
    made.pins.push_back(pin("", place, turned(place, {240, 190}, -16.0)));
  return made;
}

}  // namespace

std::vector<DemoGarment> demo_garments() { return {shirt(), trousers(), dress()}; }

}  // namespace dupin::cli
