// The scenarios of one prediction, one in each lane: their vehicles, what these see, and what pairs say to them.
#pragma once

#include "kernel/step/decide.hpp"
#include "kernel/step/drive.hpp"
#include "kernel/step/observe.hpp"
#include "kernel/step/safety.hpp"
#include "kernel/step/stops.hpp"
#include "kernel/step/vehicle.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

struct PredictedVehicle : VehicleLanes {
    Ints present;
    Floats time_loss;
    Ints refused_by_assignment; // mask, from the pairs
    Ints turn;                  // at an all-way stop
};

struct ScenarioLanes {
    PredictedVehicle vehicles[MAX_VEHICLES];
    Ints assignments[MAX_PAIRS];
};

// Every scenario as the traffic is now.
inline void start(const Problem& problem, ScenarioLanes& lanes) {
    for (int i = 0; i < problem.vehicle_count; ++i) {
        const ProblemVehicle& known = problem.vehicles[i];
        PredictedVehicle& vehicle = lanes.vehicles[i];
        vehicle.position = all(known.position);
        vehicle.speed = all(known.speed);
        vehicle.time_loss = all(0.0F);
        vehicle.present = all_ints(known.position < known.route_length ? -1 : 0);
        vehicle.delta = all_ints(known.delta ? -1 : 0);
        vehicle.hold = all_ints(known.hold);
        vehicle.waited = all_ints(known.waited);
    }
}

// Needs observe_road of every vehicle first.
inline void observe_lead(const Problem& problem, ScenarioLanes& lanes, int i) {
    PredictedVehicle& ego = lanes.vehicles[i];
    forget_lead(ego);
    const ProblemVehicle& known = problem.vehicles[i];
    for (int c = known.first_candidate; c < known.last_candidate; ++c) {
        const LeadCandidate& candidate = problem.candidates[c];
        const PredictedVehicle& other = lanes.vehicles[candidate.other];
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

inline Encounter encounter(const ProblemPair& pair, const ScenarioLanes& lanes) {
    return encounter(lanes.vehicles[pair.yielder], all(pair.yielder_end), lanes.vehicles[pair.prioritized],
                     all(pair.line), all(pair.prioritized_end), all_ints(pair.merging ? -1 : 0));
}

// Mask: both are there, and the second must still let the first pass.
inline Ints active(const ProblemPair& pair, Ints assignment, const ScenarioLanes& lanes) {
    const PredictedVehicle &i = lanes.vehicles[pair.yielder], &j = lanes.vehicles[pair.prioritized];
    const Ints second_is_yielder = (i.rear < pair.yielder_end) & (j.position < pair.prioritized_end);
    const Ints second_is_prioritized = (j.rear < pair.prioritized_end) & (i.position < pair.yielder_end);
    return i.present & j.present & (assignment > 0 ? second_is_prioritized : second_is_yielder);
}

// Needs observe_road of every vehicle first.
inline void remember_stops(const Problem& problem, ScenarioLanes& lanes) {
    for (int i = 0; i < problem.vehicle_count; ++i) {
        PredictedVehicle& vehicle = lanes.vehicles[i];
        remember_stop(all_ints(problem.vehicles[i].must_stop ? -1 : 0), vehicle.present, vehicle);
        vehicle.turn = turn(vehicle.waited, vehicle.hold == problem.route_count, settled(vehicle),
                            vehicle.distance_to_stop_line < vehicle.braking_distance);
    }
}

// What a pair says to both of its vehicles; masks.
struct Answer {
    Ints refuses_yielder, refuses_prioritized;
    Ints tells_yielder, tells_prioritized; // of these, those that an assignment refuses
    Ints keeps_prioritized;
};

// Assigned priorities first, then the order of arrival, or the rule or the gap network. where: which scenarios count.
inline Answer answer(const Problem& problem, const ProblemPair& pair, Ints assignment, Ints where,
                     const ScenarioLanes& lanes) {
    const PredictedVehicle &i = lanes.vehicles[pair.yielder], &j = lanes.vehicles[pair.prioritized];
    const int rank = problem.vehicles[pair.yielder].rank;
    Ints way = assignment, told = all_ints(-1);
    if (pair.by_arrival) {
        told = assignment != 0;
        way = told ? assignment : by_arrival(i.turn, j.turn, j.hold, all_ints(rank));
    }
    const Ints open_pair = active(pair, way, lanes) & where;
    const Ints to_i = open_pair & (way < 0), to_j = open_pair & (way > 0);
    const Ints unassigned = open_pair & (way == 0), open = unassigned & (j.hold <= rank);
    const Ints asked = open & ~i.refused & ~settled(i); // elsewhere the answer changes nothing
    Ints refused = to_i;
    if (any(asked)) {
        refused |= asked & ~accepts_gap(problem.gap, problem.gap_network, encounter(pair, lanes),
                                        all(problem.vehicles[pair.yielder].patience));
    }
    return {refused, to_j, to_i & told, to_j & told, unassigned & settled(i) & ~j.delta};
}

inline void decide_pair(const Problem& problem, const ProblemPair& pair, Ints assignment, Ints where,
                        ScenarioLanes& lanes) {
    const Answer found = answer(problem, pair, assignment, where, lanes);
    PredictedVehicle &i = lanes.vehicles[pair.yielder], &j = lanes.vehicles[pair.prioritized];
    i.refused |= found.refuses_yielder;
    i.refused_by_assignment |= found.tells_yielder;
    j.refused |= found.refuses_prioritized;
    j.refused_by_assignment |= found.tells_prioritized;
    j.kept |= found.keeps_prioritized;
}

// All that vehicles see, and what they remember of stops; before the pairs have been asked.
inline void observe_vehicles(const Problem& problem, bool headings, ScenarioLanes& lanes) {
    const int count = problem.vehicle_count;
    for (int i = 0; i < count; ++i) {
        const ProblemVehicle& known = problem.vehicles[i];
        const UniformVehicle same{known.half_length,
                                  known.max_speed,
                                  known.stop_line,
                                  known.first_conflict,
                                  static_cast<float>(known.last_row),
                                  known.first_row};
        observe_road(problem.observed, problem.inverse_spacing, same, headings, lanes.vehicles[i]);
        PredictedVehicle& vehicle = lanes.vehicles[i];
        vehicle.refused = vehicle.refused_by_assignment = vehicle.kept = Ints{};
    }
    if (problem.has_stops) {
        remember_stops(problem, lanes);
    }
    for (int i = 0; i < count; ++i) {
        observe_lead(problem, lanes, i);
    }
}

// After all pairs.
inline void decide_vehicles(const Problem& problem, ScenarioLanes& lanes) {
    for (int i = 0; i < problem.vehicle_count; ++i) {
        PredictedVehicle& vehicle = lanes.vehicles[i];
        decide_vehicle(vehicle, vehicle.refused_by_assignment ? all_ints(problem.route_count)
                                                              : all_ints(problem.vehicles[i].rank));
    }
}

inline Floats smallest_distance(const Problem& problem, const ScenarioLanes& lanes, Floats so_far) {
    Rectangle<Floats> bodies[MAX_VEHICLES];
    for (int i = 0; i < problem.vehicle_count; ++i) {
        bodies[i] = body(problem, problem.vehicles[i], lanes.vehicles[i]);
    }
    for (int t = 0; t < problem.touch_count; ++t) {
        const Touch& touch = problem.touches[t];
        const PredictedVehicle &a = lanes.vehicles[touch.a], &b = lanes.vehicles[touch.b];
        so_far = nearer(touch, a.present & b.present, a, b, bodies, so_far);
    }
    return so_far;
}

// Moves the vehicle by one step; returns the acceleration that came of it.
inline Floats advance(const ProblemVehicle& known, Floats acceleration, PredictedVehicle& vehicle) {
    vehicle.time_loss += vehicle.present ? DT * (1.0F - vehicle.speed / vehicle.v_max()) : all(0.0F);
    const Floats applied = advance(acceleration, 0.0F, vehicle.present, vehicle);
    vehicle.present &= vehicle.position < known.route_length;
    return applied;
}

} // namespace intersection_env::INTERSECTION_ENV_ISA
