// What all scenarios of one prediction share, flat and ready for the kernel; and where its results go.
#pragma once

#include <cstdint>

#include "intersection_env/map.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"
#include "model/rectangle.hpp"

namespace intersection_env {

constexpr int LANES = 16;                        // of the widest kernel
constexpr int MAX_PAIRS = 1024;                  // ours
constexpr float LEAD_RANGE = 100.0F;             // [m], paper, Section III-B.2
constexpr float FREE_LEAD_SPEED = 100.0F / 3.6F; // [m/s], likewise
constexpr float UNBOUNDED = 1000.0F; // [m/s], stands for an infinite top speed in the kernel's finite arithmetic
constexpr float STOPPED = 0.5F;      // [m/s], ours: slower than this a vehicle has made its stop ...
constexpr float AT_LINE = 3.0F;      // [m], ours: ... where it is no farther than this before its line
constexpr float CREPT = 0.1F;        // [m], ours: what whoever creeps, at less than 1 m/s, needs to stop in one step
constexpr float FAR = 1.0e6F;        // [m], an arc length that nobody reaches
constexpr int OBSERVED_COLUMNS = 8, POSE_COLUMNS = 4;

// One vehicle, as all scenarios know it.
struct ProblemVehicle {
    int first_row, last_row; // of its route: its first row in the tables, its number of rows less one
    float position, speed, half_length, half_width, max_speed;
    float stop_line, first_conflict, route_length;
    int rank; // its route's
    bool must_stop;
    bool delta; // the memories at the start
    int hold, waited;
    float patience;                      // the logit that a gap's must exceed
    int first_candidate, last_candidate; // range in Problem::candidates
};

// Vehicle `other` may lead: ahead in a lane that both take.
struct LeadCandidate {
    int other;
    float begin;  // [m], the other's front must be beyond it; -FAR where the lane begins with a route
    float end;    // [m], both rears must be before it, in our arc length; FAR where the lane goes on to the end
    float offset; // [m], the other's position is ours plus this
    float half_lengths;
    bool same_stop_lane;
};

struct ProblemPair {
    int yielder, prioritized;
    float yielder_end, prioritized_end;
    float yielder_entry, prioritized_entry; // [m], a front beyond it has entered the conflict
    float line; // [m], of the prioritized vehicle: how far it still has to go is measured to there
    bool merging, by_arrival;
};

struct Touch {
    int a, b;
    Interval on_a, on_b;
    float reach; // [m], centres further apart than this and a distance are further apart than the distance
};

// The vehicles, lead candidates and pairs once more, one to a lane, padded to whole rows of the widest kernel: for one
// scenario at a time. Padding is never present, leads nobody and conflicts with nobody.
struct LaneProblem {
    int vehicles, padded_vehicles, candidates, padded_pairs; // candidates: the most that one vehicle has
    const float *half_length, *max_speed, *stop_line, *first_conflict, *route_length; // (vehicle,)
    const float *last_row, *position, *speed;
    const std::int32_t *first_row, *rank, *delta, *hold, *waited; // delta is a mask: 0 or -1
    const std::int32_t* must_stop;                                // mask
    // (candidate, vehicle)
    const std::int32_t *other, *other_stop_lane; // the latter: 0 where the stop lanes are the same, else -1
    const float *begin, *end, *offset, *other_half_length;
    // (pair,), first one of each yielder, then a second one, and so on: who is refused early need not be asked again
    const std::int32_t* pair; // its index in Problem::pairs
    const std::int32_t *yielder, *prioritized, *yielder_rank, *merging, *by_arrival;
    const float *yielder_end, *prioritized_end, *yielder_entry, *prioritized_entry;
    const float *yielder_half_length, *prioritized_half_length;
    const float *yielder_stop_line, *prioritized_line;
    const float* yielder_patience;
};

// Pointers and counts only: the kernel must not call inline functions of the standard library.
struct Problem {
    const ProblemVehicle* vehicles;
    const LeadCandidate* candidates;
    const ProblemPair* pairs;
    const Touch* touches;
    int vehicle_count, pair_count, touch_count, route_count;
    bool has_stops; // whether somebody has to make one; without, nobody waits by arrival either
    float inverse_spacing;
    Gap gap;
    Driver driver;
    IdmParameters idm;
    float acceleration_scale;
    const GapNetwork* gap_network;
    const DrivingNetwork* driving_network;
    const float *observed, *pose; // rows of all routes
    LaneProblem lanes;
};

// Arrays (scenario, time, vehicle) of one block's scenarios; null where not wanted.
struct Trajectories {
    float *position, *speed, *acceleration;
    std::uint8_t *enters, *present;
    std::int16_t* hold = nullptr;   // also null where only the others are wanted
    std::int32_t* waited = nullptr; // likewise, and where nobody has to stop
};

struct ScenarioArguments {
    const std::int8_t* assignments; // (scenario, pair)
    const std::uint8_t* decisions;  // (scenario, step, vehicle) to replay, or null
    int scenarios;                  // at most the lanes of the instruction set
    Trajectories trajectories;
    float* time_loss;        // (scenario, vehicle)
    float* minimum_distance; // (scenario,), or null: not wanted
    std::uint8_t* followed;  // (scenario,), or null: not wanted
};

// Scenarios that have come to the same state: a range of BranchMemory::scenarios, and the step that they are at.
struct Branch {
    int first, last, step;
};

// What pairs say to the vehicles of one scenario, as far as it matters; one bit a vehicle.
struct BranchDecision {
    std::uint64_t waits;   // for whatever reason
    std::uint64_t refused; // of these, those that count as held at their line, where that is asked for
    std::uint64_t told;    // and those that an assignment refuses, likewise
};

constexpr int WORDS_OF_A_VEHICLE = 7, WORDS_OF_A_BRANCH = 1; // beside one word a pair

// What branching takes beside its arguments, for as many scenarios as these have; kernels allocate nothing.
struct BranchMemory {
    std::int32_t* scenarios;   // (scenario,) their numbers, those of a branch together
    BranchDecision* decisions; // (scenario,)
    Branch* pile;              // (scenario,) branches that no lane has taken up yet, the last one first
    std::uint32_t* states;     // (scenario, words), of these
    int words;
};

// Where one moment's observations go; all from the first lane.
struct ObservationArguments {
    float* driving;        // (vehicle, DRIVING_INPUTS)
    float* gap;            // (pair, GAP_INPUTS)
    std::uint8_t* accepts; // (pair,), the gap decision alone
};

} // namespace intersection_env
