// Branches: states of a prediction, each with the scenarios that have come to it; in lanes, and on a pile.
#pragma once

#include "kernel/scenario_lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {

// Assignments of a branch whose scenarios have not the same one; in the second case some of them have none.
constexpr int DIFFERENT = 2, DIFFERENT_OR_NONE = 3;

constexpr int FIRST_IS_PRIORITIZED = 1, FIRST_IS_YIELDER = 2;

// A branch in each lane that is busy.
struct BranchLanes : ScenarioLanes {
    Ints busy; // mask
    Branch branch[WIDTH];
    Ints waited_before[MAX_VEHICLES]; // at the begin of the step
    Floats applied[MAX_VEHICLES];     // accelerations of the last step
    Ints broken[MAX_PAIRS]; // which assignments have been disobeyed so far, or would have been: the bits below
    Floats distance;        // the smallest one so far
    std::uint8_t differs[MAX_PAIRS], has_none[MAX_PAIRS];
};

inline bool operator==(const BranchDecision& a, const BranchDecision& b) {
    return a.waits == b.waits && a.refused == b.refused && a.told == b.told;
}

template <class Value>
inline void exchange(Value& a, Value& b) {
    const Value kept = a;
    a = b;
    b = kept;
}

class Branches {
  public:
    Branches(const Problem& problem, const std::int8_t* assignments, const BranchMemory& memory, BranchLanes& lanes)
        : problem_(problem), assignments_(assignments), memory_(memory), lanes_(lanes) {}

    // One branch on the pile, of all scenarios; its assignments are those of the first lane, until lanes are filled.
    void begin(int scenarios) {
        for (int s = 0; s < scenarios; ++s) {
            memory_.scenarios[s] = s;
        }
        start(problem_, lanes_);
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            lanes_.waited_before[i] = lanes_.vehicles[i].waited;
        }
        for (int p = 0; p < problem_.pair_count; ++p) {
            lanes_.broken[p] = Ints{};
        }
        lanes_.distance = all(NO_DISTANCE);
        lanes_.branch[0] = {0, scenarios, 0};
        find_assignments(0);
        lay_down(lanes_.branch[0], 0);
        for (int l = 0; l < WIDTH; ++l) {
            clear(l);
        }
    }

    // Every lane that is free takes up a branch, as long as there are some; false where all is done.
    bool fill_lanes() {
        for (int l = 0; l < WIDTH && piled_ > 0; ++l) {
            if (lanes_.busy[l] == 0) {
                take_up(l);
            }
        }
        return any(lanes_.busy);
    }

    // The lane is free.
    void clear(int lane) {
        lanes_.busy[lane] = 0;
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            lanes_.vehicles[i].present[lane] = 0;
        }
    }

    // Of memory.scenarios[index]: (pair,).
    const std::int8_t* assignments(int index) const {
        return assignments_ + static_cast<long>(memory_.scenarios[index]) * problem_.pair_count;
    }

    // Parts the lane's branch by memory.decisions: those who decide as the first of them stay, for each other decision
    // a branch is laid on the pile, in the state of the begin of the step.
    void part(int lane) {
        const int first = lanes_.branch[lane].first, last = lanes_.branch[lane].last, end = gather(first, last);
        for (int begin = end; begin < last;) {
            const int next = gather(begin, last);
            lay_down({begin, next, lanes_.branch[lane].step}, lane);
            begin = next;
        }
        if (end < last) {
            lanes_.branch[lane].last = end;
            find_assignments(lane);
        }
    }

  private:
    // Brings those that decide as the first one together at the begin; returns where they end.
    int gather(int first, int last) {
        const BranchDecision wanted = memory_.decisions[first];
        int end = first + 1;
        for (int s = end; s < last; ++s) {
            if (memory_.decisions[s] == wanted) {
                exchange(memory_.decisions[s], memory_.decisions[end]);
                exchange(memory_.scenarios[s], memory_.scenarios[end]);
                ++end;
            }
        }
        return end;
    }

    void lay_down(const Branch& branch, int lane) {
        memory_.pile[piled_] = branch;
        each_row(state(piled_++), [lane](const Words& values, std::uint32_t& word) { word = values[lane]; });
    }

    void take_up(int lane) {
        lanes_.branch[lane] = memory_.pile[--piled_];
        each_row(state(piled_), [lane](Words& values, std::uint32_t word) { values[lane] = word; });
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            lanes_.vehicles[i].waited[lane] = lanes_.waited_before[i][lane];
        }
        lanes_.busy[lane] = -1;
        find_assignments(lane);
    }

    std::uint32_t* state(int place) const { return memory_.states + static_cast<long>(place) * memory_.words; }

    // Calls with every row of words that a branch is remembered by, and the place of its word: WORDS_OF_A_VEHICLE, one
    // a pair, WORDS_OF_A_BRANCH.
    template <class Use>
    void each_row(std::uint32_t* words, Use use) {
        const auto row = [&](auto& values) { use(reinterpret_cast<Words&>(values), *words++); };
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            PredictedVehicle& vehicle = lanes_.vehicles[i];
            row(vehicle.position);
            row(vehicle.speed);
            row(vehicle.time_loss);
            row(vehicle.present);
            row(vehicle.delta);
            row(vehicle.hold);
            row(lanes_.waited_before[i]);
        }
        for (int p = 0; p < problem_.pair_count; ++p) {
            row(lanes_.broken[p]);
        }
        row(lanes_.distance);
    }

    // Those that the scenarios of the lane's branch have in common.
    void find_assignments(int lane) {
        const Branch& branch = lanes_.branch[lane];
        const std::int8_t* const __restrict first = assignments(branch.first);
        std::uint8_t* const __restrict differs = lanes_.differs;
        std::uint8_t* const __restrict has_none = lanes_.has_none;
        const int pairs = problem_.pair_count;
        for (int p = 0; p < pairs; ++p) {
            differs[p] = 0;
            has_none[p] = first[p] == 0;
        }
        for (int s = branch.first + 1; s < branch.last; ++s) {
            const std::int8_t* const __restrict other = assignments(s);
            for (int p = 0; p < pairs; ++p) {
                differs[p] |= static_cast<std::uint8_t>(other[p] ^ first[p]);
                has_none[p] |= static_cast<std::uint8_t>(other[p] == 0);
            }
        }
        for (int p = 0; p < pairs; ++p) {
            const int different = has_none[p] != 0 ? DIFFERENT_OR_NONE : DIFFERENT;
            lanes_.assignments[p][lane] = differs[p] != 0 ? different : first[p];
        }
    }

    const Problem& problem_;
    const std::int8_t* assignments_; // (scenario, pair)
    const BranchMemory& memory_;
    BranchLanes& lanes_;
    int piled_ = 0;
};

} // namespace intersection_env::INTERSECTION_ENV_ISA
