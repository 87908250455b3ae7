// The two networks, evaluated for all lanes at once.
#pragma once

#include "kernel/lanes.hpp"
#include "policy.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct LeakyRelu {
    Floats operator()(Floats x) const { return most(x, 0.01F * x); }
};

struct Tanh {
    Floats operator()(Floats x) const { return tanh(x); }
};

// The output before any last activation. input: (INPUTS,) lanes.
template <int INPUTS, class Activation>
inline Floats evaluate(const Network<INPUTS>& network, const Floats* input, Activation activation) {
    Floats first[HIDDEN], second[HIDDEN];
    for (int o = 0; o < HIDDEN; ++o) {
        Floats sum = all(network.bias0[o]);
        for (int i = 0; i < INPUTS; ++i) {
            sum += network.weight0[o * INPUTS + i] * input[i];
        }
        first[o] = activation(sum);
    }
    Floats result = all(network.bias2[0]);
    for (int o = 0; o < HIDDEN; ++o) {
        Floats sum = all(network.bias1[o]);
        for (int i = 0; i < HIDDEN; ++i) {
            sum += network.weight1[o * HIDDEN + i] * first[i];
        }
        second[o] = activation(sum);
    }
    for (int o = 0; o < HIDDEN; ++o) {
        result += network.weight2[o] * second[o];
    }
    return result;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
