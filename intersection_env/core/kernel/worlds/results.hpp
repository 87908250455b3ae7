// Writes what happened in the lanes to arrays in which worlds come first.
#pragma once

#include "kernel/lanes/network.hpp"
#include "kernel/lanes/rows.hpp"
#include "tables/world_arguments.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr int FEATURES = DRIVING_INPUTS;
constexpr float HALF_LOG_TWO_PI = 0.918938533F;

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

// Where the results of a rollout's step go: rows of worlds lie `stride` apart.
struct Place {
    long first, stride;
};

// The action that a policy samples, and the numbers it came from.
struct Sampled {
    Floats latent, log_probability, value, action;
};

inline Sampled sample_action(const Rollout& r, const Floats* features, Floats normal) {
    const Floats latent = evaluate<FEATURES>(*r.policy, features, Tanh{}) + r.sigma * normal;
    const Floats log_probability = -0.5F * normal * normal - (r.log_sigma + HALF_LOG_TWO_PI);
    return {latent, log_probability, evaluate<FEATURES>(*r.value, features, Tanh{}), tanh(latent)};
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
