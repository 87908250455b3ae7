// What the gap network says about every pair at the start: lanes are pairs.
#include "kernel/kernel.hpp"
#include "kernel/step/decide.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

void gap_logits(const Problem& problem, float* logits) {
    const LaneProblem& p = problem.lanes;
    for (long first = 0; first < problem.pair_count; first += WIDTH) {
        const auto of = [first](const float* values, const std::int32_t* vehicle) {
            Floats picked;
            for (int l = 0; l < WIDTH; ++l) {
                picked[l] = values[vehicle[first + l]];
            }
            return picked;
        };
        Encounter met{};
        met.distance_to_pga =
            lanes_at(p.yielder_end + first) - (of(p.position, p.yielder) - lanes_at(p.yielder_half_length + first));
        met.speed = of(p.speed, p.yielder);
        met.foe_distance_to_line = lanes_at(p.prioritized_line + first) -
                                   (of(p.position, p.prioritized) + lanes_at(p.prioritized_half_length + first));
        met.foe_speed = of(p.speed, p.prioritized);
        const Floats found = gap_logit(*problem.gap_network, met);
        for (long l = 0; l < WIDTH && first + l < problem.pair_count; ++l) {
            logits[p.pair[first + l]] = found[l];
        }
    }
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
