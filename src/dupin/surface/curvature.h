#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/topology.h"

namespace dupin {

/// Curvature at every vertex. Sign: with outward normals a sphere has H > 0; k1 >= k2, signed.
struct CurvatureField {
  Status status = Status::ok;
  Eigen::VectorXd k1;  ///< #V larger principal curvature [1/mu]
  Eigen::VectorXd k2;  ///< #V smaller principal curvature [1/mu]
  Points d1;           ///< #V by 3 unit direction of k1, sign arbitrary
  Points d2;           ///< #V by 3 unit direction of k2; d1, d2, normal are orthonormal
  Points normals;      ///< #V by 3 the unit normals used
  std::vector<std::uint8_t> is_estimated;  ///< #V; 0: no face of positive area, values are 0
  Eigen::Index num_skipped = 0;            ///< how many are not estimated

  Eigen::VectorXd mean() const { return 0.5 * (k1 + k2); }       ///< H [1/mu]
  Eigen::VectorXd gauss() const { return k1.cwiseProduct(k2); }  ///< K [1/mu^2]
};

/// Six independent entries of a symmetric tensor a vertex: xx, xy, xz, yy, yz, zz. #V by 6.
using TensorField = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;

/// Taubin's curvature tensor on the 1-ring (Taubin, "Estimating the tensor of curvature of a
/// surface from a polyhedral approximation", ICCV 1995; thesis section 5.1): M = sum_j w_j k_j T_j
/// T_j^T with the normal curvature k_j = -2 n.(p_j - p) / |p_j - p|^2 along the tangent T_j of edge
/// j and weights proportional to the area of the faces on that edge; k1 = 3 m1 - m2, k2 = 3 m2 - m1
/// from its tangential eigenvalues.
///
/// Exact in the limit for rings whose edges are spread evenly in angle; biased on anisotropic rings
/// and very sensitive to noise (docs/methods/curvature.md). `topology` must be that of `mesh`.
/// @throws InvalidArgument if the sizes of mesh and topology differ. Cost: O(V valence).
CurvatureField estimate_curvature_taubin(const Mesh& mesh, const MeshTopology& topology,
                                         RunControl run = {});

/// k1 d1 d1^T + k2 d2 d2^T in world coordinates: the signal of the tensor stack (thesis 5.1).
TensorField curvature_tensor(const CurvatureField& field);

/// Principal curvatures and directions of a (smoothed) tensor field: at each vertex the eigenvector
/// most parallel to the given normal is set aside, the other two span the tangent plane. `normals`
/// #V by 3.
/// @throws InvalidArgument if the sizes differ or a value is not finite
CurvatureField diagonalise(const TensorField& tensor, const Points& normals);

}  // namespace dupin
