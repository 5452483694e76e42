#include "dupin/render/text.h"

#include <gtest/gtest.h>

#include "dupin/render/font.h"

namespace dupin {
namespace {

struct Ink {
  int left = 1 << 20, top = 1 << 20, right = -1, bottom = -1;
  double sum = 0.0;
};

Ink ink_of(const Image& image) {
  Ink ink;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const int value = image.rgba[static_cast<std::size_t>(4 * (y * image.width + x))];
      if (value == 255) continue;
      ink.left = std::min(ink.left, x);
      ink.top = std::min(ink.top, y);
      ink.right = std::max(ink.right, x + 1);
      ink.bottom = std::max(ink.bottom, y + 1);
      ink.sum += (255 - value) / 255.0;
    }
  }
  return ink;
}

const TextStyle kStyle{40.0, false, Rgb(0, 0, 0)};

// The measured extent is the drawn one: the antialiasing adds at most half a pixel a side, and a
// pixel counts as soon as it is touched.
TEST(Text, MeasuredExtentIsWhatIsDrawn) {
  for (const char* text : {"Hg", "σ = 2.5×10⁻³", "[jQ]", "−1", "τ₀ λ"}) {
    Image image = make_image(500, 120, 255, 255, 255, 255);
    draw_text(image, text, 50.0, 70.0, TextAlign::left, kStyle);
    const TextExtent extent = measure_text(text, kStyle);
    const Ink ink = ink_of(image);
    EXPECT_NEAR(ink.left, 50.0, 1.01) << text;
    EXPECT_NEAR(ink.right, 50.0 + extent.right - extent.left, 1.51) << text;
    EXPECT_NEAR(ink.top, 70.0 + extent.top, 1.51) << text;
    EXPECT_NEAR(ink.bottom, 70.0 + extent.bottom, 1.51) << text;
  }
}

TEST(Text, AlignmentPutsTheInkWhereItSays) {
  Image right = make_image(300, 80, 255, 255, 255, 255);
  draw_text(right, "42", 250.0, 60.0, TextAlign::right, kStyle);
  EXPECT_NEAR(ink_of(right).right, 250.0, 1.01);
  Image center = make_image(300, 80, 255, 255, 255, 255);
  draw_text(center, "42", 150.0, 60.0, TextAlign::center, kStyle);
  EXPECT_NEAR(0.5 * (ink_of(center).left + ink_of(center).right), 150.0, 1.01);
}

// The ink of a straight stroke is its length times its width plus the two round ends; coverage by
// distance is exact to a few per cent.
TEST(Text, StrokesHaveTheInkOfTheirArea) {
  Image image = make_image(200, 100, 255, 255, 255, 255);
  draw_stroke(image, {20.3, 20.7}, {150.9, 77.1}, 4.0, Rgb(0, 0, 0));
  const double length = std::hypot(150.9 - 20.3, 77.1 - 20.7);
  EXPECT_NEAR(ink_of(image).sum / (4.0 * length + 3.14159 * 4.0), 1.0, 0.02);
}

TEST(Text, SizeScalesTheExtent) {
  TextStyle twice = kStyle;
  twice.size_px *= 2.0;
  EXPECT_NEAR(measure_text("Scale", twice).advance, 2.0 * measure_text("Scale", kStyle).advance,
              1e-9);
}

// Every printable ASCII character and every sign the header names has a glyph of its own.
TEST(Text, TheFaceHasWhatItPromises) {
  const detail::Glyph* box = &detail::glyph_of(U'\ufffd');
  for (char32_t c = U' '; c < 127; ++c) EXPECT_NE(&detail::glyph_of(c), box) << static_cast<int>(c);
  for (const char32_t c : std::u32string(U"−–×·±°≤≥≈→∞µαβδεθκλμπστφωΔΣ⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺₀₁₂₃₄₅₆₇₈₉")) {
    EXPECT_NE(&detail::glyph_of(c), box) << static_cast<int>(c);
    EXPECT_FALSE(detail::glyph_of(c).strokes.empty()) << static_cast<int>(c);
  }
}

TEST(Text, InvalidUtf8AndTextOutsideTheImageAreHarmless) {
  Image image = make_image(40, 20, 255, 255, 255, 255);
  draw_text(image, "\xff\xc3(\xe2\x88", -30.0, 10.0, TextAlign::left, kStyle);
  draw_text(image, "far away", 1e6, -1e6, TextAlign::left, kStyle);
  EXPECT_EQ(measure_text("\xff", kStyle).advance, measure_text("\u4e00", kStyle).advance);
  EXPECT_EQ(measure_text("", kStyle).advance, 0.0);
}

}  // namespace
}  // namespace dupin
