// A vehicle's body: a rigid rectangle at its centre's pose, for single numbers and for lanes alike. Always inlined: the
// kernels are compiled once per instruction set, and a copy that they shared could come from the wrong one.
#pragma once

namespace intersection_env {

constexpr float NO_DISTANCE = 3.0e38F; // stands for: they cannot touch

// Centre [m], direction (a unit vector), half sizes [m].
template <class F>
struct Rectangle {
    F x, y, cosine, sine;
    float half_length, half_width;
};

template <class F>
[[gnu::always_inline]] inline F size_of(F x) {
    return x < 0.0F ? -x : x;
}

template <class F>
[[gnu::always_inline]] inline F smaller(F a, F b) {
    return a < b ? a : b;
}

// The square of how far a point lies outside a rectangle, in the rectangle's own axes [m²].
template <class F>
[[gnu::always_inline]] inline F squared_outside(F x, F y, float half_length, float half_width) {
    const F along = size_of(x) - half_length, across = size_of(y) - half_width;
    const F a = along > 0.0F ? along : F{}, b = across > 0.0F ? across : F{};
    return a * a + b * b;
}

// Of the corners of a rectangle with centre (x, y), half length u and half width v, which are vectors, the nearest.
template <class F>
[[gnu::always_inline]] inline F squared_of_corners(F x, F y, F ux, F uy, F vx, F vy, float half_length,
                                                   float half_width) {
    const F px = ux + vx, py = uy + vy, qx = ux - vx, qy = uy - vy;
    const F at_p = smaller(squared_outside(x + px, y + py, half_length, half_width),
                           squared_outside(x - px, y - py, half_length, half_width));
    const F at_q = smaller(squared_outside(x + qx, y + qy, half_length, half_width),
                           squared_outside(x - qx, y - qy, half_length, half_width));
    return smaller(at_p, at_q);
}

// The square of the distance between two rectangles [m²], 0 where they overlap: where none of their four axes separates
// them. Apart, they are nearest at a corner of one of them. Swapping them changes no bit.
template <class F>
[[gnu::always_inline]] inline F squared_distance(const Rectangle<F>& a, const Rectangle<F>& b) {
    const F x = b.x - a.x, y = b.y - a.y;
    const F turn_x = a.cosine * b.cosine + a.sine * b.sine, turn_y = a.cosine * b.sine - a.sine * b.cosine;
    const F b_x = a.cosine * x + a.sine * y, b_y = a.cosine * y - a.sine * x;    // b's centre in a's axes
    const F a_x = -(b.cosine * x + b.sine * y), a_y = b.sine * x - b.cosine * y; // a's centre in b's axes
    const F c = size_of(turn_x), s = size_of(turn_y);
    const auto overlap = (size_of(b_x) <= a.half_length + (b.half_length * c + b.half_width * s)) &
                         (size_of(b_y) <= a.half_width + (b.half_length * s + b.half_width * c)) &
                         (size_of(a_x) <= b.half_length + (a.half_length * c + a.half_width * s)) &
                         (size_of(a_y) <= b.half_width + (a.half_length * s + a.half_width * c));
    const F of_b = squared_of_corners(b_x, b_y, b.half_length * turn_x, b.half_length * turn_y, -b.half_width * turn_y,
                                      b.half_width * turn_x, a.half_length, a.half_width);
    const F of_a = squared_of_corners(a_x, a_y, a.half_length * turn_x, -a.half_length * turn_y, a.half_width * turn_y,
                                      a.half_width * turn_x, b.half_length, b.half_width);
    return overlap ? F{} : smaller(of_a, of_b);
}

} // namespace intersection_env
