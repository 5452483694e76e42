#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/features/keypoints.h"
#include "dupin/mesh/heal.h"
#include "dupin/scalespace/pcg_reference.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/laplacian.h"
#include "dupin/surface/surface_graph.h"
#include "fuzz/snapped_surface.h"

// The whole chain from a surface to its keypoints. Three bytes choose the signal, the schedule and
// the rule; the rest is a surface, or, when the first byte is odd, a cloud (its faces are ignored).
// Either the input is refused with a code, or everything is finite, keypoints lie where they may,
// and a second run on three threads gives the same bits.
namespace dupin::fuzz {
namespace {

struct Choice {
  bool is_cloud = false;
  Signal signal = Signal::height;
  ScaleSpaceOptions stack = {};
  KeypointOptions keypoints = {};
  bool use_topology = false;  // for a sharper bound of the spectrum, another one for every surface
  bool solve_reference = false;
};

struct Outcome {
  std::vector<Eigen::VectorXd> fields;
  std::vector<LevelMatrix> stacks;
  std::vector<KeypointSet> keypoints;
};

[[noreturn]] void broken(const char* promise) {
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

template <class Matrix>
void require_finite(const Matrix& matrix, const char* promise) {
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    if (!std::isfinite(matrix.data()[i])) broken(promise);
  }
}

Choice choice_of(Bytes& bytes) {
  Choice choice;
  const unsigned first = bytes.next();
  choice.is_cloud = (first & 1U) != 0;
  choice.signal = choice.is_cloud ? Signal::height : static_cast<Signal>((first >> 1U) % 5);
  choice.solve_reference = (first >> 5U) == 0;
  const unsigned second = bytes.next();
  // Few values, so that most inputs find their filter bank in the memory of the last ones.
  constexpr int kLevels[] = {2, 3, 5, 9, 15, 20, 35, 4};
  choice.stack.schedule.num_levels = kLevels[second % 8];
  choice.use_topology = second % 64 < 8;
  if ((second & 64U) != 0 && choice.stack.schedule.num_levels < 16) {
    choice.stack.schedule.delta = 1.5;
  }
  choice.stack.filter = (second & 128U) != 0 ? Filter::heat : Filter::implicit;
  const unsigned third = bytes.next();
  // The fitted scales integrate over thousands of samples a level, at every call.
  if (choice.stack.schedule.num_levels < 6) {
    choice.keypoints.measure = static_cast<ScaleMeasure>(third % 4);
  }
  choice.keypoints.max_edge_ratio = (third & 4U) != 0 ? 5.0 : 0.0;
  choice.keypoints.min_contrast = (third & 8U) != 0 ? 0.01 : 0.0;
  choice.keypoints.min_level = (third & 16U) != 0 ? 1 : 0;
  choice.keypoints.min_persistence = (third & 32U) != 0 ? 1 : 6;
  choice.keypoints.top = (third & 64U) != 0 ? 3 : 0;
  return choice;
}

// Forward error against one linear solve a level, in the norm of the operator. The solves stop at a
// relative residual of 1e-12 each; 1e-9 leaves room for 34 of them and for masses that differ by
// a factor of a thousand.
void require_error_bound(const DiffusionOperator& op, const Eigen::VectorXd& field,
                         const ScaleSpace& stack, const LevelSchedule& schedule) {
  const ReferenceScaleSpace reference = reference_scale_space(op, field, schedule);
  if (reference.status != Status::ok) return;
  const auto norm = [&](const Eigen::VectorXd& x) {
    return std::sqrt(op.mass.dot(x.cwiseProduct(x)));
  };
  for (Eigen::Index l = 0; l < stack.levels.rows(); ++l) {
    const Eigen::VectorXd difference = (stack.levels.row(l) - reference.levels.row(l)).transpose();
    if (norm(difference) > (stack.error_bound + 1e-9) * norm(field)) broken("error_bound");
  }
}

void require_sound(const SurfaceGraph& graph, const KeypointSet& set, int num_levels) {
  for (const Keypoint& keypoint : set.keypoints) {
    if (keypoint.vertex < 0 || keypoint.vertex >= graph.points.rows()) broken("keypoint vertex");
    if (graph.is_guarded[static_cast<std::size_t>(keypoint.vertex)] != 0)
      broken("guarded keypoint");
    if (keypoint.level < 0 || keypoint.level >= num_levels) broken("keypoint level");
    // An edge ratio may be infinite: the second derivatives differ in sign.
    for (const double value : {keypoint.tau, keypoint.radius, keypoint.response}) {
      if (!std::isfinite(value)) broken("finite keypoint");
    }
    if (std::isnan(keypoint.edge_ratio)) broken("edge ratio");
  }
}

void add_operator(const SurfaceGraph& graph, const Choice& choice, const DiffusionOperator& op,
                  const Eigen::VectorXd& field, Outcome& outcome) {
  ScaleSpaceOptions options = choice.stack;
  // The series of a wide spectrum over long times has thousands of terms: seconds an input.
  if (op.spectrum_bound > 2.0) {
    options.schedule.num_levels = std::min(options.schedule.num_levels, 5);
  }
  const LevelSchedule& schedule = options.schedule;
  const ScaleSpace stack = compute_scale_space(op, field, options);
  require_finite(stack.levels, "finite levels");
  require_finite(stack.loc, "finite LoC");
  const double scale = field.size() > 0 ? field.cwiseAbs().maxCoeff() : 0.0;
  const LevelMatrix invariant = scale_invariant_loc(stack.loc, scale);
  require_finite(invariant, "finite si-LoC");
  if (choice.solve_reference && choice.stack.filter == Filter::implicit) {
    require_error_bound(op, field, stack, schedule);
  }
  const int num_levels = schedule.num_levels;
  for (const KeypointRule rule :
       {KeypointRule::persistent, KeypointRule::space_scale, KeypointRule::level}) {
    if (rule == KeypointRule::level && num_levels < 3) continue;
    KeypointOptions wanted = choice.keypoints;
    wanted.rule = rule;
    wanted.level = std::clamp(num_levels - 2, 1, 20);
    if (num_levels < 4) wanted.min_level = 0;
    // This measure has no scale at level 1 and must be refused, whatever the surface.
    const bool is_refusal_due = wanted.measure == ScaleMeasure::variance;
    try {
      KeypointSet set = find_keypoints(graph, stack.loc, schedule, scale, wanted);
      if (is_refusal_due) broken("variance is refused");
      require_sound(graph, set, num_levels);
      outcome.keypoints.push_back(std::move(set));
    } catch (const InvalidArgument&) {
      if (!is_refusal_due) throw;
    }
  }
  outcome.stacks.push_back(stack.levels);
  outcome.stacks.push_back(stack.loc);
  outcome.stacks.push_back(invariant);
}

Outcome run_chain(const PolygonMesh& input, const Choice& choice) {
  Outcome outcome;
  SurfaceGraph graph;
  if (choice.is_cloud) {
    graph = surface_graph(PointCloud{input.points, {}});
  } else {
    const HealedSurface healed = heal(input);
    graph = surface_graph(healed.mesh, healed.is_guarded);
  }
  require_finite(graph.normals, "finite normals");
  const Eigen::VectorXd field = compute_signal(graph, choice.signal);
  require_finite(field, "finite signal");
  outcome.fields.push_back(field);
  const MeshTopology* topology = graph.is_mesh() && choice.use_topology ? &graph.topology : nullptr;
  add_operator(graph, choice, umbrella_operator(graph.topology.ring, topology), field, outcome);
  if (graph.is_mesh()) {
    const CotanWeights weights = cotan_weights(Mesh{graph.points, graph.triangles}, graph.topology);
    add_operator(graph, choice, cotan_operator(graph.topology.ring, weights, graph.mean_edge),
                 field, outcome);
  }
  return outcome;
}

template <class Matrix>
bool has_same_bits(const Matrix& a, const Matrix& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         (a.size() == 0 || std::memcmp(a.data(), b.data(),
                                       static_cast<std::size_t>(a.size()) * sizeof(double)) == 0);
}

bool is_same(const Keypoint& a, const Keypoint& b) {
  return a.vertex == b.vertex && a.level == b.level && a.tau == b.tau && a.radius == b.radius &&
         a.response == b.response && a.kind == b.kind && a.persistence == b.persistence &&
         a.edge_ratio == b.edge_ratio;
}

void require_same(const Outcome& a, const Outcome& b) {
  for (std::size_t i = 0; i < a.fields.size(); ++i) {
    if (!has_same_bits(a.fields[i], b.fields[i])) broken("same signal again");
  }
  for (std::size_t i = 0; i < a.stacks.size(); ++i) {
    if (!has_same_bits(a.stacks[i], b.stacks[i])) broken("same stack again");
  }
  for (std::size_t i = 0; i < a.keypoints.size(); ++i) {
    const auto& left = a.keypoints[i].keypoints;
    const auto& right = b.keypoints[i].keypoints;
    if (left.size() != right.size()) broken("same number of keypoints again");
    for (std::size_t k = 0; k < left.size(); ++k) {
      if (!is_same(left[k], right[k])) broken("same keypoints again");
    }
  }
}

}  // namespace
}  // namespace dupin::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dupin::fuzz;
  Bytes bytes(data, size);
  const Choice choice = choice_of(bytes);
  const dupin::PolygonMesh input = snapped_surface(bytes);
  try {
    dupin::set_thread_count(1);
    const Outcome once = run_chain(input, choice);
    dupin::set_thread_count(3);
    require_same(once, run_chain(input, choice));
  } catch (const dupin::AnalysisError&) {
    return 0;
  }
  return 0;
}
