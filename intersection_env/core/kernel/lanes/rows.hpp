// Tables of rows: each lane reads a row of its own, the lanes then hold columns. A row is a number of quads (four
// floats).
#pragma once

#include "kernel/lanes/lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

inline Quad load_quad(const float* from) { return *reinterpret_cast<const Quad*>(from); }

#if defined(__AVX512F__)
inline Floats quads_of(const float* table, const int* offsets, int first) {
    const __m512 low = _mm512_insertf32x4(_mm512_castps128_ps512(_mm_loadu_ps(table + offsets[first])),
                                          _mm_loadu_ps(table + offsets[first + 4]), 1);
    const __m512 middle = _mm512_insertf32x4(low, _mm_loadu_ps(table + offsets[first + 8]), 2);
    return _mm512_insertf32x4(middle, _mm_loadu_ps(table + offsets[first + 12]), 3);
}
#elif defined(__AVX2__)
inline Floats quads_of(const float* table, const int* offsets, int first) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(table + offsets[first])),
                                _mm_loadu_ps(table + offsets[first + 4]), 1);
}
#else
inline Floats quads_of(const float* table, const int* offsets, int first) { return load_quad(table + offsets[first]); }
#endif

// To memory that single lanes are read from next: halves of 32 bytes, as the upper part of 64 is not forwarded.
inline void spread(Ints values, int* out) {
#if defined(__AVX512F__)
    const __m512i whole = reinterpret_cast<__m512i>(values);
    _mm256_store_si256(reinterpret_cast<__m256i*>(out), _mm512_castsi512_si256(whole));
    _mm256_store_si256(reinterpret_cast<__m256i*>(out + 8), _mm512_extracti64x4_epi64(whole, 1));
#else
    *reinterpret_cast<Ints*>(out) = values;
#endif
}

// The values of the wanted lanes, one after the other; what follows them, up to a row, may be overwritten.
inline void compress(Ints values, unsigned wanted, int* out) {
#if defined(__AVX512F__)
    _mm512_storeu_si512(out,
                        _mm512_maskz_compress_epi32(static_cast<__mmask16>(wanted), reinterpret_cast<__m512i>(values)));
#else
    alignas(64) int all_values[WIDTH];
    spread(values, all_values);
    for (; wanted != 0; wanted &= wanted - 1) {
        *out++ = all_values[__builtin_ctz(wanted)];
    }
#endif
}

// Transposes 4 x 4 numbers within every group of four lanes.
inline void transpose(Floats rows[4]) {
    const Floats a = rows[0], b = rows[1], c = rows[2], d = rows[3];
#if defined(__AVX512F__)
    const __m512 ab = _mm512_unpacklo_ps(a, b), cd = _mm512_unpacklo_ps(c, d);
    const __m512 AB = _mm512_unpackhi_ps(a, b), CD = _mm512_unpackhi_ps(c, d);
    rows[0] = _mm512_shuffle_ps(ab, cd, 0x44);
    rows[1] = _mm512_shuffle_ps(ab, cd, 0xee);
    rows[2] = _mm512_shuffle_ps(AB, CD, 0x44);
    rows[3] = _mm512_shuffle_ps(AB, CD, 0xee);
#elif defined(__AVX2__)
    const __m256 ab = _mm256_unpacklo_ps(a, b), cd = _mm256_unpacklo_ps(c, d);
    const __m256 AB = _mm256_unpackhi_ps(a, b), CD = _mm256_unpackhi_ps(c, d);
    rows[0] = _mm256_shuffle_ps(ab, cd, 0x44);
    rows[1] = _mm256_shuffle_ps(ab, cd, 0xee);
    rows[2] = _mm256_shuffle_ps(AB, CD, 0x44);
    rows[3] = _mm256_shuffle_ps(AB, CD, 0xee);
#else
    rows[0] = Floats{a[0], b[0], c[0], d[0]};
    rows[1] = Floats{a[1], b[1], c[1], d[1]};
    rows[2] = Floats{a[2], b[2], c[2], d[2]};
    rows[3] = Floats{a[3], b[3], c[3], d[3]};
#endif
}

// out: 4 * QUADS columns of the rows that begin `offset` floats into the table.
template <int QUADS>
inline void load_rows(const float* table, Ints offset, Floats* out) {
    alignas(64) int offsets[WIDTH];
    spread(offset, offsets);
    asm("" : "+m"(offsets)); // addresses come from memory: taking a register apart is slower
#pragma GCC unroll 4
    for (int quad = 0; quad < QUADS; ++quad) {
        Floats* rows = out + 4 * quad;
#pragma GCC unroll 4
        for (int r = 0; r < 4; ++r) {
            rows[r] = quads_of(table + 4 * quad, offsets, r);
        }
        transpose(rows);
    }
}

// The other way: writes 4 * QUADS columns as one row a lane, `stride` floats apart, for the lanes in `wanted`.
template <int QUADS>
inline void store_rows(const Floats* columns, float* table, long stride, unsigned wanted) {
#pragma GCC unroll 4
    for (int quad = 0; quad < QUADS; ++quad) {
        alignas(64) Floats rows[4];
        for (int r = 0; r < 4; ++r) {
            rows[r] = columns[4 * quad + r];
        }
        transpose(rows);
        const float* from = reinterpret_cast<const float*>(rows);
        const auto store = [&](int l) {
            *reinterpret_cast<Quad*>(table + l * stride + 4 * quad) = load_quad(from + (l % 4) * WIDTH + l / 4 * 4);
        };
        if (wanted == EVERY) {
#pragma GCC unroll 16
            for (int l = 0; l < WIDTH; ++l) {
                store(l);
            }
        } else {
            for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
                store(__builtin_ctz(lanes));
            }
        }
    }
}

// Any number of columns; table: a row a lane.
inline void store_columns(const Floats* columns, int count, float* table, long stride, unsigned wanted) {
    int c = 0;
    for (; c + 4 <= count; c += 4) {
        store_rows<1>(columns + c, table + c, stride, wanted);
    }
    for (; c < count; ++c) {
        for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
            const int l = __builtin_ctz(lanes);
            table[l * stride + c] = columns[c][l];
        }
    }
}

inline void load_columns(const float* table, int count, long stride, unsigned wanted, Floats* columns) {
    const Ints lane = lane_numbers() * static_cast<int>(stride);
    int c = 0;
    for (; wanted == EVERY && c + 4 <= count; c += 4) {
        load_rows<1>(table + c, lane, columns + c);
    }
    for (; c < count; ++c) {
        columns[c] = all(0.0F);
        for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
            const int l = __builtin_ctz(lanes);
            columns[c][l] = table[l * stride + c];
        }
    }
}

// 4 * QUADS columns, linearly between rows of `4 * STRIDE_QUADS` floats; the end rows hold beyond the ends.
// first: where the lane's first row begins, in rows; last: its number of rows less one.
template <int QUADS, int STRIDE_QUADS>
inline void interpolate(const float* table, Ints first, Floats last, Floats x, Floats* out) {
    x = least(most(x, all(0.0F)), last);
    const Ints end = as_ints(last) - 1;
    Ints row = as_ints(x);
    row = row < end ? row : end;
    const Floats f = x - as_floats(row);
    const Ints offset = (first + row) * (4 * STRIDE_QUADS);
    Floats high[4 * QUADS];
    load_rows<QUADS>(table, offset, out);
    load_rows<QUADS>(table + 4 * STRIDE_QUADS, offset, high);
    for (int c = 0; c < 4 * QUADS; ++c) {
        out[c] = fused(f, high[c] - out[c], out[c]);
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
