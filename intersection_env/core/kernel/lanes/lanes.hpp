// Lanes: one number of every scenario or world in a block, at the native width of the instruction set.
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

namespace intersection_env::INTERSECTION_ENV_ISA {

#if defined(__AVX512F__)
constexpr int WIDTH = 16;
#elif defined(__AVX2__)
constexpr int WIDTH = 8;
#else
constexpr int WIDTH = 4;
#endif

typedef float Floats __attribute__((vector_size(WIDTH * 4)));
typedef std::int32_t Ints __attribute__((vector_size(WIDTH * 4))); // a mask holds 0 or -1 in each lane
typedef std::uint32_t Words __attribute__((vector_size(WIDTH * 4)));
typedef float Quad __attribute__((vector_size(16), aligned(4)));

template <class Number>
struct LanesTrait;
template <>
struct LanesTrait<float> {
    using Type = Floats;
};
template <>
struct LanesTrait<std::int32_t> {
    using Type = Ints;
};
template <>
struct LanesTrait<std::uint32_t> {
    using Type = Words;
};
template <class Number>
struct LanesTrait<const Number> {
    using Type = const typename LanesTrait<Number>::Type;
};
template <class Number>
using LanesOf = typename LanesTrait<Number>::Type;

// A row of lanes in memory that is aligned for it.
template <class Number>
inline LanesOf<Number>& lanes_at(Number* first) {
    return *reinterpret_cast<LanesOf<Number>*>(first);
}

inline Floats all(float value) { return value - Floats{}; }
inline Ints all_ints(std::int32_t value) { return value - Ints{}; }
inline Floats least(Floats a, Floats b) { return a < b ? a : b; }
inline Floats most(Floats a, Floats b) { return a > b ? a : b; }
inline Ints most(Ints a, Ints b) { return a > b ? a : b; }
inline Floats magnitude(Floats x) { return x < 0.0F ? -x : x; }
inline Floats as_floats(Ints x) { return __builtin_convertvector(x, Floats); }
inline Ints as_ints(Floats x) { return __builtin_convertvector(x, Ints); }

// a b + c, rounded once; twice on the baseline of x86-64, which cannot do otherwise.
inline Floats fused(Floats a, Floats b, Floats c) {
#if defined(__AVX512F__)
    return _mm512_fmadd_ps(a, b, c);
#elif defined(__AVX2__)
    return _mm256_fmadd_ps(a, b, c);
#elif defined(__aarch64__)
    return reinterpret_cast<Floats>(vfmaq_f32(reinterpret_cast<float32x4_t>(c), reinterpret_cast<float32x4_t>(a),
                                              reinterpret_cast<float32x4_t>(b)));
#else
    return a * b + c;
#endif
}

// The polynomial of these coefficients, the last one that of the highest power.
template <int COUNT>
inline Floats polynomial(Floats x, const float (&coefficients)[COUNT]) {
    Floats sum = all(coefficients[COUNT - 1]);
#pragma GCC unroll 8
    for (int k = COUNT - 2; k >= 0; --k) {
        sum = fused(sum, x, all(coefficients[k]));
    }
    return sum;
}

constexpr unsigned EVERY = (1U << WIDTH) - 1; // one bit a lane, all set

inline Ints lane_numbers() {
    Ints result{};
    for (int l = 0; l < WIDTH; ++l) {
        result[l] = l;
    }
    return result;
}

// One bit a lane.
inline unsigned bits(Ints mask) {
#if defined(__AVX512DQ__)
    return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask));
#elif defined(__AVX2__)
    return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
    unsigned result = 0;
    for (int l = 0; l < WIDTH; ++l) {
        result |= (mask[l] != 0 ? 1U : 0U) << l;
    }
    return result;
#endif
}

inline bool any(Ints mask) { return bits(mask) != 0; }

inline Floats root(Floats x) {
#if defined(__AVX512F__)
    return _mm512_sqrt_ps(x);
#elif defined(__AVX2__)
    return _mm256_sqrt_ps(x);
#else
    for (int l = 0; l < WIDTH; ++l) {
        x[l] = __builtin_sqrtf(x[l]);
    }
    return x;
#endif
}

// Two tanh for one division, within 5e-7, which may lie beyond 1: a rational function of degree 7/8, fitted by us to
// [-7.9, 7.9].
inline void tanh_both(Floats& x, Floats& y) {
    const auto clipped = [](Floats z) { return least(most(z, all(-7.9F)), all(7.9F)); };
    constexpr float ABOVE[] = {0.999999404F, 0.129226863F, 0.00294851186F, 1.14146796e-05F};
    constexpr float BELOW[] = {1.0F, 0.462558061F, 0.0238035135F, 0.000238395427F, 2.45724124e-07F};
    const Floats u = clipped(x), v = clipped(y), p = u * u, q = v * v;
    const Floats below_u = polynomial(p, BELOW), below_v = polynomial(q, BELOW), inverse = 1.0F / (below_u * below_v);
    x = (u * polynomial(p, ABOVE)) * (below_v * inverse);
    y = (v * polynomial(q, ABOVE)) * (below_u * inverse);
}

// Never beyond 1.
inline Floats tanh(Floats x) {
    Floats unused{};
    tanh_both(x, unused);
    return least(most(x, all(-1.0F)), all(1.0F));
}

// Natural logarithm of normal positive numbers, relative error under 1e-6.
inline Floats logarithm(Floats x) {
    const Ints raw = reinterpret_cast<Ints>(x);
    const Ints shifted = raw - 0x3f3504f3; // the bits of sqrt(1/2): mantissas from sqrt(1/2) to sqrt(2)
    const Ints exponent = shifted >> 23;
    const Floats m = reinterpret_cast<Floats>(raw - (exponent << 23));
    const Floats s = (m - 1.0F) / (m + 1.0F), q = s * s;
    constexpr float SERIES[] = {2.0F, 0.666666667F, 0.4F, 0.285714286F, 0.222222222F};
    return fused(as_floats(exponent), all(0.693147181F), s * polynomial(q, SERIES));
}

// cos and sin by polynomials after reduction to [-pi/4, pi/4]; absolute error under 1e-6 for |x| < 100.
inline void direction(Floats angle, Floats& cosine, Floats& sine) {
    const Floats turns = angle * 0.636619772F;
    const Ints quarter = as_ints(turns + (turns < 0.0F ? all(-0.5F) : all(0.5F)));
    const Floats n = as_floats(quarter);
    const Floats x = fused(n, all(4.37113883e-08F), fused(-n, all(1.57079637F), angle));
    const Floats q = x * x;
    constexpr float SINE[] = {1.0F, -0.166666667F, 0.00833333333F, -0.000198412698F};
    constexpr float COSINE[] = {1.0F, -0.5F, 0.0416666667F, -0.00138888889F, 2.48015873e-05F};
    const Floats s = x * polynomial(q, SINE), c = polynomial(q, COSINE);
    const Ints odd = (quarter & 1) != 0;
    const Floats a = odd ? s : c, b = odd ? c : s;
    cosine = ((quarter + 1) & 2) != 0 ? -a : a;
    sine = (quarter & 2) != 0 ? -b : b;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
