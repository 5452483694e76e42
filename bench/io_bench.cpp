// Reading a surface of a million vertices from the page cache, one thread, all checks on, beside
// the readers of others. Each run checks the counts that it read: a fast failure is not fast.
//
// io_bench --benchmark_repetitions=5 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"

#ifdef DUPIN_PEER_PCL
#include <pcl/PolygonMesh.h>
#include <pcl/io/ply_io.h>
#endif
#ifdef DUPIN_PEER_ASSIMP
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#endif
#ifdef DUPIN_PEER_TINYOBJ
#include <tiny_obj_loader.h>
#endif

namespace {

constexpr int kSide = 1000;
constexpr std::int64_t kVertices = std::int64_t{kSide} * kSide;
constexpr std::int64_t kFaces = 2 * kVertices;

// A bumpy torus in single precision, as scanners and modellers write it, in a folder of its own.
class Files {
 public:
  Files() {
    std::string pattern = (std::filesystem::temp_directory_path() / "dupin-bench-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    make_surface();
    write_binary_ply();
    write_text("a.ply", ply_header("ascii"), "", "3 ", 0);
    write_text("a.obj", "", "v ", "f ", 1);
  }
  Files(const Files&) = delete;
  Files& operator=(const Files&) = delete;
  ~Files() { std::filesystem::remove_all(folder_); }
  std::string binary_ply() const { return folder_ + "/b.ply"; }
  std::string ascii_ply() const { return folder_ + "/a.ply"; }
  std::string obj() const { return folder_ + "/a.obj"; }

 private:
  void make_surface() {
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const double u = 2.0 * M_PI * i / kSide;
        const double v = 2.0 * M_PI * j / kSide;
        const double r = 0.4 + 0.02 * std::sin(9.0 * u) * std::cos(7.0 * v);
        const double ring = 1.0 + r * std::cos(v);
        for (const double x : {ring * std::cos(u), ring * std::sin(u), r * std::sin(v)}) {
          points_.push_back(static_cast<float>(x));
        }
        const std::int32_t a = i * kSide + j;
        const std::int32_t b = i * kSide + (j + 1) % kSide;
        const std::int32_t c = (i + 1) % kSide * kSide + j;
        const std::int32_t d = (i + 1) % kSide * kSide + (j + 1) % kSide;
        for (const std::int32_t index : {a, c, d, a, d, b}) indices_.push_back(index);
      }
    }
  }

  static std::string ply_header(const std::string& encoding) {
    return "ply\nformat " + encoding + " 1.0\nelement vertex " + std::to_string(kVertices) +
           "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
           std::to_string(kFaces) + "\nproperty list uchar int vertex_indices\nend_header\n";
  }

  void write_binary_ply() const {
    std::string bytes = ply_header("binary_little_endian");
    bytes.append(reinterpret_cast<const char*>(points_.data()), points_.size() * sizeof(float));
    for (std::size_t i = 0; i < indices_.size(); i += 3) {
      bytes.push_back(3);
      bytes.append(reinterpret_cast<const char*>(&indices_[i]), 3 * sizeof(std::int32_t));
    }
    dupin::write_file_atomically(binary_ply(), bytes);
  }

  void write_text(const char* name, std::string text, const char* point, const char* face,
                  int base) const {
    char digits[32];
    const auto put = [&](auto value, char end) {
      text.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
      text.push_back(end);
    };
    for (std::size_t i = 0; i < points_.size(); i += 3) {
      text += point;
      for (std::size_t axis = 0; axis < 3; ++axis) put(points_[i + axis], axis < 2 ? ' ' : '\n');
    }
    for (std::size_t i = 0; i < indices_.size(); i += 3) {
      text += face;
      for (std::size_t k = 0; k < 3; ++k) put(indices_[i + k] + base, k < 2 ? ' ' : '\n');
    }
    dupin::write_file_atomically(folder_ + "/" + name, text);
  }

  std::string folder_;
  std::vector<float> points_;
  std::vector<std::int32_t> indices_;
};

const Files& files() {
  static const Files made;
  return made;
}

template <class Read>
void run(benchmark::State& state, const std::string& path, Read read) {
  for (auto _ : state) {
    if (!read(path)) state.SkipWithError("not what was written");
  }
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(std::filesystem::file_size(path)));
}

bool read_dupin(const std::string& path) {
  const dupin::SurfaceFile file = dupin::read_surface(path);
  return file.mesh.points.rows() == kVertices && file.mesh.num_faces() == kFaces;
}

void BM_DupinBinaryPly(benchmark::State& s) { run(s, files().binary_ply(), read_dupin); }
void BM_DupinAsciiPly(benchmark::State& s) { run(s, files().ascii_ply(), read_dupin); }
void BM_DupinObj(benchmark::State& s) { run(s, files().obj(), read_dupin); }
BENCHMARK(BM_DupinBinaryPly)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_DupinAsciiPly)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_DupinObj)->Unit(benchmark::kMillisecond);

#ifdef DUPIN_PEER_PCL
bool read_pcl(const std::string& path) {
  pcl::PolygonMesh mesh;
  return pcl::io::loadPLYFile(path, mesh) == 0 &&
         static_cast<std::int64_t>(mesh.cloud.width) * mesh.cloud.height == kVertices &&
         static_cast<std::int64_t>(mesh.polygons.size()) == kFaces;
}
void BM_PclBinaryPly(benchmark::State& s) { run(s, files().binary_ply(), read_pcl); }
void BM_PclAsciiPly(benchmark::State& s) { run(s, files().ascii_ply(), read_pcl); }
BENCHMARK(BM_PclBinaryPly)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_PclAsciiPly)->Unit(benchmark::kMillisecond);
#endif

#ifdef DUPIN_PEER_ASSIMP
bool read_assimp(const std::string& path) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(path, 0);
  return scene != nullptr && scene->mNumMeshes == 1 && scene->mMeshes[0]->mNumFaces == kFaces;
}
void BM_AssimpBinaryPly(benchmark::State& s) { run(s, files().binary_ply(), read_assimp); }
void BM_AssimpAsciiPly(benchmark::State& s) { run(s, files().ascii_ply(), read_assimp); }
void BM_AssimpObj(benchmark::State& s) { run(s, files().obj(), read_assimp); }
BENCHMARK(BM_AssimpBinaryPly)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_AssimpAsciiPly)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_AssimpObj)->Unit(benchmark::kMillisecond);
#endif

#ifdef DUPIN_PEER_TINYOBJ
bool read_tinyobj(const std::string& path) {
  tinyobj::ObjReaderConfig config;
  config.triangulate = false;
  tinyobj::ObjReader reader;
  return reader.ParseFromFile(path, config) &&
         static_cast<std::int64_t>(reader.GetAttrib().vertices.size()) == 3 * kVertices &&
         static_cast<std::int64_t>(reader.GetShapes()[0].mesh.indices.size()) == 3 * kFaces;
}
void BM_TinyobjObj(benchmark::State& s) { run(s, files().obj(), read_tinyobj); }
BENCHMARK(BM_TinyobjObj)->Unit(benchmark::kMillisecond);
#endif

}  // namespace
