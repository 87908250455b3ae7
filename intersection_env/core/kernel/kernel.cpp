// The table of this instruction set's functions.
#include "kernel/kernel.hpp"

#include "kernel/lanes/network.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

#define INTERSECTION_ENV_NAME_(isa) #isa
#define INTERSECTION_ENV_NAME(isa) INTERSECTION_ENV_NAME_(isa)

// From so many scenarios on, a block of them is faster than one after the other; measured.
constexpr int WORTH_A_BLOCK = WIDTH == 16 ? 12 : WIDTH == 8 ? 8 : 4;

template <int INPUTS, class Activation, int UNITS = HIDDEN>
void evaluate_rows(const Network<INPUTS, UNITS>& network, const float* in, long rows, float* out) {
    for (long first = 0; first < rows; first += WIDTH) {
        const long used = rows - first < WIDTH ? rows - first : WIDTH;
        Floats input[INPUTS];
        for (int i = 0; i < INPUTS; ++i) {
            input[i] = all(0.0F);
            for (long l = 0; l < used; ++l) {
                input[i][l] = in[(first + l) * INPUTS + i];
            }
        }
        const Floats result = evaluate(network, input, Activation{});
        for (long l = 0; l < used; ++l) {
            out[first + l] = result[l];
        }
    }
}

} // namespace

extern const Kernel KERNEL = {&INTERSECTION_ENV_NAME(INTERSECTION_ENV_ISA)[4],
                              WIDTH,
                              create_scenario_block,
                              destroy_scenario_block,
                              predict_scenario_block,
                              observe,
                              create_branches,
                              destroy_branches,
                              predict_branching,
                              WORTH_A_BLOCK,
                              create_one_scenario,
                              destroy_one_scenario,
                              predict_one_scenario,
                              gap_logits,
                              evaluate_rows<GAP_INPUTS, LeakyRelu>,
                              evaluate_rows<DRIVING_INPUTS, Tanh>,
                              evaluate_rows<ORDER_INPUTS, Tanh, ORDER_HIDDEN>,
                              create_closed_loop,
                              destroy_closed_loop,
                              run_closed_loop,
                              create_replay,
                              destroy_replay,
                              run_replay,
                              multiply_add,
                              hyperbolic_tangent};

} // namespace intersection_env::INTERSECTION_ENV_ISA
