// Writes what happened in the lanes to arrays in which worlds come first.
#pragma once

#include "kernel/network.hpp"
#include "kernel/table.hpp"
#include "worlds.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr int FEATURES = DRIVING_INPUTS;
constexpr float HALF_LOG_TWO_PI = 0.918938533F;

// Flags (lane, stride), all 0 but where a mask is set.
inline void clear_flags(std::uint8_t* flags, long stride, unsigned wanted) {
    for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
        __builtin_memset(flags + __builtin_ctz(lanes) * stride, 0, static_cast<unsigned long>(stride));
    }
}

inline void set_flags(std::uint8_t* flags, long stride, unsigned mask) {
    for (; mask != 0; mask &= mask - 1) {
        flags[__builtin_ctz(mask) * stride] = 1;
    }
}

// The results of a rollout, of one vehicle at one step: rows of worlds lie `stride` apart.
struct Place {
    long row, stride;
};

inline void put(float* results, Place at, unsigned wanted, Floats values) {
    for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
        const int l = __builtin_ctz(lanes);
        results[at.row + l * at.stride] = values[l];
    }
}

inline void put_flags(std::uint8_t* results, Place at, unsigned wanted, Ints mask) {
    const unsigned set = bits(mask);
    for (unsigned lanes = wanted; lanes != 0; lanes &= lanes - 1) {
        const int l = __builtin_ctz(lanes);
        results[at.row + l * at.stride] = static_cast<std::uint8_t>(set >> l & 1U);
    }
}

// What a sampled action leads to: its place in the results, and the action.
inline Floats sample_action(const Rollout& r, Place at, unsigned lanes, const Floats* features, Floats normal) {
    store_rows<3>(features, r.observation + at.row * FEATURES, at.stride * FEATURES, lanes);
    const Floats latent = evaluate<FEATURES>(*r.policy, features, Tanh{}) + r.sigma * normal;
    put(r.latent, at, lanes, latent);
    put(r.log_probability, at, lanes, -0.5F * normal * normal - (r.log_sigma + HALF_LOG_TWO_PI));
    return tanh(latent);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
