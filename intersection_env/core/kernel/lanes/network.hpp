// The networks, evaluated for all lanes at once.
#pragma once

#include "intersection_env/policy.hpp"
#include "kernel/lanes/lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct LeakyRelu {
    void operator()(Floats& x, Floats& y) const {
        x = most(x, 0.01F * x);
        y = most(y, 0.01F * y);
    }
};

struct Tanh {
    void operator()(Floats& x, Floats& y) const { tanh_both(x, y); }
};

// One layer. All its outputs at a time, on 16 registers too: so many chains hide the latency of a multiply-add, which
// is worth more than keeping every sum in a register.
template <int INPUTS, int UNITS, class Activation>
inline void layer(const float* weight, const float* bias, const Floats* input, Activation activation, Floats* out) {
    Floats sums[UNITS];
#pragma GCC unroll 16
    for (int o = 0; o < UNITS; ++o) {
        sums[o] = all(bias[o]);
    }
#pragma GCC unroll 16
    for (int i = 0; i < INPUTS; ++i) {
#pragma GCC unroll 16
        for (int o = 0; o < UNITS; ++o) {
            sums[o] = fused(all(weight[o * INPUTS + i]), input[i], sums[o]);
        }
    }
#pragma GCC unroll 16
    for (int o = 0; o < UNITS; o += 2) {
        activation(sums[o], sums[o + 1]);
        out[o] = sums[o];
        out[o + 1] = sums[o + 1];
    }
}

// The output before any last activation. input: (INPUTS,) lanes.
template <int INPUTS, int UNITS, class Activation>
__attribute__((noinline)) Floats evaluate(const Network<INPUTS, UNITS>& network, const Floats* input,
                                          Activation activation) {
    Floats first[UNITS], second[UNITS];
    layer<INPUTS, UNITS>(network.weight0, network.bias0, input, activation, first);
    layer<UNITS, UNITS>(network.weight1, network.bias1, first, activation, second);
    Floats sums[4] = {all(network.bias2[0]), Floats{}, Floats{}, Floats{}}; // four short chains instead of a long one
#pragma GCC unroll 16
    for (int o = 0; o < UNITS; ++o) {
        sums[o % 4] = fused(all(network.weight2[o]), second[o], sums[o % 4]);
    }
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
