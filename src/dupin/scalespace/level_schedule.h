#pragma once

#include <Eigen/Core>

namespace dupin {

/// Which scale number t_l belongs to a level.
enum class ScaleMeasure {
  exact,     ///< tau_l = sum of the time steps: the diffusion time, additive and free of parameters
             ///< (inventory A13)
  thesis,    ///< t_l of Eq. 5.24: fit of exp(-omega^2 t) to log h_l with omega in [0, 2] (erratum
             ///< E-20)
  spectral,  ///< the same fit with omega in [0, sqrt 2], the range that the spectrum really has
  variance   ///< Eq. 5.25 halved (E-23); diverges at level 1 and is 0 there
};

/// Levels of the stack and their time steps lambda_l = lambda0 delta^l (Eq. 5.23). Steps are in
/// units of the squared mean edge (tau): on a regular mesh the umbrella operator is e^2/4 times the
/// Laplacian.
struct LevelSchedule {
  int num_levels = 35;   ///< L >= 2 fields F^0 .. F^{L-1}
  double lambda0 = 1.0;  ///< first time step > 0
  double delta = 1.2;    ///< growth of the steps >= 1 (the program asks for > 1)
};

/// @throws InvalidArgument naming the field and its legal range; also if the last step overflows
void validate(const LevelSchedule& schedule);

/// lambda_0 .. lambda_{L-2}.
Eigen::VectorXd time_steps(const LevelSchedule& schedule);

/// Scale of every level, t_0 = 0 .. t_{L-1}, in the same unit as the time steps. For the default
/// schedule `thesis` gives t_5 = 2.974, t_10 = 7.470, t_15 = 13.678, t_20 = 21.699.
Eigen::VectorXd level_scales(const LevelSchedule& schedule, ScaleMeasure measure);

}  // namespace dupin
