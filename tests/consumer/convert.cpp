// A made surface into a file and back, and a small picture: needs what io/ needs, zlib and libpng.
#include "dupin/io/png.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/shapes.h"

int main() {
  const dupin::Mesh mesh = dupin::make_sphere(1.0, 100).mesh;
  dupin::SurfaceOutput out;
  out.points = mesh.points;
  out.triangles = mesh.triangles;
  dupin::write_surface("sphere.ply", out, dupin::SurfaceFormat::ply_binary);
  dupin::write_png("white.png", dupin::make_image(8, 8, 255, 255, 255, 255));
  return dupin::read_surface("sphere.ply").mesh.points == mesh.points ? 0 : 1;
}
