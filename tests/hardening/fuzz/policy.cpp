// libFuzzer on the policy file's reader, and on the networks and the spread of every policy that is let in.
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <vector>

#include "fuzz.hpp"
#include "intersection_env/forecast.hpp"
#include "intersection_env/policy.hpp"
#include "kernel/dispatch.hpp"

using namespace intersection_env;

namespace {

template <int INPUTS, int UNITS, class Evaluate>
void evaluate(const Network<INPUTS, UNITS>& network, Evaluate evaluate) {
    float in[INPUTS], out = 0.0F;
    for (int i = 0; i < INPUTS; ++i) {
        in[i] = static_cast<float>(10 * i - 10);
    }
    evaluate(network, in, 1, &out);
    if (!std::isfinite(out)) {
        std::abort();
    }
}

// Of two vehicles, one of which goes 3 m a step.
void check_quantiles(const Spread& spread) {
    std::vector<float> position(2 * (STEPS + 1));
    for (std::size_t step = 0; step <= STEPS; ++step) {
        position[2 * step] = 3.0F * static_cast<float>(step);
    }
    const std::vector<double> probability{1.0}, levels{0.0, 0.5, 1.0};
    for (const float place : position_quantiles(spread, probability, position.data(), 2, levels)) {
        if (!std::isfinite(place)) {
            std::abort();
        }
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    try {
        const Policy policy = Policy::parse(with_checksum(data, size), "fuzzed.policy");
        if (policy.gap_network) {
            evaluate(*policy.gap_network, kernel().evaluate_gap);
        }
        if (policy.driving_network) {
            evaluate(*policy.driving_network, kernel().evaluate_driving);
        }
        if (policy.forecast) {
            evaluate(policy.forecast->order_network, kernel().evaluate_order);
            check_quantiles(policy.forecast->spread);
        }
    } catch (const FormatError&) { // refused: what should happen to most
    }
    return 0;
}
