// What this machine can do at best with the kernel's lanes: the yardstick of the benchmarks.
#include "kernel/kernel.hpp"
#include "kernel/lanes/lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// Twelve independent chains: more than the latency of a multiply-add times two units.
float multiply_add(long rounds) {
    Floats sums[12];
    for (int k = 0; k < 12; ++k) {
        sums[k] = all(0.1F * static_cast<float>(k));
    }
    Floats factor = all(0.999F), term = all(0.001F);
    asm("" : "+m"(factor), "+m"(term)); // unknown to the compiler
    for (long round = 0; round < rounds; ++round) {
#pragma GCC unroll 12
        for (int k = 0; k < 12; ++k) {
            sums[k] = fused(sums[k], factor, term);
        }
    }
    float result = 0.0F;
    for (int k = 0; k < 12; ++k) {
        result += sums[k][0];
    }
    return result;
}

float hyperbolic_tangent(long rounds) {
    Floats values[16];
    for (int k = 0; k < 16; ++k) {
        values[k] = all(0.3F * static_cast<float>(k));
    }
    Floats term = all(0.5F);
    asm("" : "+m"(term));
    for (long round = 0; round < rounds; ++round) {
#pragma GCC unroll 8
        for (int k = 0; k < 16; k += 2) {
            values[k] += term;
            values[k + 1] += term;
            tanh_both(values[k], values[k + 1]);
        }
    }
    float result = 0.0F;
    for (int k = 0; k < 16; ++k) {
        result += values[k][0];
    }
    return result;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
