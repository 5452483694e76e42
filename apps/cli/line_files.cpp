#include "line_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <sstream>
#include <string_view>

#include "dupin/base/error.h"
#include "dupin/io/file.h"

namespace dupin::cli {
namespace {

// Number at the start of `word`, of which `rest` is what follows; false if there is none.
template <class Number>
bool starts_with_number(std::string_view word, Number& value, std::string_view& rest) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc()) return false;
  rest = word.substr(static_cast<std::size_t>(end - word.data()));
  return true;
}

// The "v" and "l" lines of an OBJ file; whatever else it holds is no line. A corner is a vertex, or
// vertex/texture, whose second part is ignored.
class LineReader {
 public:
  LineReader(const std::string& path, double width) : path_(path), width_(width) {}

  void read(const std::string& text) {
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) {
      ++number_;
      std::istringstream words(line);
      std::string word;
      words >> word;
      if (word == "g") words >> group_;
      if (word == "v") add_point(words);
      if (word == "l") add_polyline(words);
    }
  }
  std::vector<ScenePolyline> take() { return std::move(lines_); }

 private:
  [[noreturn]] void fail(const char* code, const std::string& message) const {
    throw IoError(Errc::malformed, code, message, {path_, number_, -1});
  }

  void add_point(std::istringstream& words) {
    Eigen::RowVector3d p;
    for (Eigen::Index k = 0; k < 3; ++k) {
      std::string word;
      std::string_view rest;
      if (!(words >> word) || !starts_with_number(word, p[k], rest) || !rest.empty() ||
          !std::isfinite(p[k])) {
        fail("E_SYNTAX", "a vertex needs three numbers");
      }
    }
    points_.push_back(p);
  }

  std::size_t corner(const std::string& word) const {
    std::int64_t given = 0;
    std::int64_t texture = 0;
    std::string_view rest;
    if (!starts_with_number(word, given, rest) ||
        (!rest.empty() && (rest.front() != '/' ||
                           !starts_with_number(rest.substr(1), texture, rest) || !rest.empty()))) {
      fail("E_SYNTAX", "\"" + escaped(word, 40) + "\" is no corner of a line");
    }
    const auto count = static_cast<std::int64_t>(points_.size());
    const std::int64_t index = given < 0 ? count + given : given - 1;
    if (index < 0 || index >= count)
      fail("E_INDEX_RANGE", fmt::format("a line uses vertex {} of {}", given, count));
    return static_cast<std::size_t>(index);
  }

  void add_polyline(std::istringstream& words) {
    std::vector<std::size_t> index;
    for (std::string word; words >> word;) index.push_back(corner(word));
    if (index.size() < 2) fail("E_SYNTAX", "a line needs two vertices or more");
    ScenePolyline polyline;
    polyline.points.resize(static_cast<Eigen::Index>(index.size()), 3);
    for (std::size_t k = 0; k < index.size(); ++k)
      polyline.points.row(static_cast<Eigen::Index>(k)) = points_[index[k]];
    polyline.thickness_px = Eigen::VectorXd::Constant(1, width_);
    if (group_ == "ridge") polyline.color = crest_color(CrestKind::ridge);
    if (group_ == "valley") polyline.color = crest_color(CrestKind::valley);
    lines_.push_back(polyline);
  }

  std::string path_;
  double width_;
  std::string group_;
  std::int64_t number_ = 0;
  std::vector<Eigen::RowVector3d> points_;
  std::vector<ScenePolyline> lines_;
};

// The elements `vertex` and `edge` of an ascii PLY file: lines end where edges do not go on.
class PlyLineReader {
 public:
  PlyLineReader(const std::string& path, double width) : path_(path), width_(width) {}

  std::vector<ScenePolyline> read(const std::string& text) {
    std::istringstream in(text);
    std::string line;
    for (;;) {
      next(in, line);
      std::istringstream words(line);
      std::string word;
      words >> word;
      if (word == "format") {
        words >> word;
        if (word != "ascii") fail("the lines are no ascii PLY, as dupin crest writes it");
      }
      if (word == "element") {
        Element element;
        words >> element.name;
        if (!(words >> element.count) || element.count < 0) fail("an element needs a count");
        elements_.push_back(element);
      }
      if (word == "property" && !elements_.empty()) {
        std::string type;
        std::string name;
        words >> type >> name;
        if (type == "list") fail("a list is no property of a line");
        elements_.back().properties.push_back(name);
      }
      if (word == "end_header") break;
    }
    for (const Element& element : elements_) read_rows(in, element);
    return lines();
  }

 private:
  struct Element {
    std::string name;
    std::int64_t count = 0;
    std::vector<std::string> properties;
  };

  [[noreturn]] void fail(const std::string& message) const {
    throw IoError(Errc::malformed, "E_SYNTAX", message, {path_, number_, -1});
  }

  void next(std::istringstream& in, std::string& line) {
    ++number_;
    if (!std::getline(in, line)) fail("the file ends here");
  }

  void read_rows(std::istringstream& in, const Element& element) {
    std::string line;
    for (std::int64_t i = 0; i < element.count; ++i) {
      next(in, line);
      std::istringstream words(line);
      std::map<std::string, double> row;
      for (const std::string& name : element.properties) {
        std::string word;
        double value = 0.0;
        std::string_view rest;
        if (!(words >> word) || !starts_with_number(word, value, rest) || !rest.empty() ||
            !std::isfinite(value))
          fail("the property " + escaped(name, 40) + " needs a number");
        row[name] = value;
      }
      if (element.name == "vertex") add_vertex(row);
      if (element.name == "edge") add_edge(row);
    }
  }

  void add_vertex(const std::map<std::string, double>& row) {
    if (row.count("x") + row.count("y") + row.count("z") < 3) fail("a vertex needs x, y and z");
    points_.emplace_back(row.at("x"), row.at("y"), row.at("z"));
    const auto scale = row.find("scale");
    const auto kind = row.find("kind");
    scales_.push_back(scale == row.end() ? -1.0 : scale->second);
    kinds_.push_back(kind == row.end() ? -1.0 : kind->second);
  }

  std::size_t end_of(const std::map<std::string, double>& row, const char* name) const {
    const auto found = row.find(name);
    if (found == row.end()) fail("an edge needs vertex1 and vertex2");
    const double index = found->second;
    if (!(index >= 0.0 && index < static_cast<double>(points_.size())) ||
        index != std::floor(index)) {
      throw IoError(Errc::malformed, "E_INDEX_RANGE",
                    fmt::format("a line uses vertex {} of {}", index, points_.size()),
                    {path_, number_, -1});
    }
    return static_cast<std::size_t>(index);
  }

  void add_edge(const std::map<std::string, double>& row) {
    const std::size_t from = end_of(row, "vertex1");
    const std::size_t to = end_of(row, "vertex2");
    if (chains_.empty() || chains_.back().back() != from) chains_.push_back({from});
    chains_.back().push_back(to);
  }

  std::vector<ScenePolyline> lines() const {
    std::vector<ScenePolyline> out;
    std::vector<std::vector<double>> scales;
    for (const std::vector<std::size_t>& chain : chains_) {
      ScenePolyline polyline;
      polyline.points.resize(static_cast<Eigen::Index>(chain.size()), 3);
      scales.emplace_back();
      for (std::size_t k = 0; k < chain.size(); ++k) {
        polyline.points.row(static_cast<Eigen::Index>(k)) = points_[chain[k]];
        scales.back().push_back(scales_[chain[k]]);
      }
      const double kind = kinds_[chain[0]];
      if (kind == 0.0) polyline.color = crest_color(CrestKind::ridge);
      if (kind == 1.0) polyline.color = crest_color(CrestKind::valley);
      out.push_back(std::move(polyline));
    }
    set_widths(out, scales, width_);
    return out;
  }

  std::string path_;
  double width_;
  std::int64_t number_ = 0;
  std::vector<Element> elements_;
  std::vector<Eigen::RowVector3d> points_;
  std::vector<double> scales_;  // -1: none
  std::vector<double> kinds_;
  std::vector<std::vector<std::size_t>> chains_;
};

double kind_number(CrestKind kind) { return kind == CrestKind::ridge ? 0.0 : 1.0; }

}  // namespace

Rgb crest_color(CrestKind kind) {
  return kind == CrestKind::ridge ? Rgb(0.76, 0.13, 0.09) : Rgb(0.05, 0.27, 0.62);
}

void set_widths(std::vector<ScenePolyline>& lines, const std::vector<std::vector<double>>& scales,
                double width) {
  constexpr double kLargestFactor = 3.0;
  std::vector<double> known;
  for (const auto& scale : scales) {
    std::copy_if(scale.begin(), scale.end(), std::back_inserter(known),
                 [](double s) { return s > 0.0; });
  }
  double median = 0.0;
  if (!known.empty()) {
    const auto middle = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2);
    std::nth_element(known.begin(), middle, known.end());
    median = *middle;
  }
  for (std::size_t i = 0; i < lines.size(); ++i) {
    Eigen::VectorXd& thickness = lines[i].thickness_px;
    thickness = Eigen::VectorXd::Constant(lines[i].points.rows(), width);
    if (!(median > 0.0)) continue;
    for (std::size_t k = 0; k < scales[i].size(); ++k) {
      if (!(scales[i][k] > 0.0)) continue;
      thickness[static_cast<Eigen::Index>(k)] =
          width * std::clamp(scales[i][k] / median, 1.0 / kLargestFactor, kLargestFactor);
    }
  }
}

std::vector<ScenePolyline> read_lines(const std::string& path, double width,
                                      const ReadLimits& limits) {
  const FileBytes file = FileBytes::open(path, limits);
  const std::string text =
      file.judge(path, [&] { return std::string(file.bytes().begin(), file.bytes().end()); });
  if (text.rfind("ply", 0) == 0) return PlyLineReader(path, width).read(text);
  LineReader reader(path, width);
  reader.read(text);
  return reader.take();
}

std::string lines_as_obj(const std::vector<LineRecord>& lines) {
  std::string text = "# crest lines\n";
  Eigen::Index first = 1;
  for (const LineRecord& line : lines) {
    text += line.kind == CrestKind::ridge ? "g ridge\n" : "g valley\n";
    for (Eigen::Index i = 0; i < line.points.rows(); ++i)
      text += fmt::format("v {} {} {}\n", line.points(i, 0), line.points(i, 1), line.points(i, 2));
    text += "l";
    for (Eigen::Index i = 0; i < line.points.rows(); ++i) text += fmt::format(" {}", first + i);
    text += "\n";
    first += line.points.rows();
  }
  return text;
}

std::string lines_as_ply(const std::vector<LineRecord>& lines) {
  std::string vertices;
  std::string edges;
  std::size_t count = 0;
  std::size_t num_edges = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const LineRecord& line = lines[i];
    const double kind = kind_number(line.kind);
    for (std::size_t k = 0; k < line.scale.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      vertices += fmt::format("{} {} {} {} {} {} {} {}\n", line.points(row, 0), line.points(row, 1),
                              line.points(row, 2), kind, i, line.strength[k], line.scale[k],
                              line.strength_sd[k]);
      if (k == 0) continue;
      const auto middle = [&](const std::vector<double>& x) { return 0.5 * (x[k - 1] + x[k]); };
      edges += fmt::format("{} {} {} {} {} {}\n", count + k - 1, count + k, kind,
                           middle(line.strength), middle(line.scale), middle(line.strength_sd));
      ++num_edges;
    }
    count += line.scale.size();
  }
  return fmt::format(
             "ply\nformat ascii 1.0\ncomment crest lines: kind 0 ridge, 1 valley; sd -1 not known\n"
             "element vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
             "property uchar kind\nproperty int line\nproperty double strength\n"
             "property double scale\nproperty double sd\n"
             "element edge {}\nproperty int vertex1\nproperty int vertex2\nproperty uchar kind\n"
             "property double strength\nproperty double scale\nproperty double sd\nend_header\n",
             count, num_edges) +
         vertices + edges;
}

}  // namespace dupin::cli
