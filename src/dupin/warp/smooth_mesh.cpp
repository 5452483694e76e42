#include "dupin/warp/smooth_mesh.h"

#include <algorithm>
#include <cmath>

namespace dupin {

double largest_cotangent(GridPoint a, GridPoint b, GridPoint c) {
  const std::int64_t area = orientation(a, b, c);
  if (area <= 0) return HUGE_VAL;
  const std::int64_t largest = std::max({dot(a, b, c), dot(b, c, a), dot(c, a, b)});
  return static_cast<double>(largest) / static_cast<double>(area);
}

namespace {

class Star {
 public:
  explicit Star(const PlanarTriangulation& mesh) : mesh_(mesh) {}

  // The half-edges opposite v. False if v lies on the border.
  bool collect(std::int32_t v) {
    around.clear();
    const std::int32_t first = mesh_.leaving[PlanarTriangulation::at(v)];
    std::int32_t e = first;
    do {
      around.push_back(PlanarTriangulation::next(e));
      e = mesh_.twin[PlanarTriangulation::at(PlanarTriangulation::previous(e))];
      if (e == PlanarTriangulation::kNone) return false;
    } while (e != first);
    return true;
  }

  GridPoint mean() const {
    std::int64_t x = 0, y = 0;
    for (const std::int32_t e : around) {
      const GridPoint q = mesh_.p(mesh_.origin[PlanarTriangulation::at(e)]);
      x += q.x;
      y += q.y;
    }
    const auto count = static_cast<double>(around.size());
    return {static_cast<std::int32_t>(std::llround(static_cast<double>(x) / count)),
            static_cast<std::int32_t>(std::llround(static_cast<double>(y) / count))};
  }

  double worst(GridPoint centre) const {
    double result = -HUGE_VAL;
    for (const std::int32_t e : around) {
      const GridPoint a = mesh_.p(mesh_.origin[PlanarTriangulation::at(e)]);
      const GridPoint b = mesh_.p(mesh_.destination(e));
      result = std::max(result, largest_cotangent(centre, a, b));
    }
    return result;
  }

  bool encroaches(GridPoint centre) const {
    return std::any_of(around.begin(), around.end(), [&](std::int32_t e) {
      return mesh_.twin[PlanarTriangulation::at(e)] == PlanarTriangulation::kNone &&
             dot(centre, mesh_.p(mesh_.origin[PlanarTriangulation::at(e)]),
                 mesh_.p(mesh_.destination(e))) < 0;
    });
  }

  std::vector<std::int32_t> around;

 private:
  const PlanarTriangulation& mesh_;
};

}  // namespace

SmoothingCounts smooth_mesh(PlanarTriangulation& mesh, const std::vector<char>& is_free, int passes,
                            const RunControl& run) {
  SmoothingCounts counts;
  Star star(mesh);
  std::vector<std::int32_t> pending;
  for (int pass = 0; pass < passes && !run.cancelled(); ++pass) {
    for (std::int32_t v = 0; v < mesh.num_vertices(); ++v) {
      if (is_free[PlanarTriangulation::at(v)] == 0 || !star.collect(v)) continue;
      const GridPoint here = mesh.p(v);
      const GridPoint mean = star.mean();
      const GridPoint half = {static_cast<std::int32_t>((std::int64_t{here.x} + mean.x) / 2),
                              static_cast<std::int32_t>((std::int64_t{here.y} + mean.y) / 2)};
      if (mean == here) continue;
      const double before = star.worst(here);
      const auto is_allowed = [&](GridPoint to) {
        return star.worst(to) <= before && !star.encroaches(to);
      };
      const GridPoint to = is_allowed(mean) ? mean : is_allowed(half) ? half : here;
      if (to == here) {
        ++counts.num_refused;
        continue;
      }
      ++counts.num_moves;
      mesh.point[PlanarTriangulation::at(v)] = to;
      pending.clear();
      for (const std::int32_t e : star.around) {
        pending.push_back(e);
        pending.push_back(PlanarTriangulation::next(e));
      }
      mesh.restore_delaunay(pending);
    }
    run.report(static_cast<double>(pass + 1) / passes);
  }
  return counts;
}

}  // namespace dupin
