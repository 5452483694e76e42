// The scale-space stack of 35 levels beside one conjugate-gradient solve a level with Eigen, the
// best ordinary way that was measured (warm start, symmetric form, Jacobi, 1e-8). Signal: Taubin's
// H on a torus with 20 % isotropic noise. Only the levels are asked for, as the peer makes only
// those; the operator and the peer's matrix pattern are set up outside the timed part and their
// cost stands in setup_ms.
//
// Counters: err = worst level of ||F - F_ref|| / ||F_ref||. F_ref is reference_scale_space() at
// 1e-13 up to 113K vertices; beyond, where that takes minutes, it is compute_scale_space() at
// 1e-12 (so there err cannot show a common fault of both, the smaller sizes do).
// B_per_V = peak of the resident memory that operator and stack take, measured in a fork.
//
// On two threads the peer's figure is the better of its runs on one and on two: its OpenMP barriers
// spin, and beside another process two threads are slower than one (OMP_WAIT_POLICY=passive helps).
//
// stack_bench                          all sizes, 7 minutes on a quiet machine
// stack_bench --benchmark_filter=112K  one size; shuffled/ is the case of scrambled vertices
#include <benchmark/benchmark.h>
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/Sparse>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/scalespace/pcg_reference.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/curvature.h"

namespace {

using dupin::LevelMatrix;
using Eigen::Index;
using Eigen::VectorXd;

constexpr double kTolerance = 1e-8;

struct Case {
  std::string name;
  Index num_vertices;
  bool is_shuffled;
  int iterations;   // of one measurement
  int repetitions;  // the median of so many measurements is reported
  bool has_independent_reference;
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"10K", 10'000, false, 10, 5, true},   {"40K", 40'000, false, 3, 5, true},
      {"112K", 112'500, false, 1, 5, true},  {"shuffled/112K", 112'500, true, 1, 5, true},
      {"450K", 450'000, false, 1, 3, false}, {"1M", 1'000'000, false, 1, 3, false},
  };
  return all;
}

enum class Method { ours_double, ours_single, eigen };
constexpr std::pair<Method, const char*> kMethods[] = {
    {Method::ours_double, "double"}, {Method::ours_single, "float"}, {Method::eigen, "eigen"}};

std::string benchmark_name(const std::string& method, const std::string& size, int threads) {
  return method + "/" + size + "/" + std::to_string(threads) + "T";
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

dupin::Mesh shuffled(const dupin::Mesh& mesh) {
  std::vector<std::int32_t> place(static_cast<std::size_t>(mesh.points.rows()));
  std::iota(place.begin(), place.end(), 0);
  dupin::Rng rng(7);
  for (std::size_t i = place.size(); i > 1; --i) std::swap(place[i - 1], place[rng.below(i)]);
  dupin::Mesh result = mesh;
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    result.points.row(place[static_cast<std::size_t>(v)]) = mesh.points.row(v);
  }
  result.triangles =
      mesh.triangles.unaryExpr([&](std::int32_t v) { return place[static_cast<std::size_t>(v)]; });
  return result;
}

// The peer. With y = D^1/2 F the step (I + lambda (I - D^-1 A)) F' = F is symmetric:
// ((1 + lambda) I - lambda D^-1/2 A D^-1/2) y' = y. The pattern is made once, the values are filled
// in for every level. Row-major, because Eigen runs that product in parallel.
class EigenStack {
 public:
  explicit EigenStack(const dupin::Adjacency& ring)
      : root_(ring.num_vertices()), matrix_(ring.num_vertices(), ring.num_vertices()) {
    Eigen::VectorXi row_size(ring.num_vertices());
    for (Index v = 0; v < ring.num_vertices(); ++v) {
      root_[v] = std::sqrt(static_cast<double>(ring.valence(v)));
      row_size[v] = ring.valence(v) + 1;
    }
    matrix_.reserve(row_size);
    for (Index v = 0; v < ring.num_vertices(); ++v) {
      matrix_.insert(v, v) = 0.0;
      for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        matrix_.insert(v, *j) = 0.0;
      }
    }
    matrix_.makeCompressed();
  }

  LevelMatrix solve(const VectorXd& signal, double tolerance) {
    const VectorXd steps = dupin::time_steps({});
    LevelMatrix levels(steps.size() + 1, signal.size());
    levels.row(0) = signal;
    VectorXd y = root_.cwiseProduct(signal);
    Eigen::ConjugateGradient<Matrix, Eigen::Lower | Eigen::Upper> solver;
    solver.setTolerance(tolerance);
    iterations_ = 0;
    for (Index l = 0; l < steps.size(); ++l) {
      fill(steps[l]);
      solver.compute(matrix_);
      y = solver.solveWithGuess(y, y).eval();
      iterations_ += solver.iterations();
      levels.row(l + 1) = y.cwiseQuotient(root_);
    }
    return levels;
  }

  Index iterations() const { return iterations_; }

 private:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  void fill(double lambda) {
    for (Index v = 0; v < matrix_.rows(); ++v) {
      const double factor = -lambda / root_[v];
      for (Matrix::InnerIterator entry(matrix_, v); entry; ++entry) {
        entry.valueRef() = entry.col() == v ? 1.0 + lambda : factor / root_[entry.col()];
      }
    }
  }

  VectorXd root_;
  Matrix matrix_;
  Index iterations_ = 0;
};

dupin::ScaleSpaceOptions stack_options(double tolerance) {
  dupin::ScaleSpaceOptions options;
  options.tolerance = tolerance;
  options.want_loc = false;
  return options;
}

// One size. Only the last one asked for is kept: a million vertices take 600 MB with the reference.
class Problem {
 public:
  explicit Problem(const Case& size) : size_(&size) {
    dupin::NoiseOptions noise;
    noise.percent = 20.0;
    noise.model = dupin::NoiseModel::isotropic;
    noise.seed = 1;
    dupin::Mesh mesh =
        dupin::add_noise(dupin::make_torus(1.0, 0.4, size.num_vertices).mesh, noise).mesh;
    if (size.is_shuffled) mesh = shuffled(mesh);
    topology = dupin::compute_topology(mesh.triangles, mesh.points.rows());
    signal = dupin::estimate_curvature_taubin(mesh, topology).mean();
  }

  static Problem& of(const Case& size) {
    static std::unique_ptr<Problem> last;
    if (!last || last->size_ != &size) {
      last.reset();
      last = std::make_unique<Problem>(size);
    }
    return *last;
  }

  dupin::DiffusionOperator make_operator() const {
    return dupin::umbrella_operator(topology.ring, &topology);
  }

  template <class Matrix>
  double error(const Matrix& levels) {
    if (reference_.size() == 0) make_reference();
    double worst = 0.0;
    for (Index l = 0; l < levels.rows(); ++l) {
      const double difference = (levels.row(l).template cast<double>() - reference_.row(l)).norm();
      worst = std::max(worst, difference / reference_.row(l).norm());
    }
    return worst;
  }

  dupin::MeshTopology topology;
  VectorXd signal;
  std::map<Method, double> bytes_per_vertex;  // measured once each

 private:
  void make_reference() {
    const dupin::DiffusionOperator op = make_operator();
    reference_ =
        size_->has_independent_reference
            ? dupin::reference_scale_space(op, signal, dupin::LevelSchedule{}, 1e-13).levels
            : dupin::compute_scale_space(op, signal, stack_options(1e-12)).levels;
  }

  const Case* size_;
  LevelMatrix reference_;
};

double status_bytes(const char* field) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0.0;
    if (word == field && status >> kilobytes) return 1024.0 * kilobytes;
  }
  return 0.0;
}

// Peak of the resident memory that `work` adds, on one thread in a process of its own: a fork
// starts with the peak at what it has. Large blocks are mapped, so that none is one that was free.
template <class Work>
double peak_bytes(Work work) {
  dupin::set_thread_count(1);
  Eigen::setNbThreads(1);
  malloc_trim(0);
  int ends[2];
  if (pipe(ends) != 0) return 0.0;
  const pid_t child = fork();
  if (child == 0) {
    mallopt(M_MMAP_THRESHOLD, 128 * 1024);
    const double before = status_bytes("VmRSS:");
    work();
    const double grown = status_bytes("VmHWM:") - before;
    _exit(write(ends[1], &grown, sizeof(grown)) == sizeof(grown) ? 0 : 1);
  }
  close(ends[1]);
  double grown = 0.0;
  if (child < 0 || read(ends[0], &grown, sizeof(grown)) != sizeof(grown)) grown = 0.0;
  close(ends[0]);
  if (child > 0) waitpid(child, nullptr, 0);
  return grown;
}

double measure_memory(Problem& problem, Method method) {
  const auto found = problem.bytes_per_vertex.find(method);
  if (found != problem.bytes_per_vertex.end()) return found->second;
  const double bytes = peak_bytes([&] {
    if (method == Method::eigen) {
      // A loose tolerance takes the same memory and little time.
      EigenStack(problem.topology.ring).solve(problem.signal, 0.5);
    } else if (method == Method::ours_double) {
      dupin::compute_scale_space(problem.make_operator(), problem.signal,
                                 stack_options(kTolerance));
    } else {
      dupin::compute_scale_space_single(problem.make_operator(), problem.signal,
                                        stack_options(kTolerance));
    }
  });
  return problem.bytes_per_vertex[method] = bytes / static_cast<double>(problem.signal.size());
}

// Times solve(), checks its answer against `limit` (a fast failure is not fast), writes the
// counters. The memory is measured first, on one thread.
template <class Setup, class Solve>
void measure(benchmark::State& state, const Case& size, Method method, int threads, double limit,
             Setup setup, Solve solve) {
  Problem& problem = Problem::of(size);
  state.counters["B_per_V"] = measure_memory(problem, method);
  dupin::set_thread_count(threads);
  Eigen::setNbThreads(threads);
  const auto start = std::chrono::steady_clock::now();
  auto prepared = setup(problem);
  state.counters["setup_ms"] = 1e3 * seconds_since(start);
  decltype(solve(prepared, problem)) levels;
  for (auto _ : state) {
    levels = solve(prepared, problem);
    benchmark::DoNotOptimize(levels.data());
  }
  const double error = problem.error(levels);
  if (!(error <= limit)) state.SkipWithError("the levels are wrong");
  state.counters["err"] = error;
  state.counters["V"] = static_cast<double>(problem.signal.size());
  state.SetItemsProcessed(state.iterations() * problem.signal.size());
}

void run(benchmark::State& state, const Case& size, Method method, int threads) {
  const auto make_operator = [](const Problem& problem) { return problem.make_operator(); };
  switch (method) {
    case Method::ours_double:
      measure(
          state, size, method, threads, 1e-6, make_operator,
          [](const dupin::DiffusionOperator& op, const Problem& problem) {
            return dupin::compute_scale_space(op, problem.signal, stack_options(kTolerance)).levels;
          });
      break;
    case Method::ours_single:
      measure(state, size, method, threads, 1e-3, make_operator,
              [](const dupin::DiffusionOperator& op, const Problem& problem) {
                return dupin::compute_scale_space_single(op, problem.signal,
                                                         stack_options(kTolerance))
                    .levels;
              });
      break;
    case Method::eigen: {
      Index iterations = 0;
      measure(
          state, size, method, threads, 1e-6,
          [](const Problem& problem) { return EigenStack(problem.topology.ring); },
          [&](EigenStack& stack, const Problem& problem) {
            LevelMatrix levels = stack.solve(problem.signal, kTolerance);
            iterations = stack.iterations();
            return levels;
          });
      state.counters["cg_its"] = static_cast<double>(iterations);
      break;
    }
  }
}

// The medians on the console, and all of them in the table at the end.
class Medians : public benchmark::ConsoleReporter {
 public:
  Medians() : ConsoleReporter(isatty(STDOUT_FILENO) != 0 ? OO_ColorTabular : OO_Tabular) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    std::vector<Run> shown;
    for (const Run& one : runs) {
      if (one.error_occurred || one.aggregate_name == "median") shown.push_back(one);
      if (one.aggregate_name == "median" && !one.error_occurred) {
        const auto counter = [&](const char* name) {
          const auto found = one.counters.find(name);
          return found == one.counters.end() ? 0.0 : found->second.value;
        };
        rows_[one.run_name.function_name] = {1e-3 * one.GetAdjustedRealTime(),
                                             1e-3 * counter("setup_ms"), counter("err"),
                                             counter("B_per_V")};
      }
    }
    if (!shown.empty()) ConsoleReporter::ReportRuns(shown);
  }

  void print() const {
    if (rows_.empty()) return;
    std::printf(
        "\nMedians of this run: seconds, and how many times faster than Eigen's conjugate "
        "gradients (2T: than the better of its 1T and 2T)\n\n"
        "| vertices | Eigen 1T s | double 1T s | ratio | with setup | float 1T s | ratio | "
        "Eigen 2T s | double 2T s | ratio | float 2T s | ratio | err Eigen / double / float | "
        "B/vertex Eigen / double / float |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (const Case& size : cases()) print_row(size.name);
  }

 private:
  struct Row {
    double seconds = 0.0;
    double setup = 0.0;
    double error = 0.0;
    double bytes = 0.0;
  };

  Row row(const char* method, const std::string& size, int threads) const {
    const auto found = rows_.find(benchmark_name(method, size, threads));
    return found == rows_.end() ? Row{} : found->second;
  }

  static std::string number(const char* format, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) return "-";
    char text[32];
    std::snprintf(text, sizeof(text), format, value);
    return text;
  }

  static std::string ratio(double peer, double own) {
    return peer > 0.0 && own > 0.0 ? number("%.1f", peer / own) : "-";
  }

  static void cell(const std::string& text) { std::printf(" %s |", text.c_str()); }

  void print_row(const std::string& size) const {
    const Row eigen = row("eigen", size, 1);
    const Row twice = row("double", size, 1);
    const Row once = row("float", size, 1);
    if (eigen.seconds + twice.seconds + once.seconds == 0.0 &&
        row("double", size, 2).seconds == 0.0) {
      return;  // filtered out
    }
    std::printf("|");
    cell(size);
    cell(number("%.3f", eigen.seconds));
    cell(number("%.4f", twice.seconds));
    cell(ratio(eigen.seconds, twice.seconds));
    cell(ratio(eigen.seconds > 0.0 ? eigen.seconds + eigen.setup : 0.0,
               twice.seconds > 0.0 ? twice.seconds + twice.setup : 0.0));
    cell(number("%.4f", once.seconds));
    cell(ratio(eigen.seconds, once.seconds));
    const double eigen2 = row("eigen", size, 2).seconds;
    cell(number("%.3f", eigen2));
    for (const char* method : {"double", "float"}) {
      const double own = row(method, size, 2).seconds;
      cell(number("%.4f", own));
      cell(ratio(eigen2 > 0.0 && eigen.seconds > 0.0 ? std::min(eigen.seconds, eigen2) : eigen2,
                 own));
    }
    cell(number("%.1e", eigen.error) + " / " + number("%.1e", twice.error) + " / " +
         number("%.1e", once.error));
    cell(number("%.0f", eigen.bytes) + " / " + number("%.0f", twice.bytes) + " / " +
         number("%.0f", once.bytes));
    std::printf("\n");
  }

  std::map<std::string, Row> rows_;
};

void register_all() {
  for (const Case& size : cases()) {
    for (const int threads : {1, 2}) {
      for (const auto& [method, name] : kMethods) {
        benchmark::RegisterBenchmark(benchmark_name(name, size.name, threads).c_str(),
                                     [&size, which = method, threads](benchmark::State& state) {
                                       run(state, size, which, threads);
                                     })
            ->Unit(benchmark::kMillisecond)
            ->UseRealTime()
            ->MeasureProcessCPUTime()
            ->Iterations(size.iterations)
            ->Repetitions(size.repetitions)
            ->DisplayAggregatesOnly(true);
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  register_all();
  Medians medians;
  benchmark::RunSpecifiedBenchmarks(&medians);
  medians.print();
  benchmark::Shutdown();
}
