// What is kept of a branch: the same for every scenario that has come to it.
#pragma once

#include "kernel/branches.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

class BranchResults {
  public:
    BranchResults(const Problem& problem, const ScenarioArguments& arguments, const BranchMemory& memory,
                  const BranchLanes& lanes)
        : problem_(problem), arguments_(arguments), memory_(memory), lanes_(lanes) {}

    // At the end of the horizon; distances and obedience only where they are wanted.
    void store_summary(int lane) const {
        const int vehicles = problem_.vehicle_count;
        each_scenario(lane, [this, lane, vehicles](long scenario) {
            for (int i = 0; i < vehicles; ++i) {
                arguments_.time_loss[scenario * vehicles + i] = lanes_.vehicles[i].time_loss[lane];
            }
            if (arguments_.minimum_distance != nullptr) {
                arguments_.minimum_distance[scenario] = lanes_.distance[lane];
            }
            if (arguments_.followed != nullptr) {
                arguments_.followed[scenario] = follows(lane, scenario);
            }
        });
    }

    void store_state(int lane, int time) const {
        const Trajectories& to = arguments_.trajectories;
        store(to.position, lane, time, [this](int i) { return lanes_.vehicles[i].position; });
        store(to.speed, lane, time, [this](int i) { return lanes_.vehicles[i].speed; });
        store(to.present, lane, time, [this](int i) { return lanes_.vehicles[i].present & 1; });
    }

    void store_action(int lane, int time) const {
        const Trajectories& to = arguments_.trajectories;
        store(to.acceleration, lane, time, [this](int i) { return lanes_.applied[i]; });
        store(to.enters, lane, time, [this](int i) { return lanes_.vehicles[i].delta & 1; });
        store(to.hold, lane, time, [this](int i) { return lanes_.vehicles[i].hold; });
        store(to.waited, lane, time, [this](int i) { return lanes_.vehicles[i].waited; });
    }

  private:
    bool follows(int lane, long scenario) const {
        const std::int8_t* const assigned = arguments_.assignments + scenario * problem_.pair_count;
        bool wrong = false;
        for (int p = 0; p < problem_.pair_count; ++p) {
            const int broken = lanes_.broken[p][lane];
            wrong |= (assigned[p] < 0 && (broken & FIRST_IS_PRIORITIZED) != 0) ||
                     (assigned[p] > 0 && (broken & FIRST_IS_YIELDER) != 0);
        }
        return !wrong;
    }

    // The lane's values of all vehicles, for every scenario of its branch; nothing where they are not wanted.
    template <class Value, class Read>
    void store(Value* out, int lane, int time, Read read) const {
        if (out == nullptr) {
            return;
        }
        const long count = problem_.vehicle_count;
        Value row[MAX_VEHICLES];
        for (int i = 0; i < count; ++i) {
            row[i] = static_cast<Value>(read(i)[lane]);
        }
        each_scenario(lane, [out, time, count, &row](long scenario) {
            Value* const to = out + (scenario * (STEPS + 1) + time) * count;
            __builtin_memcpy(to, row, static_cast<unsigned long>(count) * sizeof(Value));
        });
    }

    template <class Use>
    void each_scenario(int lane, Use use) const {
        const Branch& branch = lanes_.branch[lane];
        for (int s = branch.first; s < branch.last; ++s) {
            use(static_cast<long>(memory_.scenarios[s]));
        }
    }

    const Problem& problem_;
    const ScenarioArguments& arguments_;
    const BranchMemory& memory_;
    const BranchLanes& lanes_;
};

} // namespace intersection_env::INTERSECTION_ENV_ISA
