// Meshing of a round cut-out with bays, one thread: prepared outline to finished mesh, at spacings
// that give about 2,700, 20,000 and 200,000 triangles. --peers also runs CGAL's Mesh_2
// (Delaunay_mesher_2, B = 0.125, i.e. 20.7 degrees) on the same outline, its size criterion
// searched until its count is within 2 % of ours; its optional Lloyd smoothing is left out. Each
// line gives the median of the repetitions, the smallest and the mean smallest angle.
//
// mesher_bench [--peers] [--repetitions N]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/triangulate_outline.h"

#ifdef DUPIN_PEER_CGAL
#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Delaunay_mesh_face_base_2.h>
#include <CGAL/Delaunay_mesh_size_criteria_2.h>
#include <CGAL/Delaunay_mesh_vertex_base_2.h>
#include <CGAL/Delaunay_mesher_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#endif

namespace {

using Eigen::Index;

dupin::Outline bays() {
  dupin::Points2 loop(4000, 2);
  for (Index i = 0; i < loop.rows(); ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / 4000.0;
    const double r = 600.0 * (1.0 + 0.2 * std::cos(5.0 * angle));
    loop.row(i) << 800.0 + r * std::cos(angle), 800.0 + r * std::sin(angle);
  }
  return {{loop}, {0}};
}

struct Timing {
  double milliseconds = 0.0;
  Index triangles = 0;
  double smallest_deg = 0.0, mean_deg = 0.0;
};

template <typename Run>
double median_ms(int repetitions, const Run& run) {
  std::vector<double> times;
  for (int i = 0; i < repetitions; ++i) {
    const auto start = std::chrono::steady_clock::now();
    run();
    const std::chrono::duration<double, std::milli> passed =
        std::chrono::steady_clock::now() - start;
    times.push_back(passed.count());
  }
  std::nth_element(times.begin(), times.begin() + repetitions / 2, times.end());
  return times[static_cast<std::size_t>(repetitions / 2)];
}

void print(const char* name, const Timing& t) {
  std::printf("%-22s %8td triangles %9.2f ms  smallest %5.2f  mean smallest %5.2f deg\n", name,
              t.triangles, t.milliseconds, t.smallest_deg, t.mean_deg);
}

Timing dupin_mesh(const dupin::Outline& outline, double spacing, int passes, int repetitions) {
  dupin::MeshingOptions options;
  options.spacing_px = spacing;
  options.smoothing_passes = passes;
  dupin::TriangulatedOutline made;
  Timing timing;
  timing.milliseconds =
      median_ms(repetitions, [&] { made = dupin::triangulate_outline(outline, {}, options); });
  if (made.status != dupin::Status::ok || made.report.below_otherwise != 0) std::abort();
  timing.triangles = made.mesh.triangles.rows();
  timing.smallest_deg = made.report.smallest_angle_deg;
  timing.mean_deg = made.report.mean_smallest_angle_deg;
  return timing;
}

#ifdef DUPIN_PEER_CGAL
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Delaunay_mesh_vertex_base_2<Kernel>;
using FaceBase = CGAL::Delaunay_mesh_face_base_2<Kernel>;
using Storage = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
using Cdt = CGAL::Constrained_Delaunay_triangulation_2<Kernel, Storage>;
using Criteria = CGAL::Delaunay_mesh_size_criteria_2<Cdt>;

Timing cgal_mesh(const dupin::Outline& outline, double size, int repetitions) {
  Timing timing;
  Cdt cdt;
  timing.milliseconds = median_ms(repetitions, [&] {
    cdt.clear();
    for (const dupin::Points2& loop : outline.loops) {
      std::vector<Cdt::Vertex_handle> corners;
      for (Index i = 0; i < loop.rows(); ++i)
        corners.push_back(
            cdt.insert(Kernel::Point_2(loop(i, 0), loop(i, 1)),
                       corners.empty() ? Cdt::Face_handle() : corners.back()->face()));
      for (std::size_t i = 0; i < corners.size(); ++i)
        cdt.insert_constraint(corners[i], corners[(i + 1) % corners.size()]);
    }
    CGAL::Delaunay_mesher_2<Cdt, Criteria> mesher(cdt, Criteria(0.125, size));
    mesher.refine_mesh();
  });
  double least = 180.0, sum = 0.0;
  for (auto f = cdt.finite_faces_begin(); f != cdt.finite_faces_end(); ++f) {
    if (!f->is_in_domain()) continue;
    double smallest = 180.0;
    for (int k = 0; k < 3; ++k) {
      const auto u = f->vertex((k + 1) % 3)->point() - f->vertex(k)->point();
      const auto v = f->vertex((k + 2) % 3)->point() - f->vertex(k)->point();
      const double cross = u.x() * v.y() - u.y() * v.x();
      smallest = std::min(smallest, std::atan2(std::abs(cross), u * v) * 180.0 / std::numbers::pi);
    }
    ++timing.triangles;
    least = std::min(least, smallest);
    sum += smallest;
  }
  timing.smallest_deg = least;
  timing.mean_deg = sum / static_cast<double>(timing.triangles);
  return timing;
}

Timing cgal_of_as_many(const dupin::Outline& outline, double spacing, Index wanted,
                       int repetitions) {
  double size = 1.3 * spacing;
  for (int i = 0; i < 12; ++i) {
    const auto count = static_cast<double>(cgal_mesh(outline, size, 1).triangles);
    const double ratio = count / static_cast<double>(wanted);
    if (std::abs(ratio - 1.0) < 0.02) break;
    size *= std::sqrt(ratio);
  }
  return cgal_mesh(outline, size, repetitions);
}
#endif

}  // namespace

int main(int argc, char** argv) {
  bool has_peers = false;
  int repetitions = 9;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--peers") has_peers = true;
    if (argument == "--repetitions" && i + 1 < argc)
      repetitions = std::max(1, std::atoi(argv[++i]));
  }
  for (const double spacing : {30.8, 11.5, 3.65}) {
    const dupin::Outline raw = bays();
    dupin::OutlineOptions prepare;
    prepare.spacing_px = spacing;
    dupin::PreparedOutline prepared;
    const double preparing =
        median_ms(repetitions, [&] { prepared = dupin::prepare_outline(raw, prepare); });
    std::printf("spacing %.2f px, %td corners, prepared in %.2f ms\n", spacing,
                prepared.outline.loops[0].rows(), preparing);
    const Timing rough = dupin_mesh(prepared.outline, spacing, 0, repetitions);
    print("dupin, not smoothed", rough);
    const Timing smooth = dupin_mesh(prepared.outline, spacing, 3, repetitions);
    print("dupin", smooth);
    if (!has_peers) continue;
#ifdef DUPIN_PEER_CGAL
    const Timing peer = cgal_of_as_many(prepared.outline, spacing, smooth.triangles, repetitions);
    print("CGAL Mesh_2", peer);
    std::printf("time of dupin over CGAL's: %.2f, not smoothed %.2f\n",
                smooth.milliseconds / peer.milliseconds, rough.milliseconds / peer.milliseconds);
#else
    std::printf("built without CGAL\n");
#endif
  }
  return 0;
}
