#pragma once

// The inner loops of PairFactor, compiled for several instruction sets. Vector lanes are rows of a
// panel, and sums over them are taken in one order, so all variants give the same bits.

#include <cstdint>

namespace dupin::detail {

inline constexpr std::int32_t kPanelRows = 4;

/// Columns first to first + num_columns of L. `value`: the part below the diagonal of the square,
/// column by column, then the rows `row` in panels of kPanelRows: [panel][column][row], the last
/// one filled up with zeros.
struct FactorBlock {
  std::int32_t first;
  std::int32_t num_columns;
  std::int32_t num_rows;
  const std::int32_t* row;
  const double* value;
};

/// Turns the first `num_columns` columns of the lower triangle of `front` (size by size,
/// column-major) into L and D, and the rest into what is left of the matrix. False if an entry of D
/// is not positive.
bool eliminate(double* front, std::int32_t size, std::int32_t num_columns, double* diagonal);

/// x := L^-1 x for the columns of the block; `pairs` holds x and y of all unknowns.
void solve_forward(const FactorBlock& block, double* pairs);

/// x := L^-T D^-1 x for the columns of the block. `gathered`: room for twice its rows, rounded up
/// to whole panels.
void solve_backward(const FactorBlock& block, const double* inverse_diagonal, double* gathered,
                    double* pairs);

}  // namespace dupin::detail
