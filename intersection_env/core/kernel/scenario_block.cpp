// One block of scenarios over the whole horizon: a scenario in each lane.
#include "kernel/kernel.hpp"
#include "kernel/step/decide.hpp"
#include "kernel/step/drive.hpp"
#include "kernel/step/observe.hpp"
#include "kernel/step/safety.hpp"
#include "kernel/step/stops.hpp"
#include "kernel/step/vehicle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

struct PredictedVehicle : VehicleLanes {
    Ints present;
    Floats time_loss;
    Ints refused_by_assignment; // mask, from the pairs
    Ints turn;                  // at an all-way stop
};

struct ScenarioBlock {
    PredictedVehicle vehicles[MAX_VEHICLES];
    Ints assignments[MAX_PAIRS];
};

void start(const Problem& problem, const ScenarioArguments& arguments, ScenarioBlock& block) {
    const int count = problem.vehicle_count, pairs = problem.pair_count;
    for (int i = 0; i < count; ++i) {
        const ProblemVehicle& known = problem.vehicles[i];
        PredictedVehicle& vehicle = block.vehicles[i];
        vehicle.position = all(known.position);
        vehicle.speed = all(known.speed);
        vehicle.time_loss = all(0.0F);
        vehicle.present = all_ints(known.position < known.route_length ? -1 : 0);
        vehicle.delta = all_ints(known.delta ? -1 : 0);
        vehicle.hold = all_ints(known.hold);
        vehicle.waited = all_ints(known.waited);
    }
    for (int p = 0; p < pairs; ++p) {
        block.assignments[p] = Ints{};
        for (int l = 0; arguments.assignments != nullptr && l < WIDTH; ++l) {
            const int scenario = l < arguments.scenarios ? l : arguments.scenarios - 1;
            block.assignments[p][l] = arguments.assignments[static_cast<long>(scenario) * pairs + p];
        }
    }
}

// Needs observe_road of every vehicle first.
void observe_lead(const Problem& problem, ScenarioBlock& block, int i) {
    PredictedVehicle& ego = block.vehicles[i];
    forget_lead(ego);
    const ProblemVehicle& known = problem.vehicles[i];
    for (int c = known.first_candidate; c < known.last_candidate; ++c) {
        const LeadCandidate& candidate = problem.candidates[c];
        const PredictedVehicle& other = block.vehicles[candidate.other];
        const Floats ahead = other.position - candidate.offset - ego.position;
        Ints leads = other.present & (ahead > 0.0F);
        if (candidate.begin > -FAR) {
            leads &= other.front > candidate.begin;
        }
        if (candidate.end < FAR) {
            leads &= (ego.rear < candidate.end) & (other.rear - candidate.offset < candidate.end);
        }
        follow(ego, leads, ahead - candidate.half_lengths, other.speed,
               candidate.same_stop_lane ? other.hold : all_ints(-1));
    }
}

Encounter encounter(const ProblemPair& pair, const ScenarioBlock& block) {
    return encounter(block.vehicles[pair.yielder], all(pair.yielder_end), block.vehicles[pair.prioritized],
                     all(pair.line), all(pair.prioritized_end), all_ints(pair.merging ? -1 : 0));
}

// Mask: both are there, and the second must still let the first pass.
Ints active(const ProblemPair& pair, Ints assignment, const ScenarioBlock& block) {
    const PredictedVehicle &i = block.vehicles[pair.yielder], &j = block.vehicles[pair.prioritized];
    const Ints second_is_yielder = (i.rear < pair.yielder_end) & (j.position < pair.prioritized_end);
    const Ints second_is_prioritized = (j.rear < pair.prioritized_end) & (i.position < pair.yielder_end);
    return i.present & j.present & (assignment > 0 ? second_is_prioritized : second_is_yielder);
}

// Needs observe_road of every vehicle first.
void remember_stops(const Problem& problem, ScenarioBlock& block) {
    for (int i = 0; i < problem.vehicle_count; ++i) {
        PredictedVehicle& vehicle = block.vehicles[i];
        remember_stop(all_ints(problem.vehicles[i].must_stop ? -1 : 0), vehicle.present, vehicle);
        vehicle.turn = turn(vehicle.waited, vehicle.hold == problem.route_count, settled(vehicle),
                            vehicle.distance_to_stop_line < vehicle.braking_distance);
    }
}

// Assigned priorities first, then the order of arrival, or the rule or the gap network.
void decide_pair(const Problem& problem, const ProblemPair& pair, Ints assignment, ScenarioBlock& block) {
    PredictedVehicle &i = block.vehicles[pair.yielder], &j = block.vehicles[pair.prioritized];
    const int route = problem.vehicles[pair.yielder].route;
    Ints way = assignment, told = all_ints(-1);
    if (pair.by_arrival) {
        told = assignment != 0;
        way = told ? assignment : by_arrival(i.turn, j.turn, j.hold, all_ints(route));
    }
    const Ints open_pair = active(pair, way, block);
    const Ints to_i = open_pair & (way < 0), to_j = open_pair & (way > 0);
    const Ints unassigned = open_pair & (way == 0), open = unassigned & (j.hold <= route);
    i.refused |= to_i;
    const Ints asked = open & ~i.refused & ~settled(i); // elsewhere the answer changes nothing
    if (any(asked)) {
        i.refused |= asked & ~accepts_gap(problem.gap, problem.gap_network, encounter(pair, block),
                                          all(problem.vehicles[pair.yielder].patience));
    }
    i.refused_by_assignment |= to_i & told;
    j.refused |= to_j;
    j.kept |= unassigned & settled(i) & ~j.delta;
    j.refused_by_assignment |= to_j & told;
}

void observe_and_decide(const Problem& problem, bool headings, ScenarioBlock& block) {
    const int count = problem.vehicle_count;
    for (int i = 0; i < count; ++i) {
        const ProblemVehicle& known = problem.vehicles[i];
        const UniformVehicle same{known.half_length,
                                  known.max_speed,
                                  known.stop_line,
                                  known.first_conflict,
                                  static_cast<float>(known.last_row),
                                  known.first_row};
        observe_road(problem.observed, problem.inverse_spacing, same, headings, block.vehicles[i]);
        PredictedVehicle& vehicle = block.vehicles[i];
        vehicle.refused = vehicle.refused_by_assignment = vehicle.kept = Ints{};
    }
    if (problem.has_stops) {
        remember_stops(problem, block);
    }
    for (int i = 0; i < count; ++i) {
        observe_lead(problem, block, i);
    }
    for (int p = 0; p < problem.pair_count; ++p) {
        decide_pair(problem, problem.pairs[p], block.assignments[p], block);
    }
    for (int i = 0; i < count; ++i) {
        PredictedVehicle& vehicle = block.vehicles[i];
        decide_vehicle(vehicle, vehicle.refused_by_assignment ? all_ints(problem.route_count)
                                                              : all_ints(problem.vehicles[i].route));
    }
}

Floats smallest_distance(const Problem& problem, const ScenarioBlock& block, Floats so_far) {
    Rectangle<Floats> bodies[MAX_VEHICLES];
    for (int i = 0; i < problem.vehicle_count; ++i) {
        bodies[i] = body(problem, problem.vehicles[i], block.vehicles[i]);
    }
    for (int t = 0; t < problem.touch_count; ++t) {
        const Touch& touch = problem.touches[t];
        const PredictedVehicle &a = block.vehicles[touch.a], &b = block.vehicles[touch.b];
        so_far = nearer(touch, a.present & b.present, a, b, bodies, so_far);
    }
    return so_far;
}

// Mask: somebody enters a conflict before the one that was assigned to go first has cleared it.
Ints disobeyed(const Problem& problem, const ScenarioBlock& block) {
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

// Moves the vehicle by one step; returns the acceleration that came of it.
Floats advance(const ProblemVehicle& known, Floats acceleration, PredictedVehicle& vehicle) {
    vehicle.time_loss += vehicle.present ? DT * (1.0F - vehicle.speed / vehicle.v_max()) : all(0.0F);
    const Floats applied = advance(acceleration, 0.0F, vehicle.present, vehicle);
    vehicle.present &= vehicle.position < known.route_length;
    return applied;
}

void replay_decisions(const ScenarioArguments& arguments, int count, int step, ScenarioBlock& block) {
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
    ScenarioBlock& block = reinterpret_cast<ScenarioBlock&>(workspace);
    const int count = problem.vehicle_count;
    const bool wants_trajectories = arguments.trajectories.position != nullptr;
    const IdmParameters& p = problem.idm;
    const float inverse_root = 0.5F / __builtin_sqrtf(p.acceleration * p.deceleration);
    Floats distance = all(NO_DISTANCE);
    Ints wrong{};
    start(problem, arguments, block);
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
    ScenarioBlock& block = reinterpret_cast<ScenarioBlock&>(workspace);
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

Workspace* create_scenario_block() { return reinterpret_cast<Workspace*>(new ScenarioBlock); }
void destroy_scenario_block(Workspace* workspace) { delete reinterpret_cast<ScenarioBlock*>(workspace); }

} // namespace intersection_env::INTERSECTION_ENV_ISA
