// libFuzzer on the policy file's reader, and on the networks of every policy that is let in.
#include <cmath>
#include <cstddef>
#include <cstdlib>

#include "fuzz.hpp"
#include "intersection_env/policy.hpp"
#include "kernel/dispatch.hpp"

using namespace intersection_env;

namespace {

template <int INPUTS, class Evaluate>
void evaluate(const Network<INPUTS>& network, Evaluate evaluate) {
    float in[INPUTS], out = 0.0F;
    for (int i = 0; i < INPUTS; ++i) {
        in[i] = static_cast<float>(10 * i - 10);
    }
    evaluate(network, in, 1, &out);
    if (!std::isfinite(out)) {
        std::abort();
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
    } catch (const FormatError&) { // refused: what should happen to most
    }
    return 0;
}
