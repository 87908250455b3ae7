// Writes what happened in the lanes to arrays in which worlds come first.
#pragma once

#include "kernel/lanes/network.hpp"
#include "kernel/lanes/rows.hpp"
#include "tables/world_arguments.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr int FEATURES = DRIVING_INPUTS;

// The first `count` lanes, one bit each: those that stand for a world. The others are run along, and not written.
inline unsigned used_lanes(int count) { return count >= WIDTH ? EVERY : (1U << count) - 1; }

// Flags of the lanes, `count` of each, `stride` apart: all 0, until set.
inline void clear_flags(std::uint8_t* flags, long stride, unsigned wanted, int count) {
    for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
        __builtin_memset(flags + __builtin_ctz(lanes) * stride, 0, static_cast<unsigned long>(count));
    }
}

inline void set_flags(std::uint8_t* flags, long stride, unsigned mask) {
    for (; mask != 0; mask &= mask - 1) {
        flags[__builtin_ctz(mask) * stride] = 1;
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
