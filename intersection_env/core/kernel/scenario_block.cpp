// One block of scenarios over the whole horizon: a scenario in each lane.
#include "kernel/kernel.hpp"
#include "kernel/scenario_lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

void assign(const Problem& problem, const ScenarioArguments& arguments, ScenarioLanes& block) {
    for (int p = 0; p < problem.pair_count; ++p) {
        block.assignments[p] = Ints{};
        for (int l = 0; arguments.assignments != nullptr && l < WIDTH; ++l) {
            const int scenario = l < arguments.scenarios ? l : arguments.scenarios - 1;
            block.assignments[p][l] = arguments.assignments[static_cast<long>(scenario) * problem.pair_count + p];
        }
    }
}

void observe_and_decide(const Problem& problem, bool headings, ScenarioLanes& block) {
    observe_vehicles(problem, headings, block);
    for (int p = 0; p < problem.pair_count; ++p) {
        decide_pair(problem, problem.pairs[p], block.assignments[p], all_ints(-1), block);
    }
    decide_vehicles(problem, block);
}

// Mask: somebody enters a conflict before the one that was assigned to go first has cleared it.
Ints disobeyed(const Problem& problem, const ScenarioLanes& block) {
    Ints found{};
    for (int p = 0; p < problem.pair_count; ++p) {
        const ProblemPair& pair = problem.pairs[p];
        const Ints assignment = block.assignments[p];
        found |= disobeys(active(pair, assignment, block), assignment,
                          block.vehicles[pair.yielder].front - pair.yielder_entry,
                          block.vehicles[pair.prioritized].front - pair.prioritized_entry);
    }
    return found;
}

void replay_decisions(const ScenarioArguments& arguments, int count, int step, ScenarioLanes& block) {
    for (int i = 0; i < count; ++i) {
        for (int l = 0; l < arguments.scenarios; ++l) {
            const long at = (static_cast<long>(l) * STEPS + step) * count + i;
            block.vehicles[i].delta[l] = arguments.decisions[at] != 0 ? -1 : 0;
        }
    }
}

template <class Value, class Lanes>
void store(Value* out, const ScenarioArguments& arguments, long count, long time, long vehicle, Lanes values) {
    for (int l = 0; l < arguments.scenarios; ++l) {
        out[(static_cast<long>(l) * (STEPS + 1) + time) * count + vehicle] = static_cast<Value>(values[l]);
    }
}

void store_state(const ScenarioArguments& arguments, long count, long time, long i, const PredictedVehicle& vehicle) {
    store(arguments.trajectories.position, arguments, count, time, i, vehicle.position);
    store(arguments.trajectories.speed, arguments, count, time, i, vehicle.speed);
    store(arguments.trajectories.present, arguments, count, time, i, vehicle.present & 1);
}

void store_action(const ScenarioArguments& arguments, long count, long time, long i, const PredictedVehicle& vehicle,
                  Floats acceleration) {
    store(arguments.trajectories.acceleration, arguments, count, time, i, acceleration);
    store(arguments.trajectories.enters, arguments, count, time, i, vehicle.delta & 1);
    if (arguments.trajectories.hold != nullptr) {
        store(arguments.trajectories.hold, arguments, count, time, i, vehicle.hold);
    }
    if (arguments.trajectories.waited != nullptr) {
        store(arguments.trajectories.waited, arguments, count, time, i, vehicle.waited);
    }
}

} // namespace

void predict_scenario_block(const Problem& problem, const ScenarioArguments& arguments, Workspace& workspace) {
    ScenarioLanes& block = reinterpret_cast<ScenarioLanes&>(workspace);
    const int count = problem.vehicle_count;
    const bool wants_trajectories = arguments.trajectories.position != nullptr;
    const float inverse_root = inverse_root_of(problem.idm);
    Floats distance = all(NO_DISTANCE);
    Ints wrong{};
    start(problem, block);
    assign(problem, arguments, block);
    for (int step = 0; step < STEPS; ++step) {
        observe_and_decide(problem, problem.driver == Driver::network, block);
        if (arguments.decisions != nullptr) {
            replay_decisions(arguments, count, step, block);
        }
        if (arguments.minimum_distance != nullptr) {
            distance = smallest_distance(problem, block, distance);
        }
        if (arguments.followed != nullptr) {
            wrong |= disobeyed(problem, block);
        }
        for (int i = 0; i < count; ++i) {
            PredictedVehicle& vehicle = block.vehicles[i];
            if (wants_trajectories) {
                store_state(arguments, count, step, i, vehicle);
            }
            const Floats top_speed = all(problem.vehicles[i].max_speed);
            const Floats wanted = any(vehicle.present) ? drive(problem, inverse_root, top_speed, vehicle) : all(0.0F);
            const Floats applied = advance(problem.vehicles[i], wanted, vehicle);
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
        PredictedVehicle& vehicle = block.vehicles[i];
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
    if (arguments.followed != nullptr) {
        wrong |= disobeyed(problem, block);
        for (int l = 0; l < arguments.scenarios; ++l) {
            arguments.followed[l] = wrong[l] == 0;
        }
    }
}

void observe(const Problem& problem, const ObservationArguments& arguments, Workspace& workspace) {
    ScenarioLanes& block = reinterpret_cast<ScenarioLanes&>(workspace);
    start(problem, block);
    assign(problem, {}, block);
    observe_and_decide(problem, true, block);
    for (int i = 0; i < problem.vehicle_count; ++i) {
        Floats features[DRIVING_INPUTS];
        driving_features(block.vehicles[i], features);
        for (int k = 0; k < DRIVING_INPUTS; ++k) {
            arguments.driving[i * DRIVING_INPUTS + k] = features[k][0];
        }
    }
    for (int p = 0; p < problem.pair_count; ++p) {
        const Encounter met = encounter(problem.pairs[p], block);
        Floats features[GAP_INPUTS];
        gap_features(met, features);
        for (int k = 0; k < GAP_INPUTS; ++k) {
            arguments.gap[p * GAP_INPUTS + k] = features[k][0];
        }
        const Floats patience = all(problem.vehicles[problem.pairs[p].yielder].patience);
        arguments.accepts[p] = accepts_gap(problem.gap, problem.gap_network, met, patience)[0] != 0;
    }
}

Workspace* create_scenario_block() { return reinterpret_cast<Workspace*>(new ScenarioLanes); }
void destroy_scenario_block(Workspace* workspace) { delete reinterpret_cast<ScenarioLanes*>(workspace); }

} // namespace intersection_env::INTERSECTION_ENV_ISA
