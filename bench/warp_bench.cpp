// One drag step (moving least squares and one ARAP iteration) with 12 pins on one thread, and what
// an edit of the pins costs. Shapes: a square of alternating right triangles, 2.7K, 20K and 200K.
//
//   warp_bench           drag and its parts, and the preparation
//   warp_bench --peers   also one ARAP iteration by the thesis's way (Jacobi-preconditioned
//                        conjugate gradients of Eigen at 1e-6, both coordinates, started at the
//                        places before) and by CGAL's Surface_mesh_deformation in 3D, if that was
//                        installed when this was built. The peer's figure is the difference of six
//                        and one iterations over five, so that its set-up is not in it.
//
// Every figure is the median of its repetitions in CPU seconds of this thread. The run fails if the
// thesis's way, which stops at 1e-6 of the right-hand side, ends farther than 1e-3 of the side of
// the square from ours.
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "dupin/base/parallel.h"
#include "dupin/warp/warper.h"
#include "tests/support/planar_shapes.h"

#ifdef DUPIN_PEER_CGAL
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_deformation.h>
#endif

namespace {

using dupin::Points2;
using Eigen::Index;
using Eigen::VectorXd;

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double median_seconds(int repetitions, const std::function<void()>& body) {
  std::vector<double> spent;
  for (int i = 0; i < repetitions; ++i) {
    const double start = cpu_seconds();
    body();
    spent.push_back(cpu_seconds() - start);
  }
  std::sort(spent.begin(), spent.end());
  return spent[spent.size() / 2];
}

std::vector<dupin::Pin> twelve_pins(const dupin::PlanarMesh& mesh, double size) {
  std::vector<dupin::Pin> pins;
  for (int i = 0; i < 12; ++i) {
    const double x = size * (0.1 + 0.25 * (i % 4));
    const double y = size * (0.15 + 0.33 * static_cast<double>(i / 4));
    dupin::Pin pin;
    pin.source = mesh.points.row(dupin::test::nearest_vertex(mesh.points, x, y)).transpose();
    pin.target = pin.source + 0.05 * size * Eigen::Vector2d(std::sin(2.0 * i), std::cos(3.0 * i));
    pins.push_back(pin);
  }
  return pins;
}

// The global step as the thesis solves it: the Laplacian of free vertices by Jacobi-preconditioned
// conjugate gradients, one coordinate after the other; the local step is Eq. 7.16.
class ThesisIteration {
 public:
  ThesisIteration(const dupin::PlanarMesh& mesh, const dupin::Warper& warper,
                  const VectorXd& vertex_weight)
      : mesh_(mesh),
        ring_(warper.graph().topology.ring),
        weight_(vertex_weight),
        unknown_(Eigen::VectorXi::Zero(mesh.points.rows())) {
    for (const auto& place : warper.places()) {
      Index k = 0;
      place.weights.maxCoeff(&k);
      unknown_[mesh.triangles(place.triangle, k)] = -1;
    }
    int count = 0;
    for (Index v = 0; v < unknown_.size(); ++v) {
      if (unknown_[v] == 0) unknown_[v] = count++;
    }
    std::vector<Eigen::Triplet<double>> entries;
    for (Index v = 0; v < unknown_.size(); ++v) {
      if (unknown_[v] < 0) continue;
      double sum = 0.0;
      for (const auto* k = ring_.begin(v); k != ring_.end(v); ++k) {
        const double w = weight_[v] + weight_[*k];
        sum += w;
        if (unknown_[*k] >= 0) entries.emplace_back(unknown_[v], unknown_[*k], -w);
      }
      entries.emplace_back(unknown_[v], unknown_[v], sum);
    }
    matrix_.resize(count, count);
    matrix_.setFromTriplets(entries.begin(), entries.end());
    solver_.setTolerance(1e-6);
    solver_.compute(matrix_);
  }

  void iterate(Points2& q) {
    const Index num_vertices = q.rows();
    Points2 rotation(num_vertices, 2);
    for (Index n = 0; n < num_vertices; ++n) {
      double x = 0.0;
      double y = 0.0;
      for (const auto* k = ring_.begin(n); k != ring_.end(n); ++k) {
        const Eigen::RowVector2d p = mesh_.points.row(*k) - mesh_.points.row(n);
        const Eigen::RowVector2d d = q.row(*k) - q.row(n);
        x += p.dot(d);
        y += p.x() * d.y() - p.y() * d.x();
      }
      rotation.row(n) << x / std::hypot(x, y), y / std::hypot(x, y);
    }
    Points2 h(matrix_.rows(), 2);
    Points2 start(matrix_.rows(), 2);
    for (Index n = 0; n < num_vertices; ++n) {
      if (unknown_[n] < 0) continue;
      Eigen::RowVector2d sum = Eigen::RowVector2d::Zero();
      for (const auto* k = ring_.begin(n); k != ring_.end(n); ++k) {
        const Eigen::RowVector2d p = mesh_.points.row(n) - mesh_.points.row(*k);
        const Eigen::RowVector2d r = weight_[n] * rotation.row(n) + weight_[*k] * rotation.row(*k);
        sum += Eigen::RowVector2d(r.x() * p.x() - r.y() * p.y(), r.y() * p.x() + r.x() * p.y());
        if (unknown_[*k] < 0) sum += (weight_[n] + weight_[*k]) * q.row(*k);
      }
      h.row(unknown_[n]) = sum;
      start.row(unknown_[n]) = q.row(n);
    }
    for (Index axis = 0; axis < 2; ++axis) {
      const VectorXd solution = solver_.solveWithGuess(h.col(axis), start.col(axis));
      for (Index n = 0; n < num_vertices; ++n) {
        if (unknown_[n] >= 0) q(n, axis) = solution[unknown_[n]];
      }
    }
  }

 private:
  const dupin::PlanarMesh& mesh_;
  const dupin::Adjacency& ring_;
  VectorXd weight_;
  Eigen::VectorXi unknown_;
  Eigen::SparseMatrix<double> matrix_;
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver_;
};

// Weights as Warper gives them: 4 at pins, 2 on their rings.
VectorXd weights_at_pins(const dupin::PlanarMesh& mesh, const dupin::Warper& warper) {
  VectorXd weight = VectorXd::Ones(mesh.points.rows());
  const auto& ring = warper.graph().topology.ring;
  for (const auto& place : warper.places()) {
    Index k = 0;
    place.weights.maxCoeff(&k);
    const Index v = mesh.triangles(place.triangle, k);
    weight[v] = 4.0;
    for (const auto* n = ring.begin(v); n != ring.end(v); ++n)
      weight[*n] = std::max(weight[*n], 2.0);
  }
  return weight;
}

#ifdef DUPIN_PEER_CGAL
double cgal_seconds_per_iteration(const dupin::PlanarMesh& mesh,
                                  const std::vector<dupin::Pin>& pins, int repetitions) {
  using Kernel = CGAL::Simple_cartesian<double>;
  using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
  Surface surface;
  std::vector<Surface::Vertex_index> vertex;
  for (Index v = 0; v < mesh.points.rows(); ++v)
    vertex.push_back(surface.add_vertex({mesh.points(v, 0), mesh.points(v, 1), 0.0}));
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    surface.add_face(vertex[static_cast<std::size_t>(mesh.triangles(f, 0))],
                     vertex[static_cast<std::size_t>(mesh.triangles(f, 1))],
                     vertex[static_cast<std::size_t>(mesh.triangles(f, 2))]);
  }
  using Deformation =
      CGAL::Surface_mesh_deformation<Surface, CGAL::Default, CGAL::Default, CGAL::SPOKES_AND_RIMS>;
  Deformation deformation(surface);
  for (const auto v : vertex) deformation.insert_roi_vertex(v);
  for (const auto& pin : pins) {
    const Index v = dupin::test::nearest_vertex(mesh.points, pin.source.x(), pin.source.y());
    deformation.insert_control_vertex(vertex[static_cast<std::size_t>(v)]);
  }
  if (!deformation.preprocess()) return 0.0;
  for (const auto& pin : pins) {
    const Index v = dupin::test::nearest_vertex(mesh.points, pin.source.x(), pin.source.y());
    deformation.set_target_position(vertex[static_cast<std::size_t>(v)],
                                    {pin.target.x(), pin.target.y(), 0.0});
  }
  const double one = median_seconds(repetitions, [&] { deformation.deform(1, 0.0); });
  const double six = median_seconds(repetitions, [&] { deformation.deform(6, 0.0); });
  return (six - one) / 5.0;
}
#endif

void run(int columns, int rows, int repetitions, bool has_peers) {
  const dupin::PlanarMesh mesh = dupin::test::planar_grid(columns, rows, 10.0);
  const std::vector<dupin::Pin> pins = twelve_pins(mesh, 10.0 * std::min(columns, rows));
  dupin::WarpOptions options;
  options.iterations = 1;
  const double start = cpu_seconds();
  const dupin::Warper warper(mesh, pins, {}, options);
  const double prepare = cpu_seconds() - start;
  const Points2 targets = warper.targets();
  Points2 q;
  const double drag = median_seconds(repetitions, [&] { q = warper.drag(targets).points; });
  options.iterations = 0;
  const dupin::Warper still(mesh, pins, {}, options);
  Points2 guess;
  const double mls = median_seconds(repetitions, [&] { guess = still.drag(targets).points; });
  const double iteration = median_seconds(repetitions, [&] {
    Points2 copy = guess;
    warper.arap().iterate(copy);
  });
  std::printf(
      "%8ld triangles: drag %8.3f ms (MLS %.3f, ARAP %.3f), preparation %8.1f ms, %ld "
      "entries\n",
      static_cast<long>(mesh.triangles.rows()), 1e3 * drag, 1e3 * mls, 1e3 * iteration,
      1e3 * prepare, static_cast<long>(warper.arap().num_factor_entries()));
  if (!has_peers) return;
  ThesisIteration thesis(mesh, warper, weights_at_pins(mesh, warper));
  Points2 theirs;
  const double pcg = median_seconds(std::max(1, repetitions / 20), [&] {
    theirs = guess;
    thesis.iterate(theirs);
  });
  const double difference = (theirs - q).cwiseAbs().maxCoeff();
  std::printf("         thesis's way %8.2f ms an iteration: %.1f times ours (differs by %.1e px)\n",
              1e3 * pcg, pcg / iteration, difference);
  if (!(difference < 1e-3 * 10.0 * columns)) {
    std::printf("the results disagree\n");
    std::exit(1);
  }
#ifdef DUPIN_PEER_CGAL
  const double cgal = cgal_seconds_per_iteration(mesh, pins, std::max(1, repetitions / 20));
  std::printf("         CGAL         %8.2f ms an iteration: %.1f times ours\n", 1e3 * cgal,
              cgal / iteration);
#else
  std::printf("         CGAL was not there when this was built\n");
#endif
}

}  // namespace

int main(int count, char** arguments) {
  const bool has_peers = count > 1 && std::string(arguments[1]) == "--peers";
  dupin::set_thread_count(1);
  run(37, 37, 400, has_peers);
  run(100, 100, 200, has_peers);
  run(316, 316, 20, has_peers);
  return 0;
}
