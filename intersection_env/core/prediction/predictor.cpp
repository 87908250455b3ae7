#include "prediction/predictor.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "intersection_env/orders.hpp"
#include "model/contact.hpp"
#include "model/rectangle.hpp"
#include "prediction/patience.hpp"
#include "tables/lane_tables.hpp"
#include "threads.hpp"

namespace intersection_env {
namespace {

constexpr Interval EVERYWHERE{-FAR, FAR};
constexpr float ROUNDED_REACH = 0.001F; // [m], above what rounding can take from a distance

std::size_t at(int index) { return static_cast<std::size_t>(index); }

void check_count(std::size_t pairs) {
    if (pairs > MAX_PAIRS) {
        throw std::invalid_argument(std::to_string(pairs) + " conflicting pairs are more than " +
                                    std::to_string(MAX_PAIRS));
    }
}

// One call's scenarios, and where their results go.
struct Batch {
    const Problem& problem;
    std::span<const std::int8_t> assignments;
    std::span<const std::uint8_t> decisions;
    const Results& results;
    int scenarios;

    // `count` scenarios from `first` on.
    ScenarioArguments part(int first, int count) const {
        const std::size_t vehicles = at(problem.vehicle_count), frames = at(first) * (STEPS + 1) * vehicles;
        const auto from = [frames](auto* values) { return values == nullptr ? nullptr : values + frames; };
        const Trajectories& t = results.trajectories;
        return {assignments.data() + at(first) * at(problem.pair_count),
                decisions.empty() ? nullptr : decisions.data() + at(first) * STEPS * vehicles,
                count,
                {from(t.position), from(t.speed), from(t.acceleration), from(t.enters), from(t.present), from(t.hold),
                 from(t.waited)},
                results.time_loss + at(first) * vehicles,
                results.minimum_distance == nullptr ? nullptr : results.minimum_distance + first,
                results.followed == nullptr ? nullptr : results.followed + first};
    }
};

} // namespace

struct Predictor::Bound {
    std::vector<ProblemVehicle> vehicles;
    std::vector<LeadCandidate> candidates;
    std::vector<ProblemPair> pairs;
    std::vector<Touch> touches;
    std::vector<float> gap_logits; // (pair,) at the start, where they are asked for
    LaneTables lanes;
};

struct Predictor::Workspaces {
    const Kernel* kernel = nullptr; // whose these are
    Workspace *block = nullptr, *one = nullptr;

    Workspaces() = default;
    Workspaces(const Workspaces&) = delete;
    Workspaces& operator=(const Workspaces&) = delete;
    ~Workspaces() { release(); }

    void serve(const Kernel& wanted) {
        if (kernel != &wanted) {
            release();
            block = wanted.create_scenario_block();
            one = wanted.create_one_scenario();
            kernel = &wanted;
        }
    }

    void release() {
        if (kernel != nullptr) {
            kernel->destroy_scenario_block(block);
            kernel->destroy_one_scenario(one);
        }
        kernel = nullptr;
    }

    // One block of the batch: its scenarios together, or one after the other where they are few.
    void predict(const Batch& batch, int block_index) {
        const int first = block_index * kernel->lanes;
        const int count = std::min(kernel->lanes, batch.scenarios - first);
        if (count >= kernel->worth_a_block) {
            kernel->predict_scenario_block(batch.problem, batch.part(first, count), *block);
            return;
        }
        for (int s = first; s < first + count; ++s) {
            kernel->predict_one_scenario(batch.problem, batch.part(s, 1), *one);
        }
    }
};

struct Predictor::Memory {
    std::vector<Pair> pairs;
    Completion completion;
    Bound bound;
    Workspaces workspaces;
};

struct Predictor::Crew {
    explicit Crew(int count) : threads(count), workspaces(at(threads.count())) {}

    Threads threads;
    std::vector<Workspaces> workspaces; // one a thread
    std::atomic_flag busy;

    // False where they help another caller at this moment.
    bool predict(const Batch& batch, int blocks, const Kernel& kernel) {
        const Attempt attempt(busy);
        if (!attempt.succeeded()) {
            return false;
        }
        for (Workspaces& one : workspaces) {
            one.serve(kernel);
        }
        const auto work = [&](int block, int thread) { workspaces[at(thread)].predict(batch, block); };
        threads.share(blocks, std::ref(work)); // a copy would be allocated
        return true;
    }
};

Predictor::Memory& Predictor::memory() {
    static thread_local Memory memory;
    return memory;
}

Predictor::Predictor(std::shared_ptr<const Map> map, Policy policy, int threads, std::optional<Patience> patience)
    : map_(std::move(map)), policy_(std::move(policy)),
      patience_(patience.value_or(policy_.gap == Gap::network ? DEFAULT_PATIENCE : Patience::none)),
      tables_(*map_, policy_.idm), crew_(threads == 1 ? nullptr : std::make_unique<Crew>(threads)) {
    if (patience_ == Patience::kept && policy_.gap != Gap::network) {
        throw std::invalid_argument("patience can be kept only where a network decides about gaps");
    }
    if ((policy_.gap == Gap::network && !policy_.gap_network) ||
        (policy_.driver == Driver::network && !policy_.driving_network)) {
        throw std::invalid_argument("the policy names a network that it does not hold");
    }
}

Predictor::~Predictor() = default;

void Predictor::add_candidates(const Traffic& traffic, int i, Bound& bound) const {
    const int route = traffic.route[at(i)];
    const float rear = traffic.rear(i);
    for (int j = 0; j < traffic.count(); ++j) {
        if (i == j) {
            continue;
        }
        for (const LeadLane& lane : tables_.lead_lanes_of(route, traffic.route[at(j)])) {
            if (std::max(rear, traffic.rear(j) - lane.offset) < lane.end) { // nobody drives backwards
                bound.candidates.push_back({j, lane.begin, lane.end, lane.offset,
                                            0.5F * (traffic.length[at(i)] + traffic.length[at(j)]),
                                            lane.same_stop_lane});
            }
        }
    }
}

void Predictor::add_touches(const Traffic& traffic, Bound& bound) const {
    std::array<float, MAX_VEHICLES> half_diagonal{}, x{}, y{};
    for (int i = 0; i < traffic.count(); ++i) {
        half_diagonal[at(i)] = 0.5F * std::hypot(traffic.length[at(i)], traffic.width[at(i)]);
        const Sample centre = straight_on(*map_, traffic.route[at(i)], traffic.position[at(i)]);
        x[at(i)] = centre.x;
        y[at(i)] = centre.y;
    }
    for (int a = 0; a < traffic.count(); ++a) {
        for (int b = a + 1; b < traffic.count(); ++b) {
            Touch touch{a, b, EVERYWHERE, EVERYWHERE, half_diagonal[at(a)] + half_diagonal[at(b)] + ROUNDED_REACH};
            // who overlaps from the start, as perception may have it, does not count
            const auto apart = [&] {
                const float across = x[at(a)] - x[at(b)], along = y[at(a)] - y[at(b)];
                return across * across + along * along > touch.reach * touch.reach ||
                       clearance(*map_, body(traffic, a), body(traffic, b)) > 0.0F;
            };
            if (traffic.route[at(a)] == traffic.route[at(b)]) {
                if (apart()) {
                    bound.touches.push_back(touch);
                }
                continue;
            }
            for (const Overlap& row : map_->overlaps_of(traffic.route[at(a)], traffic.route[at(b)])) {
                const Overlap overlap = row.seen_from(traffic.route[at(a)]);
                touch.on_a = overlap.on_a;
                touch.on_b = overlap.on_b;
                if (traffic.rear(a) <= touch.on_a.end && traffic.rear(b) <= touch.on_b.end && apart()) {
                    bound.touches.push_back(touch);
                }
            }
        }
    }
}

void Predictor::bind(const Traffic& traffic, std::span<const Pair> pairs, bool distances, const Kernel& kernel,
                     Bound& bound) const {
    bound.vehicles.clear();
    bound.candidates.clear();
    bound.pairs.clear();
    bound.touches.clear();
    for (int i = 0; i < traffic.count(); ++i) {
        const int index = traffic.route[at(i)];
        const Route& route = map_->routes[at(index)];
        const int first = static_cast<int>(bound.candidates.size());
        add_candidates(traffic, i, bound);
        bound.vehicles.push_back({tables_.first_row[at(index)], static_cast<int>(route.samples.size()) - 1,
                                  traffic.position[at(i)], traffic.speed[at(i)], 0.5F * traffic.length[at(i)],
                                  0.5F * traffic.width[at(i)], std::min(traffic.max_speed[at(i)], UNBOUNDED),
                                  route.stop_line, route.first_conflict, route.length, index, route.must_stop,
                                  traffic.has_memories() ? traffic.delta[at(i)] != 0 : committed(*map_, traffic, i),
                                  traffic.has_memories() ? traffic.hold[at(i)] : -1, traffic.steps_waited(i),
                                  traffic.has_patience() ? traffic.patience[at(i)] : 0.0F, first,
                                  static_cast<int>(bound.candidates.size())});
    }
    for (const Pair& pair : pairs) {
        const Conflict& conflict =
            *map_->conflict(traffic.route[at(pair.yielder)], traffic.route[at(pair.prioritized)]);
        const auto entry = [&](int vehicle, const Interval& interval) {
            return std::max(interval.begin, map_->routes[at(traffic.route[at(vehicle)])].stop_line) + CREPT;
        };
        bound.pairs.push_back({pair.yielder, pair.prioritized, conflict.on_yielder.end, conflict.on_prioritized.end,
                               entry(pair.yielder, conflict.on_yielder),
                               entry(pair.prioritized, conflict.on_prioritized), conflict.line, conflict.merging,
                               conflict.by_arrival});
    }
    if (distances) {
        add_touches(traffic, bound);
    }
    bound.lanes.fill(bound.vehicles, bound.candidates, bound.pairs);
    bind_patience(traffic, pairs, kernel, bound);
}

void Predictor::bind_patience(const Traffic& traffic, std::span<const Pair> pairs, const Kernel& kernel,
                              Bound& bound) const {
    if (traffic.has_patience() && policy_.gap != Gap::network) {
        throw std::invalid_argument("this traffic's drivers keep patience, but no network decides about gaps");
    }
    if (traffic.has_patience() || patience_ == Patience::none) {
        return;
    }
    bool is_asked = false;
    for (int i = 0; i < traffic.count(); ++i) {
        is_asked |= waits(*map_, traffic, i);
    }
    if (!is_asked) {
        return; // 0, the median, is everybody's
    }
    bound.gap_logits.resize(pairs.size());
    kernel.gap_logits(problem(bound), bound.gap_logits.data());
    for (int i = 0; i < traffic.count(); ++i) {
        bound.vehicles[at(i)].patience = patience_of(*map_, traffic, i, pairs, bound.gap_logits, MEDIAN);
    }
    bound.lanes.fill_patience(bound.vehicles, bound.pairs);
}

std::vector<float> Predictor::patience(const Traffic& traffic, std::span<const double> levels,
                                       const Kernel& kernel) const {
    check(*map_, traffic);
    if (policy_.gap != Gap::network) {
        throw std::invalid_argument("only where a network decides about gaps are drivers more or less patient");
    }
    if (levels.size() != at(traffic.count())) {
        throw std::invalid_argument("levels take one entry a vehicle");
    }
    for (const double level : levels) {
        if (!(level > 0.0 && level < 1.0)) {
            throw std::invalid_argument("a level must be above 0 and below 1, not " + std::to_string(level));
        }
    }
    Memory& own = memory();
    find_open_pairs(traffic, own.pairs);
    bind(traffic, own.pairs, false, kernel, own.bound);
    own.bound.gap_logits.resize(own.pairs.size());
    kernel.gap_logits(problem(own.bound), own.bound.gap_logits.data());
    std::vector<float> result;
    for (int i = 0; i < traffic.count(); ++i) {
        result.push_back(patience_of(*map_, traffic, i, own.pairs, own.bound.gap_logits, levels[at(i)]));
    }
    return result;
}

Problem Predictor::problem(const Bound& bound) const {
    return {bound.vehicles.data(),
            bound.candidates.data(),
            bound.pairs.data(),
            bound.touches.data(),
            static_cast<int>(bound.vehicles.size()),
            static_cast<int>(bound.pairs.size()),
            static_cast<int>(bound.touches.size()),
            static_cast<int>(map_->routes.size()),
            map_->has_stops(),
            1.0F / map_->spacing,
            policy_.gap,
            policy_.driver,
            policy_.idm,
            policy_.acceleration_scale,
            policy_.gap_network ? &*policy_.gap_network : nullptr,
            policy_.driving_network ? &*policy_.driving_network : nullptr,
            tables_.observed.data(),
            tables_.pose.data(),
            bound.lanes.problem()};
}

void Predictor::observe(const Traffic& traffic, std::span<const Pair> pairs, float* driving, float* gap,
                        std::uint8_t* accepts, const Kernel& kernel) const {
    check_count(pairs.size());
    Memory& own = memory();
    own.workspaces.serve(kernel);
    bind(traffic, pairs, false, kernel, own.bound);
    kernel.observe(problem(own.bound), {driving, gap, accepts}, *own.workspaces.block);
}

void Predictor::find_open_pairs(const Traffic& traffic, std::vector<Pair>& pairs) const {
    find_conflicts(*map_, traffic, pairs);
    check_count(pairs.size());
}

void Predictor::predict(const Traffic& traffic, std::span<std::int8_t> assignments, int scenarios,
                        std::span<const std::uint8_t> decisions, const Results& results, const Kernel& kernel) const {
    check(*map_, traffic);
    Memory& own = memory();
    find_open_pairs(traffic, own.pairs);
    const std::vector<Pair>& pairs = own.pairs;
    const std::size_t pair_count = pairs.size(), vehicles = at(traffic.count());
    if (scenarios < 0 || assignments.size() != at(scenarios) * pair_count ||
        (!decisions.empty() && decisions.size() != at(scenarios) * STEPS * vehicles)) {
        throw std::invalid_argument("assignments must be (scenario, " + std::to_string(pair_count) +
                                    ") and decisions (scenario, " + std::to_string(STEPS) + ", vehicle)");
    }
    own.completion.prepare(*map_, traffic, pairs);
    for (int s = 0; s < scenarios; ++s) {
        own.completion.complete(assignments.subspan(at(s) * pair_count, pair_count));
    }
    bind(traffic, pairs, results.minimum_distance != nullptr, kernel, own.bound);
    const Problem shared = problem(own.bound);
    const Batch batch{shared, assignments, decisions, results, scenarios};
    const int blocks = (scenarios + kernel.lanes - 1) / kernel.lanes;
    if (crew_ == nullptr || blocks <= 1 || !crew_->predict(batch, blocks, kernel)) {
        own.workspaces.serve(kernel);
        for (int block = 0; block < blocks; ++block) {
            own.workspaces.predict(batch, block);
        }
    }
    if (results.patience != nullptr) {
        std::ranges::transform(own.bound.vehicles, results.patience, &ProblemVehicle::patience);
    }
    if (results.minimum_distance != nullptr) {
        std::replace_if(
            results.minimum_distance, results.minimum_distance + scenarios,
            [](float distance) { return distance >= NO_DISTANCE; }, std::numeric_limits<float>::infinity());
    }
}

} // namespace intersection_env
