#include "dupin/image/image.h"

#include <gtest/gtest.h>

#include "dupin/base/error.h"

namespace dupin {
namespace {

// Four bytes a pixel, in the order red, green, blue, alpha.
TEST(Image, HoldsFourBytesAPixel) {
  const Image image = make_image(3, 2, 1, 2, 3, 4);
  ASSERT_EQ(image.rgba.size(), 24U);
  for (std::size_t i = 0; i < 24; ++i) EXPECT_EQ(image.rgba[i], i % 4 + 1);
  EXPECT_NO_THROW(validate(image));
}

// A picture without pixels, too large a side or a wrong number of bytes is the caller's error.
TEST(Image, RefusesWhatIsNoPicture) {
  EXPECT_THROW(make_image(0, 1), InvalidArgument);
  EXPECT_THROW(make_image(1, -1), InvalidArgument);
  EXPECT_THROW(make_image(32769, 1), InvalidArgument);
  Image image = make_image(2, 2);
  image.rgba.pop_back();
  EXPECT_THROW(validate(image), InvalidArgument);
}

}  // namespace
}  // namespace dupin
