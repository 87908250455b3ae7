// Takes any lane of a few rows of lanes: result[l] = values[index[l]], the rows counted on.
#pragma once

#include "kernel/lanes/lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

inline Ints pick(const Ints* rows, int count, Ints index) {
#if defined(__AVX512F__)
    const __m512i at = reinterpret_cast<__m512i>(index);
    const auto row = [&](int r) { return reinterpret_cast<__m512i>(rows[r]); };
    if (count == 1) {
        return reinterpret_cast<Ints>(_mm512_permutexvar_epi32(at, row(0)));
    }
    Ints result = reinterpret_cast<Ints>(_mm512_permutex2var_epi32(row(0), at, row(1)));
    for (int r = 2; r < count; ++r) {
        const Ints next = reinterpret_cast<Ints>(_mm512_permutexvar_epi32(at, row(r)));
        result = index >= r * WIDTH ? next : result;
    }
    return result;
#elif defined(__AVX2__)
    Ints result{};
    for (int r = 0; r < count; ++r) {
        const Ints next = reinterpret_cast<Ints>(
            _mm256_permutevar8x32_epi32(reinterpret_cast<__m256i>(rows[r]), reinterpret_cast<__m256i>(index)));
        result = r == 0 ? next : (index >= r * WIDTH ? next : result);
    }
    return result;
#else
    const std::int32_t* values = reinterpret_cast<const std::int32_t*>(rows);
    (void)count;
    Ints result{};
    for (int l = 0; l < WIDTH; ++l) {
        result[l] = values[index[l]];
    }
    return result;
#endif
}

inline Floats pick(const Floats* rows, int count, Ints index) {
    return reinterpret_cast<Floats>(pick(reinterpret_cast<const Ints*>(rows), count, index));
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
