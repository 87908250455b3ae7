// Predicts one traffic under many priority assignments.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "intersection_env/map.hpp"
#include "intersection_env/policy.hpp"
#include "intersection_env/traffic.hpp"
#include "kernel/dispatch.hpp"
#include "tables/problem.hpp"
#include "tables/route_tables.hpp"

namespace intersection_env {

// Where the results go. Arrays of trajectories are (scenario, STEPS + 1, vehicle): all of them, or none (null).
struct Results {
    Trajectories trajectories{};
    float* time_loss = nullptr;        // (scenario, vehicle) [s], always written
    float* minimum_distance = nullptr; // (scenario,) [m], infinite where no two vehicles can touch
    std::uint8_t* followed = nullptr;  // (scenario,), whether the second of each assigned pair lets the first pass
    float* patience = nullptr;         // (vehicle,), what drivers keep, as Traffic holds it
    bool apart = false; // each scenario is predicted by itself, whatever it has in common with others: for benchmarks
};

// Only the first predictions of a thread allocate memory, and those of more vehicles, pairs or scenarios than any
// before. Any number of threads may call one predictor at the same time; none waits for another.
class Predictor {
  public:
    // threads: how many share a batch of several blocks, 0: one a core; they do not change what comes out. They help
    // one caller at a time; whoever calls meanwhile works alone. patience: of drivers whose traffic brings none; none
    // named: DEFAULT_PATIENCE where a network decides about gaps. Throws std::invalid_argument for a count out of
    // range, or patience kept where no network decides.
    Predictor(std::shared_ptr<const Map> map, Policy policy, int threads = 1, std::optional<Patience> patience = {});
    ~Predictor();

    const Map& map() const { return *map_; }
    const Policy& policy() const { return policy_; }
    Patience patience() const { return patience_; }
    // Whether drivers keep anything in a prediction of this traffic.
    bool keeps_patience(const Traffic& traffic) const { return patience_ == Patience::kept || traffic.has_patience(); }

    // assignments: (scenario, pair) over find_conflicts(map, traffic), completed in place under lane order.
    // decisions: (scenario, step, vehicle) to replay instead of deciding, or empty.
    // Throws std::invalid_argument for a traffic or an assignment that is refused.
    void predict(const Traffic& traffic, std::span<std::int8_t> assignments, int scenarios,
                 std::span<const std::uint8_t> decisions, const Results& results, const Kernel& kernel) const;

    // What every vehicle sees and decides now, without intervention. pairs: find_conflicts of the traffic, which is
    // checked. driving: (vehicle, DRIVING_INPUTS); gap: (pair, GAP_INPUTS), accepts: (pair,).
    void observe(const Traffic& traffic, std::span<const Pair> pairs, float* driving, float* gap, std::uint8_t* accepts,
                 const Kernel& kernel) const;

    // The patience (vehicle,) of the driver at each vehicle's level of all that could be in it: 0.5 is the median.
    // Throws std::invalid_argument where no network decides about gaps, or for a level not above 0 and below 1.
    std::vector<float> patience(const Traffic& traffic, std::span<const double> levels, const Kernel& kernel) const;

  private:
    struct Bound;      // a Problem and what it points to
    struct Workspaces; // the kernel's own memory for one thread
    struct Memory;     // what a calling thread keeps from one prediction to the next
    struct Crew;       // the threads that help with a large batch
    static Memory& memory();
    void find_open_pairs(const Traffic& traffic, std::vector<Pair>& pairs) const;
    // distances: whether they are asked for, and who can touch whom has to be known.
    void bind(const Traffic& traffic, std::span<const Pair> pairs, bool distances, const Kernel& kernel,
              Bound& bound) const;
    void bind_patience(const Traffic& traffic, std::span<const Pair> pairs, const Kernel& kernel, Bound& bound) const;
    Problem problem(const Bound& bound) const;
    void add_candidates(const Traffic& traffic, int i, Bound& bound) const;
    void add_touches(const Traffic& traffic, Bound& bound) const;

    std::shared_ptr<const Map> map_;
    Policy policy_;
    Patience patience_;
    RouteTables tables_;
    std::unique_ptr<Crew> crew_; // null: every caller works alone
};

} // namespace intersection_env
