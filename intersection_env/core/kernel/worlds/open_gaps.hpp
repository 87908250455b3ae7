// Gap decisions of worlds that wait for the network, which takes them a full row of lanes at a time.
#pragma once

#include "kernel/lanes/network.hpp"
#include "kernel/lanes/rows.hpp"
#include "kernel/step/observe.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct OpenGaps {
    alignas(64) float features[GAP_INPUTS][2 * WIDTH];
    alignas(64) int who[2 * WIDTH]; // asks
    int count;                      // below WIDTH from one call to the next
};

// The network's answers to the first that wait, at most a row of them; calls refuse(who) for each that is refused.
template <class Refuse>
inline void answer(const GapNetwork& network, OpenGaps& open, const Refuse& refuse) {
    const int count = open.count < WIDTH ? open.count : WIDTH;
    Floats input[GAP_INPUTS];
    for (int f = 0; f < GAP_INPUTS; ++f) {
        input[f] = lanes_at(open.features[f]);
    }
    unsigned refused = bits(~(evaluate(network, input, LeakyRelu{}) > 0.0F)) & ((1U << count) - 1);
    for (; refused != 0; refused &= refused - 1) {
        refuse(open.who[__builtin_ctz(refused)]);
    }
    open.count -= count;
    lanes_at(open.who) = lanes_at(open.who + WIDTH);
    for (int f = 0; f < GAP_INPUTS; ++f) {
        lanes_at(open.features[f]) = lanes_at(open.features[f] + WIDTH);
    }
}

// Puts the wanted lanes on the list.
template <class Refuse>
inline void ask(const GapNetwork& network, const Floats (&features)[GAP_INPUTS], Ints who, Ints wanted, OpenGaps& open,
                const Refuse& refuse) {
    const unsigned lanes = bits(wanted);
    compress(who, lanes, open.who + open.count);
    for (int f = 0; f < GAP_INPUTS; ++f) {
        compress(reinterpret_cast<Ints>(features[f]), lanes, reinterpret_cast<int*>(open.features[f] + open.count));
    }
    open.count += __builtin_popcount(lanes);
    if (open.count >= WIDTH) {
        answer(network, open, refuse);
    }
}

// Those that are left.
template <class Refuse>
inline void answer_rest(const GapNetwork* network, OpenGaps& open, const Refuse& refuse) {
    if (open.count > 0) {
        answer(*network, open, refuse);
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
