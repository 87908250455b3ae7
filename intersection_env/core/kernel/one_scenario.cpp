// One scenario over the whole horizon: lanes are vehicles, and pairs of vehicles, instead of scenarios.
#include "kernel/kernel.hpp"
#include "kernel/lanes/pick.hpp"
#include "kernel/step/decide.hpp"
#include "kernel/step/drive.hpp"
#include "kernel/step/observe.hpp"
#include "kernel/step/safety.hpp"
#include "kernel/step/stops.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

constexpr int MAX_ROWS = MAX_VEHICLES / WIDTH;

// A row of vehicles.
struct VehicleRow : VehicleLanes {
    Floats half_length, max_speed, stop_line, first_conflict, route_length, last_row, time_loss;
    Ints first_row, rank, present, must_stop;

    Ints first() const { return first_row; }
    Floats last() const { return last_row; }
    Floats top_speed() const { return max_speed; }
};

struct OneScenario {
    VehicleRow rows[MAX_ROWS];
    int count;                                                   // of rows
    Floats position[MAX_ROWS], speed[MAX_ROWS], v_max[MAX_ROWS]; // to pick from; who is absent stands far away
    Ints hold[MAX_ROWS];
    Ints turn[MAX_ROWS];                                // at an all-way stop
    Ints settled[MAX_ROWS], enters[MAX_ROWS];           // masks, from before this step
    Ints decided[MAX_ROWS];                             // masks: no gap decision changes what they do at this step
    std::uint64_t refused, refused_by_assignment, kept; // one bit a vehicle
    Floats x[MAX_ROWS], y[MAX_ROWS], cosine[MAX_ROWS], sine[MAX_ROWS];
};

void start(const LaneProblem& p, OneScenario& run) {
    run.count = (p.vehicles + WIDTH - 1) / WIDTH;
    for (int r = 0; r < run.count; ++r) {
        VehicleRow& row = run.rows[r];
        const long at = static_cast<long>(r) * WIDTH;
        row.half_length = lanes_at(p.half_length + at);
        row.max_speed = lanes_at(p.max_speed + at);
        row.stop_line = lanes_at(p.stop_line + at);
        row.first_conflict = lanes_at(p.first_conflict + at);
        row.route_length = lanes_at(p.route_length + at);
        row.last_row = lanes_at(p.last_row + at);
        row.first_row = lanes_at(p.first_row + at);
        row.rank = lanes_at(p.rank + at);
        row.position = lanes_at(p.position + at);
        row.speed = lanes_at(p.speed + at);
        row.delta = lanes_at(p.delta + at);
        row.hold = lanes_at(p.hold + at);
        row.waited = lanes_at(p.waited + at);
        row.must_stop = lanes_at(p.must_stop + at);
        row.present = row.position < row.route_length;
        row.time_loss = all(0.0F);
    }
}

void publish(OneScenario& run) {
    for (int r = 0; r < run.count; ++r) {
        const VehicleRow& row = run.rows[r];
        run.position[r] = row.present ? row.position : all(FAR);
        run.speed[r] = row.speed;
        run.hold[r] = row.hold;
    }
}

// Of a row of vehicles.
void remember_stops(const Problem& problem, int r, OneScenario& run) {
    VehicleRow& row = run.rows[r];
    row.refused = Ints{};
    remember_stop(row.must_stop, row.present, row);
    run.turn[r] = turn(row.waited, row.hold == problem.route_count, run.settled[r],
                       row.distance_to_stop_line < row.braking_distance);
    run.refused |= std::uint64_t{bits(row.refused)} << (r * WIDTH);
    run.decided[r] |= row.refused;
}

void observe(const Problem& problem, OneScenario& run) {
    const LaneProblem& p = problem.lanes;
    for (int r = 0; r < run.count; ++r) {
        VehicleRow& row = run.rows[r];
        observe_road(problem.observed, problem.inverse_spacing, row, problem.driver == Driver::network, row);
        run.v_max[r] = row.v_max();
        run.enters[r] = row.delta;
        run.settled[r] = run.decided[r] = settled(row);
        if (problem.has_stops) {
            remember_stops(problem, r, run);
        }
        forget_lead(row);
        for (int k = 0; k < p.candidates; ++k) {
            const long at = static_cast<long>(k) * p.padded_vehicles + static_cast<long>(r) * WIDTH;
            const Ints other = lanes_at(p.other + at);
            const Floats half_length = lanes_at(p.other_half_length + at);
            const Floats begin = lanes_at(p.begin + at), end = lanes_at(p.end + at);
            const Floats position = pick(run.position, run.count, other), speed = pick(run.speed, run.count, other);
            const Floats there = position - lanes_at(p.offset + at), ahead = there - row.position;
            const Ints in_lane = (row.rear < end) & (there - half_length < end) & (position + half_length > begin);
            const Ints held = pick(run.hold, run.count, other) | lanes_at(p.other_stop_lane + at);
            follow(row, (ahead > 0.0F) & in_lane, ahead - (row.half_length + half_length), speed, held);
        }
    }
}

// One bit a vehicle: those that the set lanes point to.
std::uint64_t vehicles_of(unsigned lanes, const std::int32_t* vehicle) {
    std::uint64_t result = 0;
    for (; lanes != 0; lanes &= lanes - 1) {
        result |= std::uint64_t{1} << vehicle[__builtin_ctz(lanes)];
    }
    return result;
}

// The mask of a row of vehicles.
Ints row_of(std::uint64_t vehicles, int row) {
    const auto lanes = static_cast<std::int32_t>((vehicles >> (row * WIDTH)) & EVERY);
    return (all_ints(lanes) & (all_ints(1) << lane_numbers())) != 0;
}

// A row of pairs.
struct PairRow {
    Ints i, j, assignment, active;
    Floats end_i, end_j, half_i, half_j, position_i, position_j, rear_i, rear_j;
};

// The pairs from `first` on; by_arrival: whether who arrived first goes first, where that counts, as if assigned.
PairRow pairs_at(const Problem& problem, const std::int32_t* assignments, long first, bool by_arrival,
                 const OneScenario& run) {
    const LaneProblem& p = problem.lanes;
    PairRow row;
    row.i = lanes_at(p.yielder + first), row.j = lanes_at(p.prioritized + first);
    row.assignment = lanes_at(assignments + first);
    if (by_arrival) {
        const Ints way =
            INTERSECTION_ENV_ISA::by_arrival(pick(run.turn, run.count, row.i), pick(run.turn, run.count, row.j),
                                             pick(run.hold, run.count, row.j), lanes_at(p.yielder_rank + first));
        row.assignment = (row.assignment == 0) & (lanes_at(p.by_arrival + first) != 0) ? way : row.assignment;
    }
    row.end_i = lanes_at(p.yielder_end + first), row.end_j = lanes_at(p.prioritized_end + first);
    row.half_i = lanes_at(p.yielder_half_length + first), row.half_j = lanes_at(p.prioritized_half_length + first);
    row.position_i = pick(run.position, run.count, row.i), row.position_j = pick(run.position, run.count, row.j);
    row.rear_i = row.position_i - row.half_i, row.rear_j = row.position_j - row.half_j;
    row.active = (row.position_i < FAR) & (row.position_j < FAR) &
                 (row.assignment > 0 ? (row.rear_j < row.end_j) & (row.position_i < row.end_i)
                                     : (row.rear_i < row.end_i) & (row.position_j < row.end_j));
    return row;
}

// A row of pairs, from `first` on.
void decide_pairs(const Problem& problem, const std::int32_t* assignments, long first, OneScenario& run) {
    const LaneProblem& p = problem.lanes;
    const auto [i, j, assignment, active, end_i, end_j, half_i, half_j, position_i, position_j, rear_i, rear_j] =
        pairs_at(problem, assignments, first, problem.has_stops, run);
    const Ints open = active & (assignment == 0) & (pick(run.hold, run.count, j) <= lanes_at(p.yielder_rank + first));
    const Ints to_i = active & (assignment < 0), to_j = active & (assignment > 0);
    const Ints asked = open & ~pick(run.decided, run.count, i);
    std::uint64_t refused = 0;
    if (any(asked)) {
        const Floats front_j = position_j + half_j, line_j = lanes_at(p.prioritized_line + first);
        Encounter met = {end_i - rear_i,
                         pick(run.speed, run.count, i),
                         all(1.0F),
                         all(0.0F),
                         line_j - front_j,
                         pick(run.speed, run.count, j),
                         all(1.0F),
                         end_j - rear_j,
                         lanes_at(p.merging + first)};
        if (problem.gap == Gap::sumo) {
            met.v_max = pick(run.v_max, run.count, i);
            met.foe_v_max = pick(run.v_max, run.count, j);
            met.distance_to_stop_line = lanes_at(p.yielder_stop_line + first) - (position_i + half_i);
        }
        refused = vehicles_of(
            bits(asked & ~accepts_gap(problem.gap, problem.gap_network, met, lanes_at(p.yielder_patience + first))),
            p.yielder + first);
    }
    const auto seconds = [&](Ints yielders, Ints others) {
        return vehicles_of(bits(yielders), p.yielder + first) | vehicles_of(bits(others), p.prioritized + first);
    };
    const std::uint64_t assigned = seconds(to_i, to_j);
    run.refused |= refused | assigned;
    const Ints told = lanes_at(assignments + first) != 0;
    run.refused_by_assignment |= problem.has_stops ? seconds(to_i & told, to_j & told) : assigned;
    const Ints kept = active & (assignment == 0) & pick(run.settled, run.count, i) & ~pick(run.enters, run.count, j);
    run.kept |= vehicles_of(bits(kept), p.prioritized + first);
    for (int r = 0; r < run.count; ++r) {
        run.decided[r] |= row_of(run.refused, r);
    }
}

void locate(const Problem& problem, OneScenario& run) {
    for (int r = 0; r < run.count; ++r) {
        const VehicleRow& row = run.rows[r];
        Floats pose[4];
        interpolate<1, 1>(problem.pose, row.first_row, row.last_row, row.position * problem.inverse_spacing, pose);
        direction(pose[2], run.cosine[r], run.sine[r]);
        run.x[r] = pose[0];
        run.y[r] = pose[1];
    }
}

// The smallest distance between vehicles that can touch.
float smallest_distance(const Problem& problem, OneScenario& run, float so_far) {
    locate(problem, run);
    const float* position = reinterpret_cast<const float*>(run.position);
    const auto of = [&](int vehicle) {
        const int r = vehicle / WIDTH, l = vehicle % WIDTH;
        const ProblemVehicle& known = problem.vehicles[vehicle];
        return Rectangle<float>{run.x[r][l],    run.y[r][l],       run.cosine[r][l],
                                run.sine[r][l], known.half_length, known.half_width};
    };
    for (int t = 0; t < problem.touch_count; ++t) {
        const Touch& touch = problem.touches[t];
        const float a = position[touch.a], b = position[touch.b];
        const float half_a = problem.vehicles[touch.a].half_length, half_b = problem.vehicles[touch.b].half_length;
        if (a < FAR && b < FAR && a + half_a >= touch.on_a.begin && a - half_a <= touch.on_a.end &&
            b + half_b >= touch.on_b.begin && b - half_b <= touch.on_b.end) {
            const Rectangle<float> one = of(touch.a), other = of(touch.b);
            const float x = one.x - other.x, y = one.y - other.y;
            if (x * x + y * y < squared_range(touch, so_far)) {
                so_far = smaller(so_far, __builtin_sqrtf(squared_distance(one, other)));
            }
        }
    }
    return so_far;
}

// Whether somebody enters a conflict before the one that was assigned to go first has cleared it.
bool disobeyed(const Problem& problem, const std::int32_t* assignments, const OneScenario& run) {
    const LaneProblem& p = problem.lanes;
    Ints found{};
    for (long first = 0; first < problem.pair_count; first += WIDTH) {
        const PairRow row = pairs_at(problem, assignments, first, false, run);
        found |= disobeys(row.active, row.assignment, row.position_i + row.half_i - lanes_at(p.yielder_entry + first),
                          row.position_j + row.half_j - lanes_at(p.prioritized_entry + first));
    }
    return any(found);
}

template <class Value, class Lanes>
void store(Value* out, long row, int count, Lanes values) {
    const int used = count - static_cast<int>(row) * WIDTH;
    for (int l = 0; l < WIDTH && l < used; ++l) {
        out[row * WIDTH + l] = static_cast<Value>(values[l]);
    }
}

void store_state(const Trajectories& t, int count, int step, const OneScenario& run) {
    for (int r = 0; r < run.count; ++r) {
        const VehicleRow& row = run.rows[r];
        store(t.position + static_cast<long>(step) * count, r, count, row.position);
        store(t.speed + static_cast<long>(step) * count, r, count, row.speed);
        store(t.present + static_cast<long>(step) * count, r, count, row.present & 1);
    }
}

// Drives and moves the row; to: where the action goes, by step.
void move(const Problem& problem, float inverse_root, const Trajectories& t, int step, int r, OneScenario& run) {
    VehicleRow& row = run.rows[r];
    const int count = problem.vehicle_count;
    const Floats acceleration = drive(problem, inverse_root, row.max_speed, row);
    row.time_loss += row.present ? DT * (1.0F - row.speed / row.v_max()) : all(0.0F);
    const Floats applied = advance(acceleration, 0.0F, row.present, row);
    row.present &= row.position < row.route_length;
    if (t.position != nullptr) {
        for (int at = step; at <= (step == STEPS - 1 ? STEPS : step); ++at) {
            store(t.acceleration + static_cast<long>(at) * count, r, count, applied);
            store(t.enters + static_cast<long>(at) * count, r, count, row.delta & 1);
            if (t.hold != nullptr) {
                store(t.hold + static_cast<long>(at) * count, r, count, row.hold);
            }
            if (t.waited != nullptr) {
                store(t.waited + static_cast<long>(at) * count, r, count, row.waited);
            }
        }
    }
}

void replay_decisions(const std::uint8_t* decisions, int count, int step, OneScenario& run) {
    for (int i = 0; i < count; ++i) {
        run.rows[i / WIDTH].delta[i % WIDTH] = decisions[static_cast<long>(step) * count + i] != 0 ? -1 : 0;
    }
}

} // namespace

void predict_one_scenario(const Problem& problem, const ScenarioArguments& arguments, Workspace& workspace) {
    OneScenario& run = reinterpret_cast<OneScenario&>(workspace);
    const LaneProblem& p = problem.lanes;
    const Trajectories& t = arguments.trajectories;
    const int count = problem.vehicle_count;
    const float inverse_root = inverse_root_of(problem.idm);
    alignas(64) std::int32_t assignments[MAX_PAIRS];
    for (int k = 0; k < p.padded_pairs; ++k) {
        assignments[k] =
            arguments.assignments != nullptr && k < problem.pair_count ? arguments.assignments[p.pair[k]] : 0;
    }
    float distance = NO_DISTANCE;
    bool wrong = false;
    start(p, run);
    for (int step = 0; step < STEPS; ++step) {
        publish(run);
        run.refused = run.refused_by_assignment = run.kept = 0;
        observe(problem, run);
        for (long first = 0; first < problem.pair_count; first += WIDTH) {
            decide_pairs(problem, assignments, first, run);
        }
        for (int r = 0; r < run.count; ++r) {
            VehicleRow& row = run.rows[r];
            row.refused = row_of(run.refused, r);
            row.kept = row_of(run.kept, r);
            decide_vehicle(row, row_of(run.refused_by_assignment, r) ? all_ints(problem.route_count) : row.rank);
        }
        if (arguments.decisions != nullptr) {
            replay_decisions(arguments.decisions, count, step, run);
        }
        if (arguments.minimum_distance != nullptr) {
            distance = smallest_distance(problem, run, distance);
        }
        if (arguments.followed != nullptr) {
            wrong |= disobeyed(problem, assignments, run);
        }
        if (t.position != nullptr) {
            store_state(t, count, step, run);
        }
        for (int r = 0; r < run.count; ++r) {
            move(problem, inverse_root, t, step, r, run);
        }
    }
    if (t.position != nullptr) {
        store_state(t, count, STEPS, run);
    }
    for (int r = 0; r < run.count; ++r) {
        store(arguments.time_loss, r, count, run.rows[r].time_loss);
    }
    if (arguments.minimum_distance != nullptr || arguments.followed != nullptr) {
        publish(run);
    }
    if (arguments.minimum_distance != nullptr) {
        *arguments.minimum_distance = smallest_distance(problem, run, distance);
    }
    if (arguments.followed != nullptr) {
        *arguments.followed = !(wrong | disobeyed(problem, assignments, run));
    }
}

Workspace* create_one_scenario() { return reinterpret_cast<Workspace*>(new OneScenario()); }
void destroy_one_scenario(Workspace* workspace) { delete reinterpret_cast<OneScenario*>(workspace); }

} // namespace intersection_env::INTERSECTION_ENV_ISA
