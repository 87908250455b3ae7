// Random numbers, one stream a lane: xoshiro128++ (Blackman, Vigna).
#pragma once

#include "kernel/lanes/lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

inline Words rotated(Words x, int by) { return (x << by) | (x >> (32 - by)); }

// A bijective mixing of 32 bits.
inline Words mixed(Words x) {
    x = (x ^ (x >> 16)) * 0x7feb352dU;
    x = (x ^ (x >> 15)) * 0x846ca68bU;
    return x ^ (x >> 16);
}

struct Random {
    Words s[4];

    // Lanes outside the mask keep their stream as it is; what they return is meaningless.
    Words next(Ints mask) {
        const Words result = rotated(s[0] + s[3], 7) + s[0];
        const Words t = s[1] << 9;
        Words n[4] = {s[0], s[1], s[2], s[3]};
        n[2] ^= n[0];
        n[3] ^= n[1];
        n[1] ^= n[2];
        n[0] ^= n[3];
        n[2] ^= t;
        n[3] = rotated(n[3], 11);
        for (int k = 0; k < 4; ++k) {
            s[k] = mask ? n[k] : s[k];
        }
        return result;
    }

    // In [0, 1), 24 bits.
    Floats uniform(Ints mask) { return as_floats(reinterpret_cast<Ints>(next(mask) >> 8)) * 0x1p-24F; }
    Floats uniform(Ints mask, Floats low, Floats high) { return low + uniform(mask) * (high - low); }

    // In 0 to count - 1.
    Ints index(Ints mask, int count) { return as_ints(uniform(mask) * static_cast<float>(count)); }

    // Two independent standard normal numbers (Box, Muller).
    void normal(Ints mask, Floats& a, Floats& b) {
        const Floats radius = root(-2.0F * logarithm(1.0F - uniform(mask)));
        Floats cosine, sine;
        direction(6.28318531F * uniform(mask), cosine, sine);
        a = radius * cosine;
        b = radius * sine;
    }
};

} // namespace intersection_env::INTERSECTION_ENV_ISA
