// Lanes: one number of every scenario in a block, at the native width of the instruction set.
#pragma once

#include <cstdint>

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

inline Floats all(float value) { return value - Floats{}; }
inline Ints all_ints(std::int32_t value) { return value - Ints{}; }
inline Floats least(Floats a, Floats b) { return a < b ? a : b; }
inline Floats most(Floats a, Floats b) { return a > b ? a : b; }
inline Ints most(Ints a, Ints b) { return a > b ? a : b; }

inline bool any(Ints mask) {
    std::int32_t sum = 0;
    for (int l = 0; l < WIDTH; ++l) {
        sum |= mask[l];
    }
    return sum != 0;
}

// tanh within 4.5e-7: a rational function of degree 7/8, fitted by us to [-7.9, 7.9].
inline Floats tanh(Floats x) {
    x = least(most(x, all(-7.9F)), all(7.9F));
    const Floats q = x * x;
    const Floats p = x * (0.999999404F + q * (0.129226863F + q * (0.00294851186F + q * 1.14146796e-05F)));
    const Floats d = 1.0F + q * (0.462558061F + q * (0.0238035135F + q * (0.000238395427F + q * 2.45724124e-07F)));
    return least(most(p / d, all(-1.0F)), all(1.0F));
}

// Columns 0 to COUNT - 1 of a table of rows, linearly between its rows; end rows hold beyond the ends.
template <int COUNT, int STRIDE>
inline void interpolate(const float* rows, int last, Floats x, Floats* out) {
    x = least(most(x, all(0.0F)), all(static_cast<float>(last)));
    Ints row = __builtin_convertvector(x, Ints);
    row = row < last - 1 ? row : all_ints(last - 1);
    const Floats f = x - __builtin_convertvector(row, Floats);
    alignas(64) float low[COUNT][WIDTH], high[COUNT][WIDTH];
    for (int l = 0; l < WIDTH; ++l) {
        const float* from = rows + row[l] * STRIDE;
        for (int c = 0; c < COUNT; ++c) {
            low[c][l] = from[c];
            high[c][l] = from[c + STRIDE];
        }
    }
    for (int c = 0; c < COUNT; ++c) {
        const Floats a = *reinterpret_cast<const Floats*>(low[c]), b = *reinterpret_cast<const Floats*>(high[c]);
        out[c] = a + f * (b - a);
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
