#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/warp/contour_keys.h"

namespace dupin::detail {
namespace {

// Costs are in nats; the widths are spreads between garments of one kind (docs/methods).
constexpr double kTurningWidth = 0.5;    // [rad]
constexpr double kDirectionWidth = 0.7;  // of 1 - cos
constexpr double kLengthWidth = 0.5;     // of the logarithm of a ratio of lengths
constexpr double kLengthFloor = 0.015;   // share of the contour that is not told from nothing
constexpr double kHeadingWidth = 0.5;    // [rad]
constexpr double kMostSkip = 4.0;        // price of a key point of kSureKey and more
constexpr double kSureKey = 1.0;         // [rad]
constexpr int kMostSkipped =
    6;  // left out between two pairs, besides the difference of the numbers

constexpr double kNever = -std::numeric_limits<double>::infinity();

double squared(double x) { return x * x; }

// log(exp(a) + exp(b)) without an invalid operation on minus infinities.
double log_add(double a, double b) {
  if (a == kNever) return b;
  if (b == kNever) return a;
  return std::max(a, b) + std::log1p(std::exp(-std::abs(a - b)));
}

class Aligner {
 public:
  Aligner(const std::vector<ContourKey>& a, const std::vector<ContourKey>& b, double upright)
      : a_(a), b_(b), n_(static_cast<int>(a.size())), m_(static_cast<int>(b.size())) {
    reach_ = kMostSkipped + std::abs(n_ - m_);
    pair_.resize(n_, m_);
    for (int i = 0; i < n_; ++i) {
      for (int j = 0; j < m_; ++j) pair_(i, j) = pair_score(at(a_, i), at(b_, j), upright);
    }
    width_a_ = std::min(n_, 1 + reach_);
    width_b_ = std::min(m_, 1 + reach_);
    step_.resize(static_cast<std::size_t>(n_ * m_ * width_a_ * width_b_));
    for (int i = 0; i < n_; ++i) {
      for (int j = 0; j < m_; ++j) {
        for (int di = 1; di <= width_a_; ++di) {
          for (int dj = 1; dj <= width_b_; ++dj)
            step_[step_index(i, j, di, dj)] = step_score(i, j, i + di, j + dj);
        }
      }
    }
  }

  // Best closed path through the pair (i0, j0), as rising (i, j) relative to it.
  double best_through(int i0, int j0, std::vector<KeyPair>& path) const {
    run(i0, j0, true);
    const double score = value_(n_, m_);
    path.clear();
    if (score == kNever) return score;
    for (int state = n_ * (m_ + 1) + m_; state != 0;) {
      state = from_(state / (m_ + 1), state % (m_ + 1));
      path.push_back({(i0 + state / (m_ + 1)) % n_, (j0 + state % (m_ + 1)) % m_, 0.0});
    }
    return score;
  }

  // Posterior of every pair among all closed paths through key i0.
  Eigen::MatrixXd posteriors(int i0, const RunControl& control) const {
    Eigen::MatrixXd log_mass = Eigen::MatrixXd::Constant(n_, m_, kNever);
    double total = kNever;
    for (int j0 = 0; j0 < m_ && !control.cancelled(); ++j0) {
      run(i0, j0, false);
      const Eigen::MatrixXd forward = value_;
      const double all = forward(n_, m_);
      if (all == kNever) continue;
      total = log_add(total, all);
      run_back(i0, j0);
      for (int i = 0; i < n_; ++i) {
        for (int j = 0; j < m_; ++j) {
          if (forward(i, j) == kNever || value_(i, j) == kNever) continue;
          double& mass = log_mass((i0 + i) % n_, (j0 + j) % m_);
          mass = log_add(mass, forward(i, j) + value_(i, j));
        }
      }
    }
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n_, m_);
    for (int i = 0; i < n_; ++i) {
      for (int j = 0; j < m_; ++j) {
        if (log_mass(i, j) != kNever) result(i, j) = std::exp(log_mass(i, j) - total);
      }
    }
    return result;
  }

 private:
  static const ContourKey& at(const std::vector<ContourKey>& keys, int i) {
    return keys[static_cast<std::size_t>(i)];
  }

  static double pair_score(const ContourKey& a, const ContourKey& b, double upright) {
    double cost = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      cost += squared((a.turning[k] - b.turning[k]) / kTurningWidth) / 6.0;
    return -cost - upright * (1.0 - std::cos(a.heading - b.heading)) / kDirectionWidth;
  }

  static double skip_price(const ContourKey& key) {
    return kMostSkip * squared(std::min(1.0, key.prominence / kSureKey));
  }

  std::size_t step_index(int i, int j, int di, int dj) const {
    return static_cast<std::size_t>(((i * m_ + j) * width_a_ + di - 1) * width_b_ + dj - 1);
  }

  // Of going from pair (i, j) to (i2, j2), which may lie round the loop.
  double step_score(int i, int j, int i2, int j2) const {
    double cost = 0.0;
    for (int k = i + 1; k < i2; ++k) cost += skip_price(at(a_, k % n_));
    for (int k = j + 1; k < j2; ++k) cost += skip_price(at(b_, k % m_));
    const Span span_a = span(a_, i, i2, n_);
    const Span span_b = span(b_, j, j2, m_);
    const double ratio = std::log((span_b.share + kLengthFloor) / (span_a.share + kLengthFloor));
    cost += 0.5 * squared(ratio / kLengthWidth);
    cost += 0.5 * squared(std::min(4.0, std::abs(span_a.turn - span_b.turn) / kHeadingWidth));
    return -cost;
  }

  struct Span {
    double share = 0.0;
    double turn = 0.0;
  };
  static Span span(const std::vector<ContourKey>& keys, int from, int to, int count) {
    const ContourKey& first = at(keys, from % count);
    const ContourKey& last = at(keys, to % count);
    Span result{last.share - first.share, last.heading - first.heading};
    if (to / count > from / count) {
      result.share += 1.0;
      result.turn += 2.0 * std::numbers::pi;
    }
    return result;
  }

  // value_(i, j): the best (or the sum over all) of paths from the start to the pair (i, j), its
  // own score included; (n, m) is the start again, its score not counted twice.
  void run(int i0, int j0, bool best) const {
    value_.setConstant(n_ + 1, m_ + 1, kNever);
    from_.setZero(n_ + 1, m_ + 1);
    value_(0, 0) = pair_(i0, j0);
    for (int i = 0; i < n_; ++i) {
      for (int j = 0; j < m_; ++j) {
        if (value_(i, j) == kNever) continue;
        for_each_step(i, j, [&](int i2, int j2) {
          const double score = value_(i, j) + step(i0, j0, i, j, i2, j2) + end(i0, j0, i2, j2);
          if (!best) {
            value_(i2, j2) = log_add(value_(i2, j2), score);
          } else if (score > value_(i2, j2)) {
            value_(i2, j2) = score;
            from_(i2, j2) = i * (m_ + 1) + j;
          }
        });
      }
    }
  }

  // value_(i, j): the sum over all paths from the pair (i, j), its own score not included, to the
  // end.
  void run_back(int i0, int j0) const {
    value_.setConstant(n_ + 1, m_ + 1, kNever);
    value_(n_, m_) = 0.0;
    for (int i = n_ - 1; i >= 0; --i) {
      for (int j = m_ - 1; j >= 0; --j) {
        for_each_step(i, j, [&](int i2, int j2) {
          if (value_(i2, j2) == kNever) return;
          value_(i, j) = log_add(value_(i, j),
                                 value_(i2, j2) + step(i0, j0, i, j, i2, j2) + end(i0, j0, i2, j2));
        });
      }
    }
  }

  double step(int i0, int j0, int i, int j, int i2, int j2) const {
    return step_[step_index((i0 + i) % n_, (j0 + j) % m_, i2 - i, j2 - j)];
  }

  double end(int i0, int j0, int i2, int j2) const {
    return i2 == n_ ? 0.0 : pair_((i0 + i2) % n_, (j0 + j2) % m_);
  }

  template <class Body>
  void for_each_step(int i, int j, const Body& body) const {
    if ((i == 0) != (j == 0)) return;  // the start is paired with nothing else
    for (int i2 = i + 1; i2 <= std::min(n_, i + width_a_); ++i2) {
      for (int j2 = j + 1; j2 <= std::min(m_, j + width_b_); ++j2) {
        if ((i2 == n_) == (j2 == m_)) body(i2, j2);
      }
    }
  }

  const std::vector<ContourKey>& a_;
  const std::vector<ContourKey>& b_;
  int n_;
  int m_;
  int reach_;
  int width_a_ = 0;
  int width_b_ = 0;
  std::vector<double> step_;
  Eigen::MatrixXd pair_;
  mutable Eigen::MatrixXd value_;
  mutable Eigen::MatrixXi from_;
};

}  // namespace

KeyAlignment align_keys(const std::vector<ContourKey>& a, const std::vector<ContourKey>& b,
                        double upright, const RunControl& run) {
  const Aligner aligner(a, b, upright);
  // The alignment may leave out any key, so that several are tried as the start.
  std::vector<int> starts;
  for (int i = 0; i < static_cast<int>(a.size()); ++i) starts.push_back(i);
  std::stable_sort(starts.begin(), starts.end(), [&](int i, int k) {
    return a[static_cast<std::size_t>(i)].prominence > a[static_cast<std::size_t>(k)].prominence;
  });
  starts.resize(std::min<std::size_t>(starts.size(), 4));
  KeyAlignment result;
  double best = kNever;
  int best_start = starts.front();
  std::vector<KeyPair> path;
  for (const int i0 : starts) {
    for (int j0 = 0; j0 < static_cast<int>(b.size()) && !run.cancelled(); ++j0) {
      const double score = aligner.best_through(i0, j0, path);
      if (score > best) {
        best = score;
        best_start = i0;
        result.pairs = path;
      }
    }
  }
  result.cost = -best / static_cast<double>(std::max(a.size(), b.size()));
  const Eigen::MatrixXd posterior = aligner.posteriors(best_start, run);
  for (KeyPair& pair : result.pairs) pair.posterior = std::min(1.0, posterior(pair.a, pair.b));
  return result;
}

}  // namespace dupin::detail
