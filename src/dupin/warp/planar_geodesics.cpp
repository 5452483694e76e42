#include "dupin/warp/planar_geodesics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Two triangles of a rectangle have one circle: of those the nearer goes first.
constexpr double kNearer = 1e-7;
constexpr double kSight = 1e-12;    // sine of the angle by which a ray may miss what it grazes
constexpr int kTurnsAtOnce = 4096;  // of a loop, until the run is looked at again

using Reached = std::pair<double, std::int32_t>;
using NearestFirst = std::priority_queue<Reached, std::vector<Reached>, std::greater<>>;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Directions from lo, turning from x towards y, to hi; less than half a turn.
struct Cone {
  Vector2d lo;
  Vector2d hi;
};

bool sees(const Cone& cone, const Vector2d& direction) {
  const double length = direction.norm();
  return cross(cone.lo, direction) >= -kSight * length * cone.lo.norm() &&
         cross(direction, cone.hi) >= -kSight * length * cone.hi.norm();
}

bool is_narrow(const Cone& cone) {
  return cross(cone.lo, cone.hi) <= 1e-15 * cone.lo.norm() * cone.hi.norm() &&
         cone.lo.dot(cone.hi) > 0.0;
}

bool holds(const Cone& cone, const Vector2d& direction) {
  return cross(cone.lo, direction) >= 0.0 && cross(direction, cone.hi) >= 0.0;
}

// The common part of two cones; narrow where they only touch or do not meet.
Cone intersection(const Cone& a, const Cone& b) {
  const Cone nothing{a.lo, a.lo};
  Cone result;
  if (holds(a, b.lo))
    result.lo = b.lo;
  else if (holds(b, a.lo))
    result.lo = a.lo;
  else
    return nothing;
  if (holds(a, b.hi))
    result.hi = b.hi;
  else if (holds(b, a.hi))
    result.hi = a.hi;
  else
    return nothing;
  return result;
}

// Directions out of the shape, one for every gap between the triangles around border vertex v, if
// the gap is less than half a turn: only then can a shortest path bend there.
std::vector<Vector2d> gaps(const PlanarMesh& mesh, const PlanarGraph& graph, Index v) {
  std::vector<Vector2d> incoming;
  std::vector<Vector2d> outgoing;
  const auto vertex = [&](std::int32_t f, Index k) {
    return Vector2d(mesh.points.row(mesh.triangles(f, k)).transpose());
  };
  const Vector2d here = mesh.points.row(v).transpose();
  for (auto i = static_cast<std::size_t>(graph.face_begin[static_cast<std::size_t>(v)]);
       i < static_cast<std::size_t>(graph.face_begin[static_cast<std::size_t>(v) + 1]); ++i) {
    const std::int32_t f = graph.face[i];
    Index k = 0;
    while (mesh.triangles(f, k) != v) ++k;
    if (graph.across(f, (k + 2) % 3) < 0) outgoing.push_back(vertex(f, (k + 1) % 3) - here);
    if (graph.across(f, (k + 1) % 3) < 0) incoming.push_back(vertex(f, (k + 2) % 3) - here);
  }
  constexpr double kPi = 3.14159265358979323846;
  const auto angle = [](const Vector2d& d) { return std::atan2(d.y(), d.x()); };
  std::vector<Vector2d> result;
  for (const Vector2d& from : incoming) {
    double narrowest = 2.0 * kPi;
    for (const Vector2d& to : outgoing) {
      double turn = angle(to) - angle(from);
      if (turn <= 0.0) turn += 2.0 * kPi;
      narrowest = std::min(narrowest, turn);
    }
    if (narrowest >= kPi) continue;
    const double middle = angle(from) + 0.5 * narrowest;
    result.emplace_back(std::cos(middle), std::sin(middle));
  }
  return result;
}

// Straight lines of sight from one point after the other. In the plane nothing has to be unfolded.
class Sight {
 public:
  Sight(const PlanarMesh& mesh, const PlanarGraph& graph, const RunControl& run)
      : mesh_(mesh),
        graph_(graph),
        run_(run),
        distance_(Eigen::VectorXd::Constant(mesh.points.rows(), kInfinity)),
        parent_(Points2::Zero(mesh.points.rows(), 2)),
        first_cone_(static_cast<std::size_t>(mesh.triangles.rows()), -1) {}

  Eigen::VectorXd run(const MeshPoint& source) {
    start(source);
    while (!bends_.empty()) {
      heed_run();
      const auto [length, v] = bends_.top();
      bends_.pop();
      if (length <= distance_[v]) turn_around(v);
    }
    close_gaps();
    return std::move(distance_);
  }

 private:
  struct Pending {
    Cone cone;
    std::int32_t next;
  };

  Vector2d vertex(Index f, Index k) const {
    return mesh_.points.row(mesh_.triangles(f, k)).transpose();
  }

  void start(const MeshPoint& source) {
    eye_ = position(mesh_.points, mesh_.triangles, source);
    behind_ = 0.0;
    const Index f = source.triangle;
    Index at = 0;
    if (source.weights.maxCoeff(&at) == 1.0) {
      const std::int32_t v = mesh_.triangles(f, at);
      eye_ = mesh_.points.row(v).transpose();
      distance_[v] = 0.0;
      look_from(v, nullptr);
    } else {
      for (Index k = 0; k < 3; ++k) {
        reach(mesh_.triangles(f, k));
        send(f, k, {vertex(f, (k + 1) % 3) - eye_, vertex(f, (k + 2) % 3) - eye_});
      }
    }
    propagate();
  }

  // Behind a corner of the border lies what its predecessor does not see: the directions between
  // the straight continuation and the gap.
  void turn_around(std::int32_t v) {
    eye_ = mesh_.points.row(v).transpose();
    behind_ = distance_[v];
    const Vector2d onward = eye_ - parent_.row(v).transpose();
    for (const std::int32_t* k = graph_.topology.ring.begin(v); k != graph_.topology.ring.end(v);
         ++k)
      reach(*k);
    for (const Vector2d& gap : gaps(mesh_, graph_, v)) {
      const Cone shadow = cross(onward, gap) > 0.0 ? Cone{onward, gap} : Cone{gap, onward};
      if (!is_narrow(shadow)) look_from(v, &shadow);
    }
    propagate();
  }

  void look_from(std::int32_t v, const Cone* shadow) {
    for (auto i = static_cast<std::size_t>(graph_.face_begin[static_cast<std::size_t>(v)]);
         i < static_cast<std::size_t>(graph_.face_begin[static_cast<std::size_t>(v) + 1]); ++i) {
      const std::int32_t f = graph_.face[i];
      Index k = 0;
      while (mesh_.triangles(f, k) != v) ++k;
      Cone cone{vertex(f, (k + 1) % 3) - eye_, vertex(f, (k + 2) % 3) - eye_};
      if (cross(cone.lo, cone.hi) <= 0.0) continue;
      if (shadow == nullptr) {
        reach(mesh_.triangles(f, (k + 1) % 3));
        reach(mesh_.triangles(f, (k + 2) % 3));
      } else {
        cone = intersection(cone, *shadow);
      }
      if (!is_narrow(cone)) send(f, k, cone);
    }
  }

  void reach(std::int32_t v) {
    const double length = behind_ + (mesh_.points.row(v).transpose() - eye_).norm();
    if (length >= distance_[v]) return;
    distance_[v] = length;
    parent_.row(v) = eye_.transpose();
    if (graph_.topology.is_boundary[static_cast<std::size_t>(v)] != 0) bends_.emplace(length, v);
  }

  // Hands a cone to the triangle over edge k of f. Cones that another way beats all along that edge
  // are dropped: distances grow by no more than the way along the edge.
  void send(Index f, Index k, const Cone& cone) {
    const std::int32_t next = graph_.across(f, k);
    if (next < 0) return;
    const std::int32_t a = mesh_.triangles(f, (k + 1) % 3);
    const std::int32_t b = mesh_.triangles(f, (k + 2) % 3);
    const Vector2d pa = mesh_.points.row(a).transpose();
    const Vector2d pb = mesh_.points.row(b).transpose();
    const double farther = std::max((pa - eye_).norm(), (pb - eye_).norm());
    const double edge = (pa - pb).norm();
    if (behind_ + farther - edge > std::min(distance_[a], distance_[b]) + edge) return;

    std::int32_t& head = first_cone_[static_cast<std::size_t>(next)];
    for (std::int32_t i = head; i >= 0; i = pool_[static_cast<std::size_t>(i)].next) {
      Cone& other = pool_[static_cast<std::size_t>(i)].cone;
      if (other.hi == cone.lo) {
        other.hi = cone.hi;
        return;
      }
      if (cone.hi == other.lo) {
        other.lo = cone.lo;
        return;
      }
    }
    if (head < 0) waiting_.emplace(order(next), next);
    pool_.push_back({cone, head});
    head = static_cast<std::int32_t>(pool_.size()) - 1;
  }

  // Power of the eye with respect to the circumcircle: in a Delaunay triangulation what lies behind
  // has more of it, so that all cones of a triangle are there when it is looked at. In others some
  // triangles are looked at twice.
  double order(std::int32_t f) const {
    const Vector2d a = vertex(f, 0) - eye_;
    const Vector2d b = vertex(f, 1) - eye_;
    const Vector2d c = vertex(f, 2) - eye_;
    const double area = cross(b - a, c - a);
    if (area <= 0.0) return a.squaredNorm();
    const double inside = (a.squaredNorm() * cross(b, c) + b.squaredNorm() * cross(c, a) +
                           c.squaredNorm() * cross(a, b)) /
                          area;
    return kNearer * (a + b + c).squaredNorm() - inside;
  }

  void propagate() {
    while (!waiting_.empty()) {
      heed_run();
      const std::int32_t f = waiting_.top().second;
      waiting_.pop();
      std::int32_t i = std::exchange(first_cone_[static_cast<std::size_t>(f)], -1);
      if (cross(vertex(f, 1) - vertex(f, 0), vertex(f, 2) - vertex(f, 0)) <= 0.0) continue;
      for (; i >= 0; i = pool_[static_cast<std::size_t>(i)].next)
        pass(f, pool_[static_cast<std::size_t>(i)].cone);
    }
    pool_.clear();
  }

  void pass(std::int32_t f, const Cone cone) {
    for (Index k = 0; k < 3; ++k) {
      if (sees(cone, vertex(f, k) - eye_)) reach(mesh_.triangles(f, k));
    }
    for (Index k = 0; k < 3; ++k) {
      const Cone edge{vertex(f, (k + 1) % 3) - eye_, vertex(f, (k + 2) % 3) - eye_};
      if (cross(edge.lo, edge.hi) <= 0.0) continue;  // the edge it came in by
      const Cone rest = intersection(cone, edge);
      if (!is_narrow(rest)) send(f, k, rest);
    }
  }

  double way_over(Index v, std::int32_t k) const {
    return distance_[v] + (mesh_.points.row(k) - mesh_.points.row(v)).norm();
  }
  bool is_shorter(double way, std::int32_t k) const { return way < distance_[k] * (1.0 - 1e-12); }
  bool can_shorten(Index v) const {
    return std::any_of(graph_.topology.ring.begin(v), graph_.topology.ring.end(v),
                       [&](std::int32_t k) { return is_shorter(way_over(v, k), k); });
  }

  void heed_run() {
    if (++num_turns_ % kTurnsAtOnce == 0) run_.throw_if_cancelled();
  }

  // Flipped triangles and those without area stop a cone; paths along edges lead past them.
  void close_gaps() {
    NearestFirst queue;
    for (Index v = 0; v < distance_.size(); ++v) {
      heed_run();
      if (distance_[v] < kInfinity && can_shorten(v))
        queue.emplace(distance_[v], static_cast<std::int32_t>(v));
    }
    while (!queue.empty()) {
      heed_run();
      const auto [length, v] = queue.top();
      queue.pop();
      if (length > distance_[v]) continue;
      for (const std::int32_t* k = graph_.topology.ring.begin(v); k != graph_.topology.ring.end(v);
           ++k) {
        const double way = way_over(v, *k);
        if (is_shorter(way, *k)) {
          distance_[*k] = way;
          queue.emplace(way, *k);
        }
      }
    }
  }

  const PlanarMesh& mesh_;
  const PlanarGraph& graph_;
  const RunControl& run_;
  unsigned num_turns_ = 0;
  Eigen::VectorXd distance_;
  Points2 parent_;                        // where the last straight piece of the path begins
  std::vector<std::int32_t> first_cone_;  // of every triangle, into pool_
  std::vector<Pending> pool_;
  NearestFirst waiting_;  // triangles with cones
  NearestFirst bends_;    // border vertices
  Vector2d eye_ = Vector2d::Zero();
  double behind_ = 0.0;
};

Eigen::VectorXd edge_distances(const PlanarMesh& mesh, const PlanarGraph& graph,
                               const MeshPoint& source) {
  const Vector2d from = position(mesh.points, mesh.triangles, source);
  std::int32_t nearest = mesh.triangles(source.triangle, 0);
  const auto offset = [&](std::int32_t v) {
    return (mesh.points.row(v).transpose() - from).norm();
  };
  for (Index k = 1; k < 3; ++k) {
    const std::int32_t v = mesh.triangles(source.triangle, k);
    if (offset(v) < offset(nearest)) nearest = v;
  }
  Eigen::VectorXd distance = Eigen::VectorXd::Constant(mesh.points.rows(), kInfinity);
  distance[nearest] = source.weights.maxCoeff() == 1.0 ? 0.0 : offset(nearest);
  NearestFirst queue;
  queue.emplace(distance[nearest], nearest);
  while (!queue.empty()) {
    const auto [length, v] = queue.top();
    queue.pop();
    if (length > distance[v]) continue;
    for (const std::int32_t* k = graph.topology.ring.begin(v); k != graph.topology.ring.end(v);
         ++k) {
      const double way = length + (mesh.points.row(*k) - mesh.points.row(v)).norm();
      if (way < distance[*k]) {
        distance[*k] = way;
        queue.emplace(way, *k);
      }
    }
  }
  return distance;
}

}  // namespace

Eigen::VectorXd geodesic_distances(const PlanarMesh& mesh, const PlanarGraph& graph,
                                   const MeshPoint& source, GeodesicMethod method,
                                   const RunControl& run) {
  if (source.triangle < 0 || source.triangle >= mesh.triangles.rows())
    throw InvalidArgument("the source of the distances is on no triangle");
  run.throw_if_cancelled();
  if (method == GeodesicMethod::edges) return edge_distances(mesh, graph, source);
  return Sight(mesh, graph, run).run(source);
}

}  // namespace dupin
