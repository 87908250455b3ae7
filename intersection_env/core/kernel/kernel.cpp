// One block of scenarios over the whole horizon. Compiled once per instruction set; nothing here may call an
// inline function of the standard library, whose one copy could come from the wrong instruction set.
#include "dispatch.hpp"
#include "kernel/block.hpp"
#include "kernel/decide.hpp"
#include "kernel/drive.hpp"
#include "kernel/observe.hpp"
#include "kernel/safety.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

#define INTERSECTION_ENV_NAME_(isa) #isa
#define INTERSECTION_ENV_NAME(isa) INTERSECTION_ENV_NAME_(isa)

void start(const Problem& problem, const BlockArguments& arguments, Block& block) {
    const int count = problem.vehicle_count, pairs = problem.pair_count;
    for (int i = 0; i < count; ++i) {
        const ProblemVehicle& known = problem.vehicles[i];
        VehicleLanes& vehicle = block.vehicles[i];
        vehicle.position = all(known.position);
        vehicle.speed = all(known.speed);
        vehicle.time_loss = all(0.0F);
        vehicle.present = all_ints(known.position < known.route_length ? -1 : 0);
        vehicle.delta = all_ints(known.committed ? -1 : 0);
        vehicle.hold = all_ints(-1);
    }
    for (int p = 0; p < pairs; ++p) {
        block.assignments[p] = Ints{};
        for (int l = 0; arguments.assignments != nullptr && l < WIDTH; ++l) {
            const int scenario = l < arguments.scenarios ? l : arguments.scenarios - 1;
            block.assignments[p][l] = arguments.assignments[static_cast<long>(scenario) * pairs + p];
        }
    }
}

void observe_and_decide(const Problem& problem, bool headings, Block& block) {
    const int count = problem.vehicle_count;
    for (int i = 0; i < count; ++i) {
        observe_road(problem, problem.vehicles[i], headings, block.vehicles[i]);
        block.vehicles[i].refused = block.vehicles[i].refused_by_assignment = Ints{};
    }
    for (int i = 0; i < count; ++i) {
        observe_lead(problem, block, i);
    }
    for (int p = 0; p < problem.pair_count; ++p) {
        decide_pair(problem, problem.pairs[p], block.assignments[p], block);
    }
    for (int i = 0; i < count; ++i) {
        decide_vehicle(problem, i, block.vehicles[i]);
    }
}

void replay_decisions(const BlockArguments& arguments, int count, int step, Block& block) {
    for (int i = 0; i < count; ++i) {
        for (int l = 0; l < arguments.scenarios; ++l) {
            const long at = (static_cast<long>(l) * STEPS + step) * count + i;
            block.vehicles[i].delta[l] = arguments.decisions[at] != 0 ? -1 : 0;
        }
    }
}

template <class Value, class Lanes>
void store(Value* out, const BlockArguments& arguments, long count, long time, long vehicle, Lanes values) {
    for (int l = 0; l < arguments.scenarios; ++l) {
        out[(static_cast<long>(l) * (STEPS + 1) + time) * count + vehicle] = static_cast<Value>(values[l]);
    }
}

void store_state(const BlockArguments& arguments, long count, long time, long i, const VehicleLanes& vehicle) {
    store(arguments.trajectories.position, arguments, count, time, i, vehicle.position);
    store(arguments.trajectories.speed, arguments, count, time, i, vehicle.speed);
    store(arguments.trajectories.present, arguments, count, time, i, vehicle.present & 1);
}

void store_action(const BlockArguments& arguments, long count, long time, long i, const VehicleLanes& vehicle,
                  Floats acceleration) {
    store(arguments.trajectories.acceleration, arguments, count, time, i, acceleration);
    store(arguments.trajectories.enters, arguments, count, time, i, vehicle.delta & 1);
}

void run(const Problem& problem, const BlockArguments& arguments, Workspace& workspace) {
    Block& block = reinterpret_cast<Block&>(workspace);
    const int count = problem.vehicle_count;
    const bool wants_trajectories = arguments.trajectories.position != nullptr;
    const IdmParameters& p = problem.idm;
    const float inverse_root = 0.5F / __builtin_sqrtf(p.acceleration * p.deceleration);
    Floats distance = all(NO_DISTANCE);
    start(problem, arguments, block);
    for (int step = 0; step < STEPS; ++step) {
        observe_and_decide(problem, problem.driver == Driver::network, block);
        if (arguments.decisions != nullptr) {
            replay_decisions(arguments, count, step, block);
        }
        if (arguments.minimum_distance != nullptr) {
            distance = smallest_distance(problem, block, distance);
        }
        for (int i = 0; i < count; ++i) {
            VehicleLanes& vehicle = block.vehicles[i];
            if (wants_trajectories) {
                store_state(arguments, count, step, i, vehicle);
            }
            const Floats applied = advance(problem.vehicles[i], drive(problem, inverse_root, vehicle), vehicle);
            if (wants_trajectories) {
                store_action(arguments, count, step, i, vehicle, applied);
                if (step == STEPS - 1) {
                    store_state(arguments, count, STEPS, i, vehicle);
                    store_action(arguments, count, STEPS, i, vehicle, applied);
                }
            }
        }
    }
    for (int i = 0; i < count; ++i) {
        VehicleLanes& vehicle = block.vehicles[i];
        vehicle.front = vehicle.position + problem.vehicles[i].half_length;
        vehicle.rear = vehicle.position - problem.vehicles[i].half_length;
        for (int l = 0; l < arguments.scenarios; ++l) {
            arguments.time_loss[static_cast<long>(l) * count + i] = vehicle.time_loss[l];
        }
    }
    if (arguments.minimum_distance != nullptr) {
        distance = smallest_distance(problem, block, distance);
        for (int l = 0; l < arguments.scenarios; ++l) {
            arguments.minimum_distance[l] = distance[l];
        }
    }
}

void observe(const Problem& problem, const ObservationArguments& arguments, Workspace& workspace) {
    Block& block = reinterpret_cast<Block&>(workspace);
    start(problem, {}, block);
    observe_and_decide(problem, true, block);
    for (int i = 0; i < problem.vehicle_count; ++i) {
        Floats features[DRIVING_INPUTS];
        driving_features(block.vehicles[i], features);
        for (int k = 0; k < DRIVING_INPUTS; ++k) {
            arguments.driving[i * DRIVING_INPUTS + k] = features[k][0];
        }
    }
    for (int p = 0; p < problem.pair_count; ++p) {
        const ProblemPair& pair = problem.pairs[p];
        const VehicleLanes &yielder = block.vehicles[pair.yielder], &foe = block.vehicles[pair.prioritized];
        Floats features[GAP_INPUTS];
        gap_features(pair, yielder, foe, features);
        for (int k = 0; k < GAP_INPUTS; ++k) {
            arguments.gap[p * GAP_INPUTS + k] = features[k][0];
        }
        arguments.accepts[p] = accepts_gap(problem, pair, yielder, foe)[0] != 0;
    }
}

template <int INPUTS, class Activation>
void evaluate_rows(const Network<INPUTS>& network, const float* in, long rows, float* out) {
    for (long first = 0; first < rows; first += WIDTH) {
        const long used = rows - first < WIDTH ? rows - first : WIDTH;
        Floats input[INPUTS];
        for (int i = 0; i < INPUTS; ++i) {
            input[i] = all(0.0F);
            for (long l = 0; l < used; ++l) {
                input[i][l] = in[(first + l) * INPUTS + i];
            }
        }
        const Floats result = evaluate<INPUTS>(network, input, Activation{});
        for (long l = 0; l < used; ++l) {
            out[first + l] = result[l];
        }
    }
}

Workspace* create() { return reinterpret_cast<Workspace*>(new Block); }
void destroy(Workspace* workspace) { delete reinterpret_cast<Block*>(workspace); }

} // namespace

extern const Kernel KERNEL = {&INTERSECTION_ENV_NAME(INTERSECTION_ENV_ISA)[4],
                              WIDTH,
                              create,
                              destroy,
                              run,
                              evaluate_rows<GAP_INPUTS, LeakyRelu>,
                              evaluate_rows<DRIVING_INPUTS, Tanh>,
                              observe};

} // namespace intersection_env::INTERSECTION_ENV_ISA
