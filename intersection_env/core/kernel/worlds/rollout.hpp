// A rollout: for so many steps a policy acts, and what it saw, did and was paid is written to arrays
// (world, step, vehicle[, feature]).
#pragma once

#include "kernel/lanes/random.hpp"
#include "kernel/worlds/results.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

constexpr float HALF_LOG_TWO_PI = 0.918938533F;

// The action that a policy samples, and the numbers it came from.
struct Sampled {
    Floats latent, log_probability, value, action;
};

inline Sampled sample_action(const Rollout& r, const Floats* features, Floats normal) {
    const Floats latent = evaluate(*r.policy, features, Tanh{}) + r.sigma * normal;
    const Floats log_probability = -0.5F * normal * normal - (r.log_sigma + HALF_LOG_TWO_PI);
    return {latent, log_probability, evaluate(*r.value, features, Tanh{}), tanh(latent)};
}

// Where the results of one step go. In each array the worlds lie `stride` vehicles apart.
struct Place {
    long first, stride;
    unsigned lanes; // that are written
    int vehicles;

    void put(const Floats* columns, float* results) const {
        store_columns(columns, vehicles, results + first, stride, lanes);
    }
};

// What cut vehicles saw last, until the value network is asked, which takes it a full row of lanes at a time: in most
// steps nobody is cut, or in one lane.
struct LastSeen {
    float features[FEATURES][(MAX_VEHICLES + 1) * WIDTH];
    long place[(MAX_VEHICLES + 1) * WIDTH]; // where the value goes
    int count = 0;

    void add(const Floats* seen, unsigned lanes, long first, long stride) {
        for (int f = 0; f < FEATURES; ++f) {
            compress(reinterpret_cast<Ints>(seen[f]), lanes, reinterpret_cast<int*>(features[f] + count));
        }
        for (; lanes != 0; lanes &= lanes - 1) {
            place[count++] = first + __builtin_ctz(lanes) * stride;
        }
    }

    // Writes the values of full rows; least: what is left to do at least.
    void put(const Rollout& r, int least) {
        while (count >= least && count > 0) {
            const int first = count > WIDTH ? count - WIDTH : 0;
            Floats input[FEATURES];
            for (int f = 0; f < FEATURES; ++f) {
                __builtin_memcpy(&input[f], features[f] + first, sizeof(Floats));
            }
            const Floats value = evaluate(*r.value, input, Tanh{});
            for (int k = first; k < count; ++k) {
                r.value_next[place[k]] = value[k - first];
            }
            count = first;
        }
    }
};

// Samples every vehicle's action, and writes what led to it. Returns through `value` what it expects of each.
template <class Worlds>
inline void act(const Rollout& r, const Place& here, Random& noise, Worlds& worlds, Floats* value) {
    Floats normal[2], latent[MAX_VEHICLES], log_probability[MAX_VEHICLES];
    for (int i = 0; i < here.vehicles; ++i) {
        if (i % 2 == 0) { // a step takes whole pairs of numbers, so that rollouts may be cut anywhere
            noise.normal(all_ints(-1), normal[0], normal[1]);
        }
        Floats features[FEATURES];
        worlds.observe(i, features);
        store_rows<3>(features, r.observation + (here.first + i) * FEATURES, here.stride * FEATURES, here.lanes);
        const Sampled sampled = sample_action(r, features, normal[i % 2]);
        latent[i] = sampled.latent;
        log_probability[i] = sampled.log_probability;
        value[i] = sampled.value;
        worlds.action()[i] = sampled.action;
    }
    here.put(latent, r.latent);
    here.put(log_probability, r.log_probability);
    here.put(value, r.value_now);
}

// Writes what a step led to: rewards, and where it cut returns.
template <class Worlds>
inline void conclude(const Rollout& r, const Place& here, Ints ends, const Worlds& worlds, LastSeen& last) {
    here.put(worlds.paid(), r.reward);
    clear_flags(r.terminated + here.first, here.stride, here.lanes, here.vehicles);
    clear_flags(r.cut + here.first, here.stride, here.lanes, here.vehicles);
    for (int i = 0; i < here.vehicles; ++i) {
        const unsigned cut = here.lanes & bits(ends | worlds.left(i));
        if (cut != 0) {
            set_flags(r.terminated + here.first + i, here.stride, here.lanes & bits(ends & worlds.blamed(i)));
            set_flags(r.cut + here.first + i, here.stride, cut);
            Floats features[FEATURES];
            worlds.observe_last(i, features);
            last.add(features, cut, here.first + i, here.stride);
        }
    }
}

// Rolls out the worlds of one row of lanes, from world `first_world` of the arrays on; false where a new start was not
// found. Worlds are asked for: vehicles(); observe(i, features) now, and observe_last(i, features) before the return
// was cut; action() to be filled, paid() by the last step; step(), which returns the mask of worlds that end; left(i)
// and blamed(i), masks of that step; restart(mask).
template <class Worlds>
inline bool roll_out(const Rollout& r, int steps, long first_world, unsigned lanes, Random& noise, Worlds& worlds) {
    const int vehicles = worlds.vehicles();
    const long stride = static_cast<long>(steps) * vehicles;
    const auto place = [&](long step) {
        return Place{first_world * stride + step * vehicles, stride, lanes, vehicles};
    };
    LastSeen last;
    Floats value[MAX_VEHICLES];
    for (int step = 0; step < steps; ++step) {
        act(r, place(step), noise, worlds, value);
        if (step > 0) {
            place(step - 1).put(value, r.value_next);
            last.put(r, WIDTH); // after it, which wrote there too
        }
        const Ints ends = worlds.step();
        conclude(r, place(step), ends, worlds, last);
        if (any(ends) && !worlds.restart(ends)) {
            return false;
        }
    }
    for (int i = 0; i < vehicles; ++i) {
        Floats features[FEATURES];
        worlds.observe(i, features);
        value[i] = evaluate(*r.value, features, Tanh{});
    }
    place(steps - 1).put(value, r.value_next);
    last.put(r, 1);
    return true;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
