#include "dupin/spatial/neighborhoods.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Row = std::vector<std::pair<double, std::int32_t>>;  // squared distance, index

// What a search visited: a row for each query, in the order of the visit, and how often it came.
struct Visited {
  std::vector<Row> rows;
  std::vector<int> times;

  explicit Visited(Index num_queries)
      : rows(static_cast<size_t>(num_queries)), times(static_cast<size_t>(num_queries), 0) {}

  std::function<NeighborVisitor()> recorder() {
    return [this] {
      return [this](Index query, std::span<const std::int32_t> index,
                    std::span<const double> squared) {
        const auto q = static_cast<size_t>(query);
        ++times[q];
        for (size_t j = 0; j < index.size(); ++j) rows[q].emplace_back(squared[j], index[j]);
      };
    };
  }
};

Visited nearest(const NeighborSearch& search, const Points& queries, int k) {
  Visited visited(queries.rows());
  search.visit_nearest(queries, k, visited.recorder());
  return visited;
}

Row all_distances(const Points& points, const Eigen::RowVector3d& q) {
  Row row;
  for (Index v = 0; v < points.rows(); ++v) {
    const double dx = points(v, 0) - q(0);
    const double dy = points(v, 1) - q(1);
    const double dz = points(v, 2) - q(2);
    row.emplace_back(dx * dx + dy * dy + dz * dz, static_cast<std::int32_t>(v));
  }
  return row;
}

// The definition: sort all points by distance, then index, and take k.
void expect_brute_force(const Points& points, const Points& queries, const std::vector<int>& ks) {
  const NeighborSearch search(points);
  for (const int k : ks) {
    SCOPED_TRACE("k = " + std::to_string(k));
    Visited actual = nearest(search, queries, k);
    for (Index q = 0; q < queries.rows(); ++q) {
      Row expected = all_distances(points, queries.row(q));
      std::sort(expected.begin(), expected.end());
      expected.resize(static_cast<size_t>(k));
      Row& row = actual.rows[static_cast<size_t>(q)];
      std::sort(row.begin(), row.end());
      ASSERT_EQ(actual.times[static_cast<size_t>(q)], 1) << "query " << q;
      ASSERT_EQ(row, expected) << "query " << q;
    }
  }
}

void expect_brute_force_within(const Points& points, const Points& queries, double radius) {
  SCOPED_TRACE("radius = " + std::to_string(radius));
  Visited actual(queries.rows());
  NeighborSearch(points).visit_within(queries, radius, actual.recorder());
  for (Index q = 0; q < queries.rows(); ++q) {
    Row expected = all_distances(points, queries.row(q));
    std::erase_if(expected, [&](const auto& n) { return n.first > radius * radius; });
    std::sort(expected.begin(), expected.end());
    Row& row = actual.rows[static_cast<size_t>(q)];
    std::sort(row.begin(), row.end());
    ASSERT_EQ(actual.times[static_cast<size_t>(q)], 1) << "query " << q;
    ASSERT_EQ(row, expected) << "query " << q;
  }
}

Points random_cube(Index count, double low, double high, std::uint64_t seed) {
  Rng rng(seed);
  Points points(count, 3);
  for (Index i = 0; i < points.size(); ++i) points.data()[i] = rng.uniform(low, high);
  return points;
}

Points stacked(const Points& a, const Points& b) {
  Points points(a.rows() + b.rows(), 3);
  points << a, b;
  return points;
}

Points line(Index count) {
  Rng rng(5);
  Points points(count, 3);
  for (Index v = 0; v < count; ++v) points.row(v) << 1.0, -2.0, 0.5;
  for (Index v = 0; v < count; ++v) points.row(v) *= rng.uniform();
  return points;
}

// n^3 integer points in a shuffled order: most distances tie.
Points lattice(int n) {
  Points points(n * n * n, 3);
  for (Index v = 0; v < points.rows(); ++v) {
    points.row(v) << static_cast<double>(v % n), static_cast<double>(v / n % n),
        static_cast<double>(v / n / n);
  }
  Rng rng(9);
  for (Index v = points.rows() - 1; v > 0; --v) {
    const auto other = static_cast<Index>(rng.below(static_cast<std::uint64_t>(v) + 1));
    points.row(v).swap(points.row(other));
  }
  return points;
}

// Half of the points in a cube of 1e-6, half in one of 1.
Points uneven(Index count) {
  return stacked(random_cube(count / 2, 0.4, 0.4 + 1e-6, 21),
                 random_cube(count - count / 2, 0.0, 1.0, 22));
}

std::vector<int> some_k(Index num_points) {
  std::vector<int> ks;
  for (const int k : {1, 2, 3, 7, 20, 100, 250}) {
    if (k < num_points) ks.push_back(k);
  }
  ks.push_back(static_cast<int>(num_points));
  return ks;
}

TEST(NeighborSearch, AgreesWithSortingAllPointsInACube) {
  const Points points = random_cube(600, -1.0, 1.0, 1);
  expect_brute_force(points, points, some_k(600));
}

TEST(NeighborSearch, AgreesWithSortingAllPointsOnASurface) {
  const Points points = make_torus(1.0, 0.4, 1500).mesh.points;
  expect_brute_force(points, points, {1, 6, 20, 100, 400});
}

// Every k of a small cloud, so that every size of leaf, bin and batch boundary comes up.
TEST(NeighborSearch, AgreesWithSortingForEveryCountOfNeighbours) {
  for (const Index count : {1, 2, 3, 16, 17, 40}) {
    SCOPED_TRACE(count);
    const Points points = random_cube(count, 0.0, 1.0, static_cast<std::uint64_t>(count));
    std::vector<int> ks;
    for (int k = 1; k <= count; ++k) ks.push_back(k);
    expect_brute_force(points, points, ks);
  }
}

// The queries need not be points: inside, at the edge of and far outside the cloud.
TEST(NeighborSearch, FindsTheNeighboursOfQueriesFarOutside) {
  const Points points = make_sphere(1.0, 800).mesh.points;
  expect_brute_force(points, random_cube(150, -2.0, 2.0, 3), {1, 20, 100, 800});
  expect_brute_force(points, random_cube(150, -1e6, 1e6, 4), {1, 20, 100});
  expect_brute_force(points, random_cube(40, 1e12, 2e12, 4), {1, 20, 100});
  Points center(2, 3);  // where all points of the sphere are equally near but for rounding
  center << 0.0, 0.0, 0.0, 1e-17, 0.0, 0.0;
  expect_brute_force(points, center, {1, 20, 100});
}

TEST(NeighborSearch, IsExactWhereDensityVariesByEighteenDecades) {
  const Points points = uneven(1200);
  expect_brute_force(points, points, {1, 20, 100, 700});
  expect_brute_force(points, random_cube(200, 0.39, 0.41, 8), {1, 20, 100});
}

TEST(NeighborSearch, IsExactOnLinesAndPlanes) {
  expect_brute_force(line(500), line(500), some_k(500));
  Points flat = random_cube(500, -1.0, 1.0, 6);
  flat.col(1).setConstant(3.0);
  expect_brute_force(flat, flat, some_k(500));
}

// Most distances tie: from a point, and from the middles of the lattice.
TEST(NeighborSearch, TakesTheSmallerIndexOfEquallyNearPoints) {
  const Points points = lattice(9);
  expect_brute_force(points, points, {1, 2, 4, 7, 10, 19, 27, 100, 729});
  const Points middles = points.array() + 0.5;
  expect_brute_force(points, middles, {1, 3, 8, 20, 100});
}

// 40 points, each many times over, in any order of index; one place alone; and one place that holds
// half of the cloud.
TEST(NeighborSearch, TakesTheSmallerIndexOfCoincidentPoints) {
  const Points places = random_cube(40, 0.0, 1.0, 11);
  Points points(1000, 3);
  Rng rng(12);
  for (Index v = 0; v < 1000; ++v) points.row(v) = places.row(static_cast<Index>(rng.below(40)));
  expect_brute_force(points, points, {1, 5, 24, 30, 100, 1000});

  const Points one = Points::Constant(300, 3, 0.7);
  expect_brute_force(one, one, {1, 16, 17, 100, 300});

  const Points half = stacked(random_cube(300, 0.0, 1.0, 13), Points::Constant(300, 3, 0.7));
  expect_brute_force(half, half, {1, 20, 100, 299, 400, 600});
}

// Coordinates carry their unit: 1e-9 and 1e9, and squares that reach to the ends of the doubles.
TEST(NeighborSearch, IsExactAtEveryScale) {
  const Points unit = make_torus(1.0, 0.4, 500).mesh.points;
  for (const double scale : {1e-9, 1e9, 1e-140, 1e-155, 1e149}) {
    SCOPED_TRACE(scale);
    const Points points = unit * scale;
    expect_brute_force(points, points, {1, 20, 100, 500});
  }
  // Squares that are subnormal or zero: ties by index, but no neighbour is lost.
  for (const double scale : {1e-160, 3e-161, 1e-161, 3e-162, 1e-162, 1e-170}) {
    SCOPED_TRACE(scale);
    const Points points = unit * scale;
    expect_brute_force(points, points, {1, 20, 100});
  }
  const Points far = (unit * 1e-3).array() + 1e9;  // coordinates 1.2e-7 apart at least
  expect_brute_force(far, far, {1, 20, 100});
}

TEST(NeighborSearch, FindsAllPointsWithinARadius) {
  const Points torus = make_torus(1.0, 0.4, 1500).mesh.points;
  const Points cube = random_cube(300, -2.0, 2.0, 14);
  for (const double radius : {1e-200, 1e-3, 0.1, 0.5, 4.0, 1e200}) {
    expect_brute_force_within(torus, torus.topRows(700), radius);
    expect_brute_force_within(torus, cube, radius);
  }
  // On the lattice sqrt(2) is rounded up and its square exceeds 2; 1 and 2 lie on the sphere.
  for (const double radius : {1.0, std::sqrt(2.0), 2.0}) {
    expect_brute_force_within(lattice(7), lattice(7), radius);
  }
  expect_brute_force_within(uneven(800), uneven(800), 1e-6);
  expect_brute_force_within(Points::Constant(200, 3, 0.7), Points::Constant(60, 3, 0.7), 1e-9);
}

// Large enough for many blocks. The table holds the sets that are visited, nearest first, and a few
// rows of it are those of brute force.
TEST(NeighborSearch, TablesAreSortedAndExactOnAScan) {
  const Points points =
      stacked(make_bumpy_sphere(1.0, 20'000, {60, 0.05, 0.06, 1}).surface.mesh.points,
              random_cube(2000, -1.5, 1.5, 15));
  const NeighborSearch search(points);
  const NeighborTable table = search.nearest(points, 40);
  Visited visited = nearest(search, points, 40);
  ASSERT_EQ(table.index.rows(), points.rows());
  ASSERT_EQ(table.index.cols(), 40);
  for (Index q = 0; q < points.rows(); ++q) {
    Row& row = visited.rows[static_cast<size_t>(q)];
    std::sort(row.begin(), row.end());
    ASSERT_EQ(row.size(), 40U);
    for (Index j = 0; j < 40; ++j) {
      ASSERT_EQ(row[static_cast<size_t>(j)], std::make_pair(table.squared(q, j), table.index(q, j)))
          << "query " << q;
    }
  }
  for (Index q = 0; q < points.rows(); q += 101) {
    Row all = all_distances(points, points.row(q));
    std::partial_sort(all.begin(), all.begin() + 40, all.end());
    for (Index j = 0; j < 40; ++j)
      EXPECT_EQ(all[static_cast<size_t>(j)].second, table.index(q, j)) << "query " << q;
  }
}

TEST(NeighborSearch, ACancelledTableMarksTheRowsItDidNotReach) {
  const Points points = random_cube(500, -1.0, 1.0, 3);
  const RunControl run = RunControl::create();
  run.cancel();
  const NeighborTable table = NeighborSearch(points).nearest(points, 5, run);
  EXPECT_EQ(table.index.maxCoeff(), -1);
  EXPECT_EQ(table.squared.minCoeff(), std::numeric_limits<double>::infinity());
}

// Same sequence, not only the same set: sums over neighbours then have the same bits.
TEST(NeighborSearch, VisitsInTheSameOrderForAnyNumberOfThreads) {
  const Points points = stacked(make_torus(1.0, 0.4, 8000).mesh.points, uneven(4000));
  const Points queries = random_cube(3000, -1.5, 1.5, 16);
  const NeighborSearch search(points);
  std::vector<std::vector<Row>> nearest_rows;
  std::vector<std::vector<Row>> within_rows;
  for (const int threads : {1, 2, 8}) {
    set_thread_count(threads);
    nearest_rows.push_back(nearest(search, points, 30).rows);
    nearest_rows.back().resize(static_cast<size_t>(points.rows() + queries.rows()));
    const Visited apart = nearest(search, queries, 30);
    std::copy(apart.rows.begin(), apart.rows.end(), nearest_rows.back().begin() + points.rows());
    Visited within(queries.rows());
    search.visit_within(queries, 0.2, within.recorder());
    within_rows.push_back(within.rows);
  }
  set_thread_count(0);
  for (size_t t = 1; t < nearest_rows.size(); ++t) {
    EXPECT_EQ(nearest_rows[t], nearest_rows[0]);
    EXPECT_EQ(within_rows[t], within_rows[0]);
  }
}

// Work in proportion to the square of the cloud would be 1e10 distances a cloud and more; the limit
// is ten times and more what is needed.
TEST(NeighborSearch, StaysFastOnCrowdedClouds) {
  constexpr Index kCount = 100'000;
  const auto expect_fast = [&](const char* name, const Points& points, const Points& queries,
                               double radius) {
    SCOPED_TRACE(name);
    const NeighborSearch search(points);
    std::atomic<Index> found{0};
    const auto counter = [&] {
      return
          [&](Index /*query*/, std::span<const std::int32_t> index,
              std::span<const double> /*squared*/) { found += static_cast<Index>(index.size()); };
    };
    const auto start = std::chrono::steady_clock::now();
    search.visit_nearest(queries, 20, counter);
    EXPECT_EQ(found, 20 * queries.rows());
    search.visit_within(queries, radius, counter);
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
              10.0);
  };
  const Points cube = random_cube(kCount, 0.0, 1e-3, 31);
  const Points same = Points::Constant(kCount, 3, 0.3);
  expect_fast("uneven", uneven(kCount), uneven(kCount), 1e-9);
  expect_fast("line", line(kCount), line(kCount), 1e-4);
  expect_fast("far queries", cube, random_cube(kCount, -1e3, 1e3, 32), 1.0);
  expect_fast("one query", cube, same, 0.1);
  expect_fast("one place", same, stacked(same.topRows(100), cube), 0.1);
  // A crowd just beyond the radius of queries that lie together.
  expect_fast("shell", cube, make_sphere(1.0, kCount).mesh.points, 1.0 - 5e-3);
}

TEST(NeighborSearch, RefusesWhatItCannotAnswer) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Points good = random_cube(10, 0.0, 1.0, 17);
  const NeighborSearch search(good);
  const auto never = [] {
    return [](Index, std::span<const std::int32_t>, std::span<const double>) {
      ADD_FAILURE() << "visited before the check";
    };
  };
  for (const double value : {nan, infinity, -infinity, 1.1e150, -1e200}) {
    Points bad = good;
    bad(9, 2) = value;
    EXPECT_THROW(NeighborSearch{bad}, InvalidArgument) << value;
    EXPECT_THROW(search.visit_nearest(bad, 3, never), InvalidArgument) << value;
    EXPECT_THROW(search.visit_within(bad, 1.0, never), InvalidArgument) << value;
  }
  for (const int k : {-1, 0, 11}) {
    EXPECT_THROW(search.visit_nearest(good, k, never), InvalidArgument) << k;
  }
  for (const double radius : {0.0, -1.0, nan, infinity}) {
    EXPECT_THROW(search.visit_within(good, radius, never), InvalidArgument) << radius;
  }
}

TEST(NeighborSearch, AcceptsNoPointsAndNoQueries) {
  const NeighborSearch empty{Points(0, 3)};
  EXPECT_EQ(empty.size(), 0);
  const Points queries = random_cube(5, 0.0, 1.0, 18);
  Visited visited(5);
  EXPECT_THROW(empty.visit_nearest(queries, 1, visited.recorder()), InvalidArgument);
  empty.visit_within(queries, 1.0, visited.recorder());
  for (const int times : visited.times) EXPECT_EQ(times, 1);  // with no neighbours
  for (const Row& row : visited.rows) EXPECT_TRUE(row.empty());

  const NeighborSearch search(queries);
  EXPECT_EQ(search.size(), 5);
  Visited none(0);
  search.visit_nearest(Points(0, 3), 2, none.recorder());
  search.visit_within(Points(0, 3), 2.0, none.recorder());
}

// A thread may finish the batch it is in, at most 32 queries; no more.
TEST(NeighborSearch, StopsVisitingOnceCancelled) {
  const Points points = make_torus(1.0, 0.4, 20'000).mesh.points;
  const NeighborSearch search(points);
  for (const int cancel_after : {0, 1, 1000}) {
    SCOPED_TRACE(cancel_after);
    for (const bool is_radius : {false, true}) {
      const RunControl run = RunControl::create();
      if (cancel_after == 0) run.cancel();
      std::atomic<int> visits{0};
      const auto counter = [&] {
        return [&](Index, std::span<const std::int32_t>, std::span<const double>) {
          if (++visits == cancel_after) run.cancel();
        };
      };
      if (is_radius) {
        search.visit_within(points, 0.1, counter, run);
      } else {
        search.visit_nearest(points, 100, counter, run);
      }
      EXPECT_GE(visits, cancel_after);
      EXPECT_LE(visits, cancel_after == 0 ? 0 : cancel_after + 32 * thread_count());
    }
  }
}

// A visitor of its own for each block: no two calls of one visitor overlap.
TEST(NeighborSearch, GivesEveryBlockAVisitorOfItsOwn) {
  const Points points = make_torus(1.0, 0.4, 20'000).mesh.points;
  std::atomic<int> made{0};
  std::atomic<int> overlaps{0};
  std::atomic<Index> visits{0};
  set_thread_count(4);
  NeighborSearch(points).visit_nearest(points, 10, [&] {
    ++made;
    return [&, busy = std::make_shared<std::atomic<bool>>(false)](
               Index, std::span<const std::int32_t>, std::span<const double>) {
      if (busy->exchange(true)) ++overlaps;
      ++visits;
      busy->store(false);
    };
  });
  set_thread_count(0);
  EXPECT_GE(made, 1);
  EXPECT_EQ(overlaps, 0);
  EXPECT_EQ(visits, points.rows());
}

}  // namespace
}  // namespace dupin
