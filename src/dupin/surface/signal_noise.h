#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "dupin/mesh/noise.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {

/// Sixteen replicas of a field side by side: row v holds the values at vertex v.
using ReplicaBlock = Eigen::Matrix<float, Eigen::Dynamic, 16, Eigen::RowMajor>;

/// Draws of the first-order change of a signal under noise of the positions.
struct SignalNoise {
  /// Unit of the blocks in units of the signal; it carries sigma, so that the blocks hold numbers
  /// of the order of one.
  double unit = 0.0;
  /// Replicas 16 b .. 16 b + 15, #V by 16. A function of b alone; may be called from many threads.
  std::function<ReplicaBlock(Eigen::Index block)> draw;
  /// Expected change of the signal, of second order, where it is known; #V, or empty: none.
  Eigen::VectorXd bias;
  /// How the vertices move in one replica, #V by 3 [mu]: what `draw` differentiates along.
  std::function<Points(Eigen::Index replica)> displacement;
};

/// Options of make_signal_noise().
struct SignalNoiseOptions {
  double sigma = 0.0;                        ///< of every deviate, > 0 [mu]
  NoiseModel model = NoiseModel::isotropic;  ///< `isotropic` or `along_normal`
  int normal_smoothing = 6;                  ///< of the height signal, as in HeightSignalOptions
  std::uint64_t seed = 0;
};

/// First-order noise of `signal` on `graph` when every vertex moves by noise of `options`.
///
/// height: exact derivative, of the umbrella vector, of the mean edge and, on a mesh, of the
/// smoothed normals: dh = 2/e^2 (n . d(p - mean of ring) + dn . (p - mean of ring)) - 2 h de/e. The
/// second term vanishes on regular meshes but is white where the first has no low frequencies, so
/// that it leads at coarse levels of irregular meshes (docs/methods/keypoint_uncertainty.md). The
/// normals of a cloud are held. As the points are themselves noisy, p - mean of ring is shrunk to
/// half its noise, so that products of two noises keep their variance under large noise too. The
/// bias is that of the mean edge, which noise lengthens: -2 h E[de] / e. Other signals: central
/// difference over a thousandth of sigma.
///
/// Deviates are quantiles of the normal distribution in 4096 steps, unit variance, from a hash of
/// (seed, replica, vertex): the same for any order of calls.
/// @throws InvalidArgument if sigma is not > 0 and finite or the model is `directional`;
///   AnalysisError E_NO_FACES as compute_signal()
/// Cost of a draw: O(normal_smoothing E) for height, 16 signals otherwise.
SignalNoise make_signal_noise(const SurfaceGraph& graph, Signal signal,
                              const SignalNoiseOptions& options);

/// Standard deviation of what the rounding of the coordinates did to each of them [unit of the
/// points]: half a unit in the last place of double precision, of single precision if all
/// coordinates are such numbers, or of the decimals that all of them keep to (as in text files;
/// steps of more than a thousandth of the extent are a shape), over sqrt 3. The least noise that a
/// surface can be said to have: an estimate below it is about the shape of the rounding. 0 without
/// points.
/// @throws InvalidArgument if a coordinate is not finite
/// Cost: O(V).
double estimate_rounding(const Points& points);

}  // namespace dupin
