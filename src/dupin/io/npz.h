#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/io/read_options.h"

namespace dupin {

using RowMatrixXd = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// An array of NumPy's, row-major, 1 or 2 dimensions.
struct NpyArray {
  std::string name;                 ///< key in an .npz; unused in an .npy
  std::vector<Eigen::Index> shape;  ///< 1 or 2 entries
  RowMatrixXd values;               ///< 1-d arrays have one column
  bool as_float32 = false;          ///< stored as <f4 instead of <f8
};

/// Writes `array` as .npy (format 1.0, little endian) or `arrays` as .npz (zip, stored, dates fixed
/// so that equal arrays give equal bytes; zip64 from 4 GiB on). Atomic as write_file_atomically().
void write_npy(const std::string& path, const NpyArray& array);
void write_npz(const std::string& path, const std::vector<NpyArray>& arrays);

/// Writes single-precision `values`, row-major, as .npy of any shape (<f4). NaN is kept: pictures
/// and maps have places without a value. read_npy() refuses such.
/// @throws InvalidArgument unless the sizes in `shape` multiply to the number of values
void write_npy(const std::string& path, const std::vector<Eigen::Index>& shape,
               std::span<const float> values);

/// Reads .npy of float or integer numbers (<f4 <f8 <i1..<i8 |u1.. , C or Fortran order), 1 or 2
/// dimensions.
/// @throws IoError as read_surface(); E_NONFINITE when a value is not finite
NpyArray read_npy(const std::string& path, const ReadLimits& limits = {},
                  const RunControl& run = {});

}  // namespace dupin
