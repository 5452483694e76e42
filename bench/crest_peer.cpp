// Crest lines beside those of CGAL's Ridge_approximation (jets of degree 4, elliptic crest ridges
// by their fourth order) on clean smooth surfaces: a table in Markdown.
//
// "CGAL near ours" is the share of the length of CGAL's lines within 1.5 mean edges of one of ours
// of their kind, "ours near CGAL" the other way round; "near true" are shares of either's length
// near lines known in closed form. CGAL's lines have no threshold of their own: it sums a sharpness
// along each (the second derivative of the curvature) and leaves the cut to its user. "All" are all
// of them but those shorter than ours may be; "sharpest" are the sharpest of them, as many as make
// up the length that ours have together.
//
// crest_peer [FILE ...] [--only NAME] [--size 20000] [--rings 4] [--levels 0 6] [--threads 1]
#include <CGAL/Monge_via_jet_fitting.h>
#include <CGAL/Ridges.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/crest/crest_lines.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mls/noise_level.h"
#include "dupin/surface/curvature.h"
#include "tests/support/crest_surfaces.h"

namespace {

using namespace dupin;
using Eigen::Index;

constexpr double kReach = 1.5;  // mean edges

using Kernel = CGAL::Simple_cartesian<double>;
using PeerMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Vertex = PeerMesh::Vertex_index;
using Scalars = PeerMesh::Property_map<Vertex, double>;
using Vectors = PeerMesh::Property_map<Vertex, Kernel::Vector_3>;
using Fitting = CGAL::Monge_via_jet_fitting<Kernel>;

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

struct PeerLine {
  test::TrueLine line;
  double length = 0.0;
  double sharpness = 0.0;
};

struct PeerLines {
  std::vector<PeerLine> lines;
  double seconds = 0.0;
};

// A sphere with waves in several directions: smooth, of no symmetry, with ridges and valleys of
// many strengths. (Round bumps on a sphere would have constant curvatures along one family of
// lines, and no crests.)
Mesh wavy_body(Index num_vertices) {
  Mesh mesh = make_sphere(1.0, num_vertices).mesh;
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    const Eigen::RowVector3d u = mesh.points.row(v).normalized();
    mesh.points.row(v) = u * (1.0 + 0.12 * std::sin(4.0 * u[0] + 0.3) * std::cos(3.0 * u[1] + 1.0) +
                              0.10 * std::sin(3.5 * u[2] + 0.7 * u[0]));
  }
  return mesh;
}

Kernel::Point_3 to_point(const Points& points, Index v) {
  return {points(v, 0), points(v, 1), points(v, 2)};
}

// Vertices within `rings` edges, the vertex first.
void collect(const Adjacency& ring, std::int32_t vertex, int rings, std::vector<std::int32_t>& mark,
             std::vector<std::int32_t>& found) {
  found.assign(1, vertex);
  mark[static_cast<std::size_t>(vertex)] = vertex;
  std::size_t first = 0;
  for (int r = 0; r < rings; ++r) {
    const std::size_t last = found.size();
    for (std::size_t i = first; i < last; ++i) {
      for (const std::int32_t* j = ring.begin(found[i]); j != ring.end(found[i]); ++j) {
        if (mark[static_cast<std::size_t>(*j)] == vertex) continue;
        mark[static_cast<std::size_t>(*j)] = vertex;
        found.push_back(*j);
      }
    }
    first = last;
  }
}

struct PeerFields {
  Scalars k1, k2, b0, b3, p1, p2;
  Vectors d1, d2;
};

// Monge forms at all vertices. Their normals point inward, so that convex places have a positive
// curvature and CGAL's ridges of the larger one are ours.
PeerFields fit_jets(const SurfaceGraph& graph, const Points& normals, int rings, PeerMesh& mesh) {
  const auto scalars = [&](const char* name) {
    return mesh.add_property_map<Vertex, double>(name, 0.0).first;
  };
  const auto vectors = [&](const char* name) {
    return mesh.add_property_map<Vertex, Kernel::Vector_3>(name, CGAL::NULL_VECTOR).first;
  };
  PeerFields at{scalars("v:k1"), scalars("v:k2"), scalars("v:b0"), scalars("v:b3"),
                scalars("v:p1"), scalars("v:p2"), vectors("v:d1"), vectors("v:d2")};
  std::vector<std::int32_t> mark(static_cast<std::size_t>(graph.points.rows()), -1);
  std::vector<std::int32_t> around;
  std::vector<Kernel::Point_3> points;
  constexpr std::size_t kLeast = 15;  // coefficients of degree 4
  // Ridge_approximation follows a line into a triangle by edges it has not set where two corners
  // have an extremality of exactly zero, as flat and symmetric places do: none may be zero.
  const auto not_zero = [](double value) { return value == 0.0 ? 1e-300 : value; };
  for (Index v = 0; v < graph.points.rows(); ++v) {
    const auto index = static_cast<std::int32_t>(v);
    for (int wider = 0; wider < 3; ++wider) {
      collect(graph.topology.ring, index, rings + wider, mark, around);
      if (around.size() >= kLeast) break;
      std::fill(mark.begin(), mark.end(), -1);
    }
    if (around.size() < kLeast) continue;
    points.clear();
    for (const std::int32_t j : around) points.push_back(to_point(graph.points, j));
    Fitting fitting;
    Fitting::Monge_form form = fitting(points.begin(), points.end(), 4, 4);
    form.comply_wrt_given_normal({-normals(v, 0), -normals(v, 1), -normals(v, 2)});
    const Vertex vertex(static_cast<PeerMesh::size_type>(v));
    const double k1 = form.principal_curvatures(0);
    const double k2 = form.principal_curvatures(1);
    const double b0 = form.third_order_coefficients(0);
    const double b1 = form.third_order_coefficients(1);
    const double b2 = form.third_order_coefficients(2);
    const double b3 = form.third_order_coefficients(3);
    at.k1[vertex] = k1;
    at.k2[vertex] = k2;
    at.b0[vertex] = not_zero(b0);
    at.b3[vertex] = not_zero(b3);
    // Second derivatives of the curvatures along their own lines, times k1 - k2.
    at.p1[vertex] =
        3.0 * b1 * b1 + (k1 - k2) * (form.fourth_order_coefficients(0) - 3.0 * k1 * k1 * k1);
    at.p2[vertex] =
        3.0 * b2 * b2 + (k2 - k1) * (form.fourth_order_coefficients(4) - 3.0 * k2 * k2 * k2);
    at.d1[vertex] = form.maximal_principal_direction();
    at.d2[vertex] = form.minimal_principal_direction();
  }
  return at;
}

PeerLines find_peer_lines(const SurfaceGraph& graph, int rings) {
  PeerMesh mesh;
  for (Index v = 0; v < graph.points.rows(); ++v) mesh.add_vertex(to_point(graph.points, v));
  for (Index f = 0; f < graph.triangles.rows(); ++f) {
    const auto at = [&](Index k) {
      return Vertex(static_cast<PeerMesh::size_type>(graph.triangles(f, k)));
    };
    mesh.add_face(at(0), at(1), at(2));
  }
  const Points normals = vertex_normals(Mesh{graph.points, graph.triangles});
  const auto begin = std::chrono::steady_clock::now();
  const PeerFields at = fit_jets(graph, normals, rings, mesh);
  CGAL::Ridge_approximation<PeerMesh, Scalars, Vectors> ridges(mesh, at.k1, at.k2, at.b0, at.b3,
                                                               at.d1, at.d2, at.p1, at.p2);
  std::vector<CGAL::Ridge_line<PeerMesh>*> found;
  ridges.compute_crest_ridges(std::back_inserter(found), CGAL::Ridge_order_4);
  PeerLines out;
  out.seconds = seconds_since(begin);
  for (CGAL::Ridge_line<PeerMesh>* const raw : found) {
    const std::unique_ptr<CGAL::Ridge_line<PeerMesh>> ridge(raw);
    PeerLine line;
    line.line.kind =
        ridge->line_type() == CGAL::MAX_CREST_RIDGE ? CrestKind::ridge : CrestKind::valley;
    line.sharpness = ridge->sharpness();
    line.line.points.resize(static_cast<Index>(ridge->line()->size()), 3);
    Index row = 0;
    for (const auto& [half_edge, weight] : *ridge->line()) {
      const auto p = mesh.point(mesh.source(half_edge));
      const auto q = mesh.point(mesh.target(half_edge));
      for (int k = 0; k < 3; ++k) line.line.points(row, k) = weight * p[k] + (1.0 - weight) * q[k];
      if (row > 0)
        line.length += (line.line.points.row(row) - line.line.points.row(row - 1)).norm();
      ++row;
    }
    out.lines.push_back(std::move(line));
  }
  return out;
}

struct Lines {
  std::vector<test::TrueLine> lines;
  double length = 0.0;
};

Lines ours(const CrestSet& set, const SurfaceGraph& graph) {
  Lines out{test::lines_on(graph.points, set.lines), 0.0};
  for (const CrestLine& line : set.lines) out.length += line.length;
  return out;
}

// Those of `least` length or more, the sharpest first, up to `length` together.
Lines sharpest(std::vector<PeerLine> lines, double least, double length) {
  std::stable_sort(lines.begin(), lines.end(),
                   [](const PeerLine& a, const PeerLine& b) { return a.sharpness > b.sharpness; });
  Lines out;
  for (const PeerLine& line : lines) {
    if (line.length < least) continue;
    if (out.length >= length) break;
    out.length += line.length;
    out.lines.push_back(line.line);
  }
  return out;
}

std::string percent(double share) {
  char text[16];
  std::snprintf(text, sizeof text, "%.1f", 100.0 * share);
  return text;
}

struct Settings {
  std::vector<std::string> files;
  std::string only;
  Index size = 20'000;
  std::vector<int> rings = {4};
  std::vector<int> levels = {0, 6};
  double reach = kReach;
  int threads = 1;
};

void print_row(const test::CrestSurface& surface, const std::string& which, const Lines& peer,
               const Lines& mine, double edge, double reach) {
  const auto share = [&](const Lines& of, const Lines& to) {
    return percent(test::near_share(of.lines, to.lines, reach * edge));
  };
  std::string truth = "- | -";
  if (!surface.lines.empty()) {
    Lines legal{surface.lines, 0.0};
    legal.lines.insert(legal.lines.end(), surface.allowed.begin(), surface.allowed.end());
    truth = share(peer, legal) + " | " + share(mine, legal);
  }
  std::printf("| %s | %s | %.0f | %.0f | %s | %s | %s |\n", surface.name.c_str(), which.c_str(),
              peer.length / edge, mine.length / edge, share(peer, mine).c_str(),
              share(mine, peer).c_str(), truth.c_str());
  std::fflush(stdout);
}

void compare(const test::CrestSurface& surface, const Settings& settings) {
  if (!settings.only.empty() && settings.only != surface.name) return;
  const SurfaceGraph graph = surface_graph(surface.mesh);
  const double edge = graph.mean_edge;
  std::vector<PeerLines> peers;
  for (const int r : settings.rings) peers.push_back(find_peer_lines(graph, r));
  for (const int level : settings.levels) {
    const auto begin = std::chrono::steady_clock::now();
    CrestOptions options;
    options.level = level;
    options.noise_sigma = estimate_noise(graph.points).sigma;
    const CrestSet set = find_crest_lines(graph, options);
    const double seconds = seconds_since(begin);
    const Lines mine = ours(set, graph);
    const double least = options.min_length * edge;
    for (std::size_t i = 0; i < peers.size(); ++i) {
      const std::string name =
          (level == 0 ? std::string("all scales") : "level " + std::to_string(level)) + " to " +
          std::to_string(settings.rings[i]) + " rings, ";
      print_row(surface, name + "all",
                sharpest(peers[i].lines, least, std::numeric_limits<double>::infinity()), mine,
                edge, settings.reach);
      print_row(surface, name + "sharpest", sharpest(peers[i].lines, least, mine.length), mine,
                edge, settings.reach);
      std::fprintf(stderr, "%s, %td vertices: ours %.2f s, CGAL %.2f s\n", surface.name.c_str(),
                   graph.points.rows(), seconds, peers[i].seconds);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  CLI::App app("Crest lines beside CGAL's");
  app.add_option("FILE", settings.files, "Surfaces to compare on besides");
  app.add_option("--only", settings.only, "This surface alone, by its name");
  app.add_option("--size", settings.size, "Vertices of the surfaces")->capture_default_str();
  app.add_option("--rings", settings.rings, "Rings of neighbours that CGAL fits to");
  app.add_option("--levels", settings.levels, "Levels of ours; 0: every place at its own scale");
  app.add_option("--reach", settings.reach, "What is near [mean edges]")->capture_default_str();
  app.add_option("--threads", settings.threads, "Of ours; CGAL has one")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  set_thread_count(settings.threads);
  std::printf(
      "| surface | ours to CGAL's | CGAL's length | ours | CGAL near ours %% | ours near CGAL %% | "
      "CGAL near true %% | ours near true %% |\n|---|---|---|---|---|---|---|---|\n");
  compare(test::crest_ellipsoid(settings.size), settings);
  compare(test::crest_torus(settings.size), settings);
  compare(test::crest_gaussian_ridge(settings.size), settings);
  compare({"wavy body", wavy_body(settings.size), {}}, settings);
  for (const std::string& file : settings.files) {
    test::CrestSurface surface{file.substr(file.find_last_of('/') + 1), {}, {}};
    surface.mesh = heal(read_surface(file).mesh).mesh;
    compare(surface, settings);
  }
  return 0;
}
