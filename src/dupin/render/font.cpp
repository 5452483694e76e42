#include "dupin/render/font.h"

#include <cmath>
#include <map>
#include <numbers>
#include <sstream>
#include <string>

namespace dupin::detail {
namespace {

using Eigen::Vector2d;

// The face, in a small language. M x y: start a stroke. L x y: line. Q x1 y1 x y: parabola. A/C cx
// cy rx ry from to: arc of a superellipse in degrees, as a new stroke (A) or joined by a line (C).
// D x y: dot. Bowls are slightly squarer than ellipses, which keeps small sizes open.
struct GlyphSource {
  char32_t character;
  double width;
  const char* path;
};

constexpr GlyphSource kFace[] = {
    {U'0', 56, "A 28 50 27 50 0 360"},
    {U'1', 56, "M 10 80 L 34 100 L 34 0"},
    {U'2', 56, "A 28 72 25 28 165 0 Q 53 54 34 35 L 3 0 L 54 0"},
    {U'3', 56, "A 27 76.5 23 23.5 155 -90 M 19 53 L 27 53 C 27 26.5 27 26.5 90 -160"},
    {U'4', 56, "M 43 0 L 43 100 L 0 26 L 57 26"},
    {U'5', 56, "M 49 100 L 9 100 L 6 53 C 27 32.5 27 32.5 140 -160"},
    {U'6', 56, "A 28 31 26 31 0 360 M 42 100 Q 2 58 2 31"},
    {U'7', 56, "M 2 100 L 54 100 L 19 0"},
    {U'8', 56, "A 28 76.5 22 23.5 0 360 A 28 26.5 27 26.5 0 360"},
    {U'9', 56, "A 28 69 26 31 0 360 M 14 0 Q 54 42 54 69"},
    {U'A', 72, "M 0 0 L 36 100 L 72 0 M 12 33 L 60 33"},
    {U'B', 62,
     "M 0 0 L 0 100 L 32 100 C 32 76.5 25 23.5 90 -90 L 0 53 M 32 53 C 33 26.5 29 26.5 90 -90 L 0 "
     "0"},
    {U'C', 66, "A 37 50 37 50 50 310"},
    {U'D', 68, "M 0 0 L 0 100 L 28 100 C 28 50 40 50 90 -90 L 0 0"},
    {U'E', 54, "M 54 100 L 0 100 L 0 0 L 54 0 M 0 52 L 48 52"},
    {U'F', 52, "M 52 100 L 0 100 L 0 0 M 0 50 L 46 50"},
    {U'G', 74, "A 37 50 37 50 50 345 L 74 47 L 42 47"},
    {U'H', 66, "M 0 0 L 0 100 M 66 0 L 66 100 M 0 52 L 66 52"},
    {U'I', 0, "M 0 0 L 0 100"},
    {U'J', 42, "M 42 100 L 42 28 C 20 28 22 28 0 -165"},
    {U'K', 62, "M 0 0 L 0 100 M 58 100 L 0 38 M 20 59 L 62 0"},
    {U'L', 50, "M 0 100 L 0 0 L 50 0"},
    {U'M', 80, "M 0 0 L 0 100 L 40 32 L 80 100 L 80 0"},
    {U'N', 66, "M 0 0 L 0 100 L 66 0 L 66 100"},
    {U'O', 78, "A 39 50 39 50 0 360"},
    {U'P', 60, "M 0 0 L 0 100 L 32 100 C 32 73 28 27 90 -90 L 0 46"},
    {U'Q', 80, "A 39 50 39 50 0 360 M 50 24 L 78 -8"},
    {U'R', 62, "M 0 0 L 0 100 L 32 100 C 32 73 28 27 90 -90 L 0 46 M 34 46 L 62 0"},
    {U'S', 60, "A 30 75.5 26 24.5 30 270 C 30 25.5 29 25.5 90 -155"},
    {U'T', 68, "M 0 100 L 68 100 M 34 100 L 34 0"},
    {U'U', 66, "M 0 100 L 0 33 C 33 33 33 33 180 360 L 66 100"},
    {U'V', 70, "M 0 100 L 35 0 L 70 100"},
    {U'W', 100, "M 0 100 L 25 0 L 50 92 L 75 0 L 100 100"},
    {U'X', 64, "M 0 100 L 64 0 M 64 100 L 0 0"},
    {U'Y', 68, "M 0 100 L 34 46 L 68 100 M 34 46 L 34 0"},
    {U'Z', 64, "M 2 100 L 62 100 L 0 0 L 64 0"},
    {U'a', 50, "A 26 50 23 22 155 0 L 49 0 M 49 43 L 22 43 C 22 21.5 21 21.5 90 270 Q 40 0 49 16"},
    {U'b', 56, "M 0 104 L 0 0 M 56 36 A 28 36 28 36 0 360"},
    {U'c', 50, "A 27 36 27 36 50 310"},
    {U'd', 56, "M 56 104 L 56 0 M 56 36 A 28 36 28 36 0 360"},
    {U'e', 54, "M 1 37 L 54 37 C 27.5 36 26.5 36 2 318"},
    {U'f', 32, "M 34 103 Q 13 107 13 84 L 13 0 M 0 71 L 31 71"},
    {U'g', 56, "A 28 36 28 36 0 360 M 56 72 L 56 -4 C 30 -4 26 24 0 -150"},
    {U'h', 52, "M 0 104 L 0 0 M 0 42 C 26 42 26 30 180 0 L 52 0"},
    {U'i', 0, "M 0 72 L 0 0 D 0 97"},
    {U'j', 8, "M 8 72 L 8 -10 Q 8 -28 -8 -27 D 8 97"},
    {U'k', 48, "M 0 104 L 0 0 M 44 72 L 0 26 M 16 43 L 48 0"},
    {U'l', 12, "M 0 104 L 0 14 Q 0 0 13 0"},
    {U'm', 86,
     "M 0 72 L 0 0 M 0 46 C 21.5 46 21.5 26 180 0 L 43 0 M 43 46 C 64.5 46 21.5 26 180 0 L 86 0"},
    {U'n', 52, "M 0 72 L 0 0 M 0 42 C 26 42 26 30 180 0 L 52 0"},
    {U'o', 56, "A 28 36 28 36 0 360"},
    {U'p', 56, "M 0 72 L 0 -28 M 56 36 A 28 36 28 36 0 360"},
    {U'q', 56, "M 56 72 L 56 -28 M 56 36 A 28 36 28 36 0 360"},
    {U'r', 30, "M 0 72 L 0 0 M 0 38 Q 4 73 31 71"},
    {U's', 46, "A 23 54.5 20 17.5 30 270 C 23 18.5 22 18.5 90 -155"},
    {U't', 32, "M 13 92 L 13 18 Q 13 -1 33 1 M 0 71 L 31 71"},
    {U'u', 52, "M 0 72 L 0 28 C 26 28 26 28 180 360 M 52 72 L 52 0"},
    {U'v', 54, "M 0 72 L 27 0 L 54 72"},
    {U'w', 80, "M 0 72 L 20 0 L 40 68 L 60 0 L 80 72"},
    {U'x', 50, "M 0 72 L 50 0 M 50 72 L 0 0"},
    {U'y', 54, "M 0 72 L 28 2 M 54 72 L 23 -12 Q 17 -28 2 -27"},
    {U'z', 50, "M 2 72 L 48 72 L 0 0 L 50 0"},
    {U' ', 8, ""},
    {U'.', 4, "D 2 1"},
    {U',', 6, "M 5 3 L 1 -15"},
    {U':', 4, "D 2 62 D 2 1"},
    {U';', 6, "D 4 62 M 5 3 L 1 -15"},
    {U'!', 4, "M 2 100 L 2 32 D 2 1"},
    {U'?', 46, "A 23 76 22 24 165 -45 Q 23 50 23 30 D 23 1"},
    {U'\'', 0, "M 0 104 L 0 78"},
    {U'"', 18, "M 0 104 L 0 78 M 18 104 L 18 78"},
    {U'(', 18, "M 20 112 Q -16 42 20 -28"},
    {U')', 18, "M -2 112 Q 34 42 -2 -28"},
    {U'[', 18, "M 18 112 L 0 112 L 0 -26 L 18 -26"},
    {U']', 18, "M 0 112 L 18 112 L 18 -26 L 0 -26"},
    {U'{', 24,
     "M 24 112 Q 10 112 10 96 L 10 58 Q 10 43 0 43 Q 10 43 10 28 L 10 -10 Q 10 -26 24 -26"},
    {U'}', 24,
     "M 0 112 Q 14 112 14 96 L 14 58 Q 14 43 24 43 Q 14 43 14 28 L 14 -10 Q 14 -26 0 -26"},
    {U'/', 42, "M 0 -12 L 42 112"},
    {U'\\', 42, "M 0 112 L 42 -12"},
    {U'-', 32, "M 0 37 L 32 37"},
    {U'_', 56, "M 0 -14 L 56 -14"},
    {U'+', 58, "M 0 45 L 58 45 M 29 74 L 29 16"},
    {U'=', 58, "M 0 58 L 58 58 M 0 32 L 58 32"},
    {U'<', 54, "M 54 76 L 0 45 L 54 14"},
    {U'>', 54, "M 0 76 L 54 45 L 0 14"},
    {U'*', 38, "M 19 104 L 19 64 M 2 94 L 36 74 M 2 74 L 36 94"},
    {U'%', 92, "A 18 76 17 24 0 360 A 74 24 17 24 0 360 M 70 100 L 22 0"},
    {U'#', 68, "M 24 100 L 14 0 M 56 100 L 46 0 M 4 66 L 68 66 M 0 34 L 64 34"},
    {U'&', 70,
     "M 70 0 L 17 70 Q 8 84 16 94 Q 30 106 42 94 Q 50 80 38 68 L 20 56 Q 2 44 2 26 Q 4 1 30 0 Q 56 "
     "2 66 42"},
    {U'@', 92,
     "A 46 40 19 25 0 360 M 65 64 L 65 26 Q 68 13 78 16 Q 92 22 92 44 C 46 42 46 58 0 300"},
    {U'$', 58, "A 29 73 25 22 30 270 C 29 26 28 25 90 -155 M 29 112 L 29 -12"},
    {U'^', 44, "M 0 72 L 22 102 L 44 72"},
    {U'`', 14, "M 0 104 L 14 86"},
    {U'|', 0, "M 0 112 L 0 -28"},
    {U'~', 58, "M 0 38 Q 14 58 29 45 Q 44 32 58 52"},
    {U'\u2212', 56, "M 0 45 L 56 45"},
    {U'\u2013', 56, "M 0 37 L 56 37"},
    {U'\u2014', 90, "M 0 37 L 90 37"},
    {U'\u2019', 4, "M 4 104 L 0 84"},
    {U'\u00d7', 48, "M 0 69 L 48 21 M 0 21 L 48 69"},
    {U'\u00b7', 4, "D 2 42"},
    {U'\u00b1', 58, "M 0 54 L 58 54 M 29 80 L 29 28 M 0 4 L 58 4"},
    {U'\u00b0', 28, "A 14 88 14 14 0 360"},
    {U'\u2264', 54, "M 54 86 L 0 58 L 54 30 M 0 6 L 54 6"},
    {U'\u2265', 54, "M 0 86 L 54 58 L 0 30 M 0 6 L 54 6"},
    {U'\u2248', 58, "M 0 54 Q 14 74 29 61 Q 44 48 58 68 M 0 24 Q 14 44 29 31 Q 44 18 58 38"},
    {U'\u2192', 80, "M 0 42 L 80 42 M 52 70 L 80 42 L 52 14"},
    {U'\u221e', 90, "A 22 42 22 22 0 360 A 68 42 22 22 0 360"},
    {U'\u00b5', 52, "M 0 72 L 0 -28 M 0 28 C 26 28 26 28 180 360 M 52 72 L 52 0"},
    {U'\u03bc', 52, "M 0 72 L 0 -28 M 0 28 C 26 28 26 28 180 360 M 52 72 L 52 0"},
    {U'\u03b1', 60, "A 26 36 26 36 0 360 M 58 72 L 51 30 Q 50 1 62 1"},
    {U'\u03b2', 54,
     "M 0 -28 L 0 78 C 24 79 24 25 180 -90 L 14 54 M 24 54 C 26 27 28 27 90 -90 Q 10 0 0 14"},
    {U'\u03b4', 56, "A 28 32 27 32 0 360 M 48 98 Q 30 108 17 99 Q 8 90 20 80 L 40 61"},
    {U'\u03b5', 44, "A 25 54.5 21 17.5 35 270 M 34 37 L 25 37 M 25 37 C 25 18.5 24 18.5 90 325"},
    {U'\u03b8', 52, "A 26 52 26 52 0 360 M 1 52 L 51 52"},
    {U'\u03ba', 48, "M 0 72 L 0 0 M 45 72 L 0 27 M 16 43 L 48 0"},
    {U'\u03bb', 54, "M 2 103 Q 15 106 21 88 L 54 0 M 30 64 L 2 0"},
    {U'\u03c0', 64, "M 0 71 L 64 71 M 15 71 L 13 0 M 48 71 L 48 16 Q 48 0 60 1"},
    {U'\u03c3', 62, "M 64 70 L 28 70 C 28 35 28 35 90 450"},
    {U'\u03c4', 54, "M 0 71 L 54 71 M 26 71 L 26 20 Q 26 0 44 1"},
    {U'\u03c6', 66, "A 33 36 33 36 0 360 M 33 100 L 33 -28"},
    {U'\u03c9', 74,
     "M 12 71 Q 0 56 0 28 C 19 24 19 24 180 360 L 37 46 M 62 71 Q 74 56 74 28 C 55 24 18 24 0 "
     "-180"},
    {U'\u0394', 72, "M 0 0 L 36 100 L 72 0 L 0 0 L 1 0"},
    {U'\u03a3', 62, "M 60 100 L 2 100 L 36 52 L 0 0 L 62 0"},
    {U'\ufffd', 50, "M 0 0 L 50 0 L 50 100 L 0 100 L 0 0"},
};

struct Shifted {
  char32_t character;
  char32_t base;
  bool is_raised;
};

constexpr Shifted kShifted[] = {
    {U'\u2070', U'0', true},  {U'\u00b9', U'1', true},  {U'\u00b2', U'2', true},
    {U'\u00b3', U'3', true},  {U'\u2074', U'4', true},  {U'\u2075', U'5', true},
    {U'\u2076', U'6', true},  {U'\u2077', U'7', true},  {U'\u2078', U'8', true},
    {U'\u2079', U'9', true},  {U'\u207b', U'-', true},  {U'\u207a', U'+', true},
    {U'\u2080', U'0', false}, {U'\u2081', U'1', false}, {U'\u2082', U'2', false},
    {U'\u2083', U'3', false}, {U'\u2084', U'4', false}, {U'\u2085', U'5', false},
    {U'\u2086', U'6', false}, {U'\u2087', U'7', false}, {U'\u2088', U'8', false},
    {U'\u2089', U'9', false},
};

constexpr double kSideBearing = 13.0;

void add_arc(Glyph::Stroke& stroke, const double (&a)[6]) {
  constexpr double kSquareness = 2.0 / 2.3;  // exponent 2 is the ellipse
  const int steps = 2 + static_cast<int>(std::abs(a[5] - a[4]) / 6.0);
  for (int i = 0; i <= steps; ++i) {
    const double angle = (a[4] + (a[5] - a[4]) * i / steps) * std::numbers::pi / 180.0;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    stroke.emplace_back(a[0] + a[2] * std::copysign(std::pow(std::abs(c), kSquareness), c),
                        a[1] + a[3] * std::copysign(std::pow(std::abs(s), kSquareness), s));
  }
}

void add_parabola(Glyph::Stroke& stroke, const Vector2d& middle, const Vector2d& end) {
  const Vector2d start = stroke.back();
  constexpr int kSteps = 12;
  for (int i = 1; i <= kSteps; ++i) {
    const double t = i / static_cast<double>(kSteps);
    stroke.emplace_back((1 - t) * (1 - t) * start + 2 * t * (1 - t) * middle + t * t * end);
  }
}

Glyph parse(const GlyphSource& source) {
  Glyph glyph;
  glyph.advance = source.width + 2.0 * kSideBearing;
  std::istringstream in(source.path);
  in.imbue(std::locale::classic());
  char command = 0;
  while (in >> command) {
    double a[6] = {};
    const int count = command == 'Q' ? 4 : command == 'A' || command == 'C' ? 6 : 2;
    for (int i = 0; i < count; ++i) in >> a[i];
    if (command == 'M' || command == 'A' || command == 'D') glyph.strokes.emplace_back();
    Glyph::Stroke& stroke = glyph.strokes.back();
    if (command == 'Q') {
      add_parabola(stroke, {a[0], a[1]}, {a[2], a[3]});
    } else if (count == 6) {
      add_arc(stroke, a);
    } else {
      stroke.emplace_back(a[0], a[1]);
    }
  }
  // A start without a line is not a dot.
  std::erase_if(glyph.strokes, [&](const Glyph::Stroke& s) {
    return s.size() == 1 && std::string(source.path).find('D') == std::string::npos;
  });
  for (auto& stroke : glyph.strokes) {
    for (auto& point : stroke) point.x() += kSideBearing;
  }
  return glyph;
}

std::map<char32_t, Glyph> make_face() {
  std::map<char32_t, Glyph> face;
  for (const GlyphSource& source : kFace) face[source.character] = parse(source);
  for (const Shifted& shifted : kShifted) {
    constexpr double kScale = 0.62;
    Glyph glyph = face[shifted.base];
    glyph.advance *= kScale;
    glyph.weight = 0.8;
    for (auto& stroke : glyph.strokes) {
      for (auto& point : stroke) {
        point = kScale * point + Vector2d(0.0, shifted.is_raised ? 46.0 : -22.0);
      }
    }
    face[shifted.character] = glyph;
  }
  face[U'\u00a0'] = face[U' '];
  return face;
}

}  // namespace

const Glyph& glyph_of(char32_t character) {
  static const std::map<char32_t, Glyph> face = make_face();
  const auto found = face.find(character);
  return found == face.end() ? face.at(U'\ufffd') : found->second;
}

}  // namespace dupin::detail
