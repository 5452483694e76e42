#include "dupin/warp/planar_triangulation.h"

#include <algorithm>

#include "dupin/base/assert.h"
#include "dupin/base/error.h"

namespace dupin {

PlanarTriangulation::PlanarTriangulation(GridPoint low, GridPoint high,
                                         std::size_t expected_points) {
  point.reserve(expected_points + 4);
  leaving.reserve(expected_points + 4);
  for (auto* array : {&origin, &twin, &segment}) array->reserve(8 * expected_points + 64);
  point = {low, {high.x, low.y}, high, {low.x, high.y}};
  leaving.assign(4, kNone);
  const std::int32_t first = 4 * add_triangle(0, 1, 2, 0);
  const std::int32_t second = 4 * add_triangle(0, 2, 3, 0);
  link(first + 2, second);
}

std::int32_t PlanarTriangulation::add_triangle(std::int32_t a, std::int32_t b, std::int32_t c,
                                               std::int32_t tag) {
  const std::int32_t t = num_triangles();
  const std::int32_t corners[4] = {a, b, c, tag};
  origin.insert(origin.end(), corners, corners + 4);
  twin.insert(twin.end(), 4, kNone);
  segment.insert(segment.end(), 4, kNone);
  for (std::int32_t i = 0; i < 3; ++i) leaving[at(corners[i])] = 4 * t + i;
  return t;
}

void PlanarTriangulation::link(std::int32_t e, std::int32_t other) {
  twin[at(e)] = other;
  if (other != kNone) twin[at(other)] = e;
}

void PlanarTriangulation::flip(std::int32_t e) {
  const std::int32_t b = twin[at(e)];
  const std::int32_t en = next(e), bn = next(b);
  const std::int32_t p_apex = apex(e), q_apex = apex(b);
  const std::int32_t u = origin[at(e)], v = origin[at(b)];
  const std::int32_t beyond_en = twin[at(en)], beyond_bn = twin[at(bn)];
  origin[at(en)] = q_apex;
  origin[at(bn)] = p_apex;
  link(e, beyond_bn);
  link(b, beyond_en);
  link(en, bn);
  segment[at(e)] = segment[at(bn)];
  segment[at(b)] = segment[at(en)];
  segment[at(en)] = segment[at(bn)] = kNone;
  leaving[at(u)] = e;
  leaving[at(v)] = b;
}

bool PlanarTriangulation::is_locally_delaunay(std::int32_t e) const {
  const std::int32_t b = twin[at(e)];
  if (b == kNone || segment[at(e)] != kNone) return true;
  return in_circle(p(origin[at(e)]), p(destination(e)), p(apex(e)), p(apex(b))) <= 0;
}

// Every edge on the stack is opposite the new vertex in its triangle.
void PlanarTriangulation::legalise() {
  while (!stack_.empty()) {
    const std::int32_t e = stack_.back();
    stack_.pop_back();
    if (is_locally_delaunay(e)) continue;
    const std::int32_t far = previous(twin[at(e)]);
    flip(e);
    stack_.push_back(e);
    stack_.push_back(far);
  }
}

void PlanarTriangulation::restore_delaunay(std::vector<std::int32_t>& pending) {
  while (!pending.empty()) {
    const std::int32_t e = pending.back();
    pending.pop_back();
    if (is_locally_delaunay(e)) continue;
    const std::int32_t b = twin[at(e)];
    flip(e);
    pending.insert(pending.end(), {e, previous(e), b, previous(b)});
  }
}

void PlanarTriangulation::split_triangle(std::int32_t t, std::int32_t v) {
  const std::int32_t e = 4 * t;
  const std::int32_t a = origin[at(e)], b = origin[at(e + 1)], c = origin[at(e + 2)];
  const std::int32_t tag = origin[at(e + 3)];
  const std::int32_t beyond_bc = twin[at(e + 1)], beyond_ca = twin[at(e + 2)];
  const std::int32_t segment_bc = segment[at(e + 1)], segment_ca = segment[at(e + 2)];
  const std::int32_t bc = 4 * add_triangle(b, c, v, tag);
  const std::int32_t ca = 4 * add_triangle(c, a, v, tag);
  origin[at(e + 2)] = v;
  leaving[at(v)] = e + 2;
  link(bc, beyond_bc);
  link(ca, beyond_ca);
  segment[at(bc)] = segment_bc;
  segment[at(ca)] = segment_ca;
  segment[at(e + 1)] = segment[at(e + 2)] = kNone;
  link(e + 1, bc + 2);
  link(bc + 1, ca + 2);
  link(ca + 1, e + 2);
  stack_.insert(stack_.end(), {e, bc, ca});
}

void PlanarTriangulation::split_edge(std::int32_t e, std::int32_t v) {
  const std::int32_t b = twin[at(e)];
  const std::int32_t parent = segment[at(e)];
  const std::int32_t start = origin[at(e)], end = destination(e);
  const auto halve = [&](std::int32_t half, std::int32_t far_end) {
    const std::int32_t across = next(half);
    const std::int32_t top = apex(half);
    const std::int32_t beyond = twin[at(across)], beyond_segment = segment[at(across)];
    const std::int32_t fresh = 4 * add_triangle(v, far_end, top, origin[at(half | 3)]);
    origin[at(across)] = v;
    link(fresh + 1, beyond);
    segment[at(fresh + 1)] = beyond_segment;
    segment[at(across)] = kNone;
    link(across, fresh + 2);
    segment[at(fresh)] = parent;
    stack_.insert(stack_.end(), {previous(half), fresh + 1});
    return fresh;
  };
  const std::int32_t towards_end = halve(e, end);
  if (b == kNone) {
    twin[at(e)] = kNone;
    leaving[at(v)] = towards_end;
    return;
  }
  const std::int32_t towards_start = halve(b, start);
  link(e, towards_start);
  link(b, towards_end);
}

std::int32_t PlanarTriangulation::insert(GridPoint query, const Location& where) {
  const std::int32_t v = num_vertices();
  point.push_back(query);
  leaving.push_back(kNone);
  if (where.place == Place::edge)
    split_edge(where.edge, v);
  else
    split_triangle(where.edge >> 2, v);
  legalise();
  return v;
}

PlanarTriangulation::Location PlanarTriangulation::locate(GridPoint query, std::int32_t start,
                                                          bool stop_at_segments) const {
  std::int32_t t = start >> 2;
  std::int32_t entered = kNone;
  std::uint32_t turn = 1;
  while (true) {
    // A fixed choice among the exits can circle for ever between segments; a varying one cannot.
    turn = turn * 1664525u + 1013904223u;
    std::int32_t e = 4 * t + static_cast<std::int32_t>((turn >> 16) % 3u);
    std::int32_t zero[2];
    int num_zero = 0;
    std::int32_t exit = kNone;
    for (int i = 0; i < 3; ++i, e = next(e)) {
      if (e == entered) continue;
      const std::int64_t side = orientation(p(origin[at(e)]), p(destination(e)), query);
      if (side < 0) {
        exit = e;
        break;
      }
      if (side == 0 && num_zero < 2) zero[num_zero++] = e;
    }
    if (exit == kNone) {
      if (num_zero == 0) return {Place::triangle, 4 * t};
      if (num_zero == 1) return {Place::edge, zero[0]};
      return {Place::vertex, destination(zero[0]) == origin[at(zero[1])] ? zero[1] : zero[0]};
    }
    const std::int32_t beyond = twin[at(exit)];
    if (beyond == kNone || (stop_at_segments && segment[at(exit)] != kNone))
      return {Place::blocked, exit};
    entered = beyond;
    t = beyond >> 2;
  }
}

std::int32_t PlanarTriangulation::find_edge(std::int32_t u, std::int32_t v) const {
  const std::int32_t first = leaving[at(u)];
  std::int32_t e = first;
  do {
    if (destination(e) == v) return e;
    e = twin[at(previous(e))];
  } while (e != first && e != kNone);
  if (e == first) return kNone;
  // A corner of the box: the rest of its edges lie the other way round.
  for (e = twin[at(first)]; e != kNone; e = twin[at(e)]) {
    e = next(e);
    if (destination(e) == v) return e;
  }
  return kNone;
}

// crossing_ lists the edges across uv, the end on its right first. The vertex farthest to the
// right, of several the first along uv, sees its neighbours within less than half a turn, and not
// all the ends of its edges to the left can be hidden behind their neighbours: one of the edges can
// be flipped, and it then leaves that vertex. So vertex after vertex is freed from crossing edges.
void PlanarTriangulation::flip_away(std::int32_t u, std::int32_t v) {
  const GridPoint from = p(u), to = p(v);
  changed_.clear();
  while (!crossing_.empty()) {
    const auto far = std::min_element(
        crossing_.begin(), crossing_.end(), [&](const Crossing& a, const Crossing& b) {
          const std::int64_t of_a = orientation(from, to, p(a.right));
          const std::int64_t of_b = orientation(from, to, p(b.right));
          if (of_a != of_b) return of_a < of_b;
          return dot(from, to, p(a.right)) < dot(from, to, p(b.right));
        });
    const std::int32_t apart = far->right;
    bool has_flipped = false;
    for (std::size_t i = 0; i < crossing_.size() && !has_flipped; ++i) {
      if (crossing_[i].right != apart) continue;
      const std::int32_t e = find_edge(apart, crossing_[i].left);
      const std::int32_t a = apex(e), b = apex(twin[at(e)]);
      const std::int64_t side_right = orientation(p(a), p(b), p(apart));
      const std::int64_t side_left = orientation(p(a), p(b), p(crossing_[i].left));
      if (!((side_right < 0 && side_left > 0) || (side_right > 0 && side_left < 0))) continue;
      flip(e);
      has_flipped = true;
      const std::int64_t side_a = orientation(from, to, p(a)), side_b = orientation(from, to, p(b));
      if (side_a < 0 && side_b > 0) {
        crossing_[i] = {a, b};
      } else if (side_b < 0 && side_a > 0) {
        crossing_[i] = {b, a};
      } else {
        changed_.push_back({a, b});
        crossing_[i] = crossing_.back();
        crossing_.pop_back();
      }
    }
    if (!has_flipped)
      throw Error(Errc::internal, "E_INTERNAL", "no edge across a segment can be flipped");
  }
}

PlanarTriangulation::Obstacle PlanarTriangulation::insert_segment(std::int32_t u, std::int32_t v,
                                                                  std::int32_t id) {
  const GridPoint from = p(u), to = p(v);
  const auto side = [&](std::int32_t w) { return orientation(from, to, p(w)); };
  // The wedge at u that holds the segment, or the edge itself.
  std::int32_t e = leaving[at(u)];
  while (destination(e) != v) {
    const std::int32_t w = destination(e);
    const std::int64_t right = side(w);
    if (right == 0 && dot(from, to, p(w)) > 0) return {Obstacle::Kind::vertex, w};
    if (right < 0 && side(apex(e)) > 0) break;
    e = twin[at(previous(e))];
    DUPIN_ASSERT(e != kNone);
  }
  if (destination(e) != v) {
    crossing_.clear();
    for (std::int32_t across = next(e);;) {
      if (segment[at(across)] != kNone) return {Obstacle::Kind::segment, segment[at(across)]};
      crossing_.push_back({origin[at(across)], destination(across)});
      const std::int32_t b = twin[at(across)];
      const std::int32_t w = apex(b);
      if (w == v) break;
      const std::int64_t where = side(w);
      if (where == 0) return {Obstacle::Kind::vertex, w};
      across = where > 0 ? next(b) : previous(b);
    }
    flip_away(u, v);
    e = find_edge(u, v);
    segment[at(e)] = segment[at(twin[at(e)])] = id;
    for (const Crossing& c : changed_) {
      const std::int32_t edge = find_edge(c.right, c.left);
      if (edge != kNone) stack_.push_back(edge);
    }
    restore_delaunay(stack_);
    return {};
  }
  segment[at(e)] = segment[at(twin[at(e)])] = id;
  return {};
}

void PlanarTriangulation::keep_only(const std::vector<std::int32_t>& component) {
  std::vector<std::int32_t> place(component.size(), kNone);
  std::int32_t kept = 0;
  for (std::size_t t = 0; t < component.size(); ++t)
    if (component[t] >= 0) place[t] = kept++;
  for (std::size_t t = 0; t < component.size(); ++t) {
    if (place[t] == kNone) continue;
    for (std::int32_t i = 0; i < 3; ++i) {
      const std::size_t from = 4 * t + static_cast<std::size_t>(i);
      const std::int32_t e = 4 * place[t] + i;
      const std::int32_t other = twin[from];
      const std::int32_t kept_other = other == kNone ? kNone : place[at(other >> 2)];
      origin[at(e)] = origin[from];
      segment[at(e)] = segment[from];
      twin[at(e)] = kept_other == kNone ? kNone : 4 * kept_other + (other & 3);
      leaving[at(origin[at(e)])] = e;
    }
    origin[at(4 * place[t] + 3)] = component[t];
  }
  for (auto* array : {&origin, &twin, &segment}) array->resize(4 * at(kept));
}

}  // namespace dupin
