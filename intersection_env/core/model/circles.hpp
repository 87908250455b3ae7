// A vehicle as two circles, as the worlds see it (paper, Section III-B.3), for single numbers and for lanes alike.
#pragma once

namespace intersection_env {

// Centre [m], and from there to the front circle's centre [m]; the rear circle lies opposite.
template <class F>
struct Circles {
    F x, y, dx, dy;
};

constexpr float CIRCLE_OFFSET = 0.25F; // of the length; ours: shared/neighbouring lanes stay apart
constexpr float CIRCLE_RADIUS = 0.5F;  // of the width

// The square of the smallest distance between a circle centre of a and one of b [m²].
template <class F>
inline F squared_distance(const Circles<F>& a, const Circles<F>& b) {
    const F x = a.x - b.x, y = a.y - b.y;
    const auto square = [&](F p, F q) { return p * p + q * q; };
    const auto least = [](F p, F q) { return p < q ? p : q; };
    const F same = least(square(x + (a.dx - b.dx), y + (a.dy - b.dy)), square(x - (a.dx - b.dx), y - (a.dy - b.dy)));
    const F cross = least(square(x + (a.dx + b.dx), y + (a.dy + b.dy)), square(x - (a.dx + b.dx), y - (a.dy + b.dy)));
    return least(same, cross);
}

} // namespace intersection_env
