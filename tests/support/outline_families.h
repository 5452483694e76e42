#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "dupin/base/random.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin::test {

using Corner = std::pair<double, double>;

inline Points2 loop_of(const std::vector<Corner>& corners, bool is_hole = false) {
  Points2 loop(static_cast<Eigen::Index>(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Corner& c = corners[is_hole ? corners.size() - 1 - i : i];
    loop.row(static_cast<Eigen::Index>(i)) << c.first, c.second;
  }
  return loop;
}

inline Outline single(const std::vector<Corner>& corners) { return {{loop_of(corners)}, {0}}; }

inline std::vector<Corner> circle(double x, double y, double radius, int corners) {
  std::vector<Corner> result;
  for (int i = 0; i < corners; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / corners;
    result.emplace_back(x + radius * std::cos(angle), y + radius * std::sin(angle));
  }
  return result;
}

/// Star-shaped about its centre: any radii make a simple polygon.
inline std::vector<Corner> random_star(Rng& rng, double x, double y, double radius, int corners) {
  std::vector<Corner> result = circle(0.0, 0.0, 1.0, corners);
  const double rough = rng.uniform(0.0, 0.8);
  for (Corner& c : result) {
    const double r = radius * (1.0 - rough * rng.uniform());
    c = {x + r * c.first, y + r * c.second};
  }
  return result;
}

/// Teeth of random width and length on a bar; gaps and teeth down to `thinnest` px.
inline Outline comb(Rng& rng, double thinnest) {
  std::vector<Corner> corners = {{0.0, 0.0}};
  const int teeth = 2 + static_cast<int>(rng.below(8));
  double x = 0.0;
  std::vector<Corner> lower;
  for (int i = 0; i < teeth; ++i) {
    const double width = thinnest + rng.uniform(0.0, 30.0), gap = thinnest + rng.uniform(0.0, 10.0);
    const double depth = 30.0 + rng.uniform(0.0, 100.0);
    lower.insert(lower.end(), {{x, 20.0 + depth}, {x + width, 20.0 + depth}});
    x += width;
    if (i + 1 < teeth) {
      lower.insert(lower.end(), {{x, 20.0}, {x + gap, 20.0}});
      x += gap;
    }
  }
  corners.emplace_back(x, 0.0);
  corners.insert(corners.end(), lower.rbegin(), lower.rend());
  return single(corners);
}

/// A strip of `width` px wound with `gap` px between the turns.
inline Outline spiral(Rng& rng, double width, double gap) {
  const double turns = rng.uniform(1.2, 3.5);
  const int steps = static_cast<int>(turns * 48.0);
  std::vector<Corner> outer, inner;
  for (int i = 0; i <= steps; ++i) {
    const double angle = 2.0 * std::numbers::pi * turns * i / steps;
    const double r = 20.0 + (width + gap) * angle / (2.0 * std::numbers::pi);
    inner.emplace_back(200.0 + r * std::cos(angle), 200.0 + r * std::sin(angle));
    outer.emplace_back(200.0 + (r + width) * std::cos(angle),
                       200.0 + (r + width) * std::sin(angle));
  }
  outer.insert(outer.end(), inner.rbegin(), inner.rend());
  return single(outer);
}

/// Two pads joined by straps of `width` px, with a hole between them.
inline Outline straps(Rng& rng, double width) {
  const double long_side = rng.uniform(60.0, 200.0);
  const double tilt = rng.uniform(-20.0, 20.0);
  std::vector<Corner> outer = {{0.0, 0.0},
                               {50.0, 0.0},
                               {50.0 + long_side, tilt},
                               {100.0 + long_side, tilt},
                               {100.0 + long_side, 60.0 + tilt},
                               {50.0 + long_side, 60.0 + tilt},
                               {50.0, 60.0},
                               {0.0, 60.0}};
  std::vector<Corner> hole = {{50.0, width},
                              {50.0 + long_side, tilt + width},
                              {50.0 + long_side, 60.0 + tilt - width},
                              {50.0, 60.0 - width}};
  return {{loop_of(outer), loop_of(hole, true)}, {0, 0}};
}

/// A round shape with holes in a ring, some with an island.
inline Outline with_holes(Rng& rng) {
  Outline outline = single(circle(200.0, 200.0, 180.0, 30 + static_cast<int>(rng.below(60))));
  const int holes = 1 + static_cast<int>(rng.below(5));
  std::int32_t component = 1;
  for (int i = 0; i < holes; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / holes;
    const double x = 200.0 + 95.0 * std::cos(angle), y = 200.0 + 95.0 * std::sin(angle);
    const double radius = rng.uniform(4.0, 50.0);
    outline.loops.push_back(
        loop_of(random_star(rng, x, y, radius, 5 + static_cast<int>(rng.below(20))), true));
    outline.component.push_back(0);
    if (radius > 25.0 && rng.below(2) == 0) {
      outline.loops.push_back(loop_of(circle(x, y, 4.0, 8)));
      outline.component.push_back(component++);
    }
  }
  return outline;
}

/// Two discs whose sides come within `gap` px of each other.
inline Outline nearly_touching(Rng& rng, double gap) {
  const double radius = rng.uniform(20.0, 80.0);
  const int corners = 4 * (3 + static_cast<int>(rng.below(30)));
  return {{loop_of(circle(100.0, 100.0, radius, corners)),
           loop_of(circle(100.0 + 2.0 * radius + gap, 100.0, radius, corners))},
          {0, 1}};
}

/// The pixel edges around the 4-connected parts of a mask, corners at whole pixels. Where two
/// pixels touch at a corner, that corner is in the loops twice.
inline Outline mask_outline(const std::vector<char>& mask, int width, int height) {
  const auto is_set = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < width && y < height &&
           mask[static_cast<std::size_t>(y * width + x)] != 0;
  };
  std::vector<std::int32_t> part(mask.size(), -1);
  std::int32_t parts = 0;
  for (int seed = 0; seed < width * height; ++seed) {
    if (mask[static_cast<std::size_t>(seed)] == 0 || part[static_cast<std::size_t>(seed)] >= 0)
      continue;
    std::vector<int> open = {seed};
    part[static_cast<std::size_t>(seed)] = parts;
    while (!open.empty()) {
      const int x = open.back() % width, y = open.back() / width;
      open.pop_back();
      for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        if (!is_set(x + dx, y + dy)) continue;
        const auto next = static_cast<std::size_t>((y + dy) * width + x + dx);
        if (part[next] >= 0) continue;
        part[next] = parts;
        open.push_back(static_cast<int>(next));
      }
    }
    ++parts;
  }
  struct Edge {
    int x0, y0, x1, y1, pixel;
    bool is_used;
  };
  std::vector<Edge> edges;
  std::multimap<std::pair<int, int>, std::size_t> from;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (!is_set(x, y)) continue;
      const auto add = [&](int x0, int y0, int x1, int y1) {
        from.insert({{x0, y0}, edges.size()});
        edges.push_back({x0, y0, x1, y1, y * width + x, false});
      };
      if (!is_set(x, y - 1)) add(x, y, x + 1, y);
      if (!is_set(x + 1, y)) add(x + 1, y, x + 1, y + 1);
      if (!is_set(x, y + 1)) add(x + 1, y + 1, x, y + 1);
      if (!is_set(x - 1, y)) add(x, y + 1, x, y);
    }
  }
  Outline outline;
  for (std::size_t start = 0; start < edges.size(); ++start) {
    if (edges[start].is_used) continue;
    std::vector<Corner> corners;
    for (std::size_t e = start; !edges[e].is_used;) {
      edges[e].is_used = true;
      corners.emplace_back(edges[e].x0, edges[e].y0);
      const auto [low, high] = from.equal_range({edges[e].x1, edges[e].y1});
      std::size_t next = low->second;
      for (auto it = low; it != high; ++it)
        if (edges[it->second].pixel == edges[e].pixel) next = it->second;
      e = next;
    }
    outline.loops.push_back(loop_of(corners));
    outline.component.push_back(part[static_cast<std::size_t>(edges[start].pixel)]);
  }
  return outline;
}

/// Discs and single pixels at random: parts that touch at corners, holes with islands.
inline Outline random_mask(Rng& rng) {
  const int size = 12 + static_cast<int>(rng.below(40));
  std::vector<char> mask(static_cast<std::size_t>(size * size), 0);
  for (int disc = 0; disc < 6; ++disc) {
    const double x = rng.uniform(0.0, size), y = rng.uniform(0.0, size);
    const double radius = rng.uniform(1.0, 0.3 * size);
    const char value = disc < 4 ? 1 : 0;
    for (int i = 0; i < size * size; ++i)
      if (std::hypot(i % size - x, i / size - y) < radius)
        mask[static_cast<std::size_t>(i)] = value;
  }
  for (int i = 0; i < size * size / 12; ++i)
    mask[rng.below(static_cast<std::uint64_t>(size * size))] ^= 1;
  mask[0] = 1;
  return mask_outline(mask, size, size);
}

inline constexpr int kNumFamilies = 9;

/// A raw outline of family `family` in [0, kNumFamilies).
inline Outline random_outline(int family, Rng& rng) {
  switch (family) {
    case 0:
      return single(random_star(rng, 150.0, 150.0, 140.0, 5 + static_cast<int>(rng.below(60))));
    case 1:
      return comb(rng, 2.0);
    case 2:
      return spiral(rng, rng.uniform(2.0, 25.0), rng.uniform(0.5, 10.0));
    case 3:
      return straps(rng, 2.0);
    case 4:
      return with_holes(rng);
    case 5:
      return random_mask(rng);
    case 6:
      return nearly_touching(rng, rng.uniform(0.02, 2.0));
    case 7:
      return comb(rng, 0.3);
    default:
      return single(random_star(rng, 150.0, 150.0, 140.0, 3 + static_cast<int>(rng.below(3))));
  }
}

}  // namespace dupin::test
