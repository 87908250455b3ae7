#include "prediction/predictor.hpp"

#include <algorithm>
#include <atomic>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "intersection_env/orders.hpp"
#include "prediction/bound.hpp"
#include "prediction/patience.hpp"
#include "threads.hpp"

namespace intersection_env {
namespace {

constexpr int MOST_BRANCHING = 2048; // scenarios at a time, ours: their states stay small
constexpr int PARTS_A_THREAD = 2;    // ours: no thread waits long for another, and a part has much in common

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

    // Of how many scenarios the parts are that are predicted at a time: a block, or as many as may branch.
    int part_size(int lanes, int threads) const {
        if (results.apart || !decisions.empty() || scenarios <= lanes) {
            return lanes;
        }
        const int wanted = std::max(threads == 1 ? 1 : PARTS_A_THREAD * threads, (scenarios - 1) / MOST_BRANCHING + 1);
        return std::max(lanes, (scenarios - 1) / wanted + 1);
    }

    int parts(int size) const { return (scenarios + size - 1) / size; }

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

// An array that grows, and whose values are left as they come.
template <class Value>
struct Scratch {
    std::unique_ptr<Value[]> values;
    std::size_t size = 0;

    Value* of(std::size_t wanted) {
        if (wanted > size) {
            values = std::make_unique_for_overwrite<Value[]>(wanted);
            size = wanted;
        }
        return values.get();
    }
};

struct Predictor::Workspaces {
    const Kernel* kernel = nullptr; // whose these are
    Workspace *block = nullptr, *branches = nullptr, *one = nullptr;
    Scratch<std::int32_t> scenarios;
    Scratch<BranchDecision> decisions;
    Scratch<Branch> pile;
    Scratch<std::uint32_t> states;

    Workspaces() = default;
    Workspaces(const Workspaces&) = delete;
    Workspaces& operator=(const Workspaces&) = delete;
    ~Workspaces() { release(); }

    void serve(const Kernel& wanted) {
        if (kernel != &wanted) {
            release();
            block = wanted.create_scenario_block();
            branches = wanted.create_branches();
            one = wanted.create_one_scenario();
            kernel = &wanted;
        }
    }

    void release() {
        if (kernel != nullptr) {
            kernel->destroy_scenario_block(block);
            kernel->destroy_branches(branches);
            kernel->destroy_one_scenario(one);
        }
        kernel = nullptr;
    }

    // So that all of a crew have what parts of this size take, whichever of them is given one.
    void reserve(const Problem& problem, int part) {
        if (part > kernel->lanes) {
            memory(problem, part);
        }
    }

    // `count` scenarios of the batch, from `first` on: those that fill more than one block as branches, those of one
    // block together, or one after the other where they are few.
    void predict(const Batch& batch, int first, int count) {
        if (count > kernel->lanes) {
            kernel->predict_branching(batch.problem, batch.part(first, count), memory(batch.problem, count), *branches);
        } else if (count >= kernel->worth_a_block) {
            kernel->predict_scenario_block(batch.problem, batch.part(first, count), *block);
        } else {
            for (int s = first; s < first + count; ++s) {
                kernel->predict_one_scenario(batch.problem, batch.part(s, 1), *one);
            }
        }
    }

    BranchMemory memory(const Problem& problem, int count) {
        const int words = problem.vehicle_count * WORDS_OF_A_VEHICLE + problem.pair_count + WORDS_OF_A_BRANCH;
        return {scenarios.of(at(count)), decisions.of(at(count)), pile.of(at(count)), states.of(at(count) * at(words)),
                words};
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
    bool predict(const Batch& batch, int part, const Kernel& kernel) {
        const Attempt attempt(busy);
        if (!attempt.succeeded()) {
            return false;
        }
        for (Workspaces& one : workspaces) {
            one.serve(kernel);
            one.reserve(batch.problem, part);
        }
        const auto work = [&](int number, int thread) {
            workspaces[at(thread)].predict(batch, number * part, std::min(part, batch.scenarios - number * part));
        };
        threads.share(batch.parts(part), std::ref(work)); // a copy would be allocated
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
    const int part = batch.part_size(kernel.lanes, crew_ == nullptr ? 1 : crew_->threads.count());
    if (crew_ == nullptr || batch.parts(part) <= 1 || !crew_->predict(batch, part, kernel)) {
        own.workspaces.serve(kernel);
        for (int first = 0; first < scenarios; first += part) {
            own.workspaces.predict(batch, first, std::min(part, scenarios - first));
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
