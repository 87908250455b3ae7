// Scenarios that have a beginning in common, which is predicted once.
//
// A branch is a state of the traffic and the scenarios that have come to it; each lane holds one, at a step of its own.
// Where the scenarios of a branch no longer decide alike, it is parted: those of one decision stay in the lane; for
// each other decision a branch is laid on a pile, with the state at the begin of the step, and a lane that is through
// takes it up. Every lane computes what it would compute for each of its scenarios alone, to the same bytes.
#include "kernel/kernel.hpp"
#include "kernel/scenario_lanes.hpp"

namespace intersection_env::INTERSECTION_ENV_ISA {
namespace {

// Assignments of a branch whose scenarios have not the same one; in the second case some of them have none.
constexpr int DIFFERENT = 2, DIFFERENT_OR_NONE = 3;
constexpr int FIRST_IS_PRIORITIZED = 1, FIRST_IS_YIELDER = 2; // bits of what a branch has disobeyed

constexpr std::uint64_t bit(int vehicle) { return std::uint64_t{1} << vehicle; }

using Decision = BranchDecision;

void operator|=(Decision& sum, const Decision& other) {
    sum.waits |= other.waits;
    sum.refused |= other.refused;
    sum.told |= other.told;
}

bool operator==(const Decision& a, const Decision& b) {
    return a.waits == b.waits && a.refused == b.refused && a.told == b.told;
}

// What a pair says under each assignment, from -1 on, in the lanes whose scenarios have different ones.
struct Question {
    int pair;
    unsigned lanes; // one bit a lane, here and below
    unsigned refuses_yielder[3], refuses_prioritized[3], tells_yielder[3], tells_prioritized[3], keeps_prioritized[3];
};

struct Choice {
    int pair;
    Decision of[3]; // by assignment, from -1 on
};

struct Branches : ScenarioLanes {
    Ints waited_before[MAX_VEHICLES];
    Ints broken[MAX_PAIRS];
    Floats distance;
    Branch branch[WIDTH];
    Ints busy;            // mask: the lane holds a branch
    std::uint64_t heeded; // whose holds somebody asks for; one bit a vehicle
    Question questions[MAX_PAIRS];
    int question_count;
    Choice choices[MAX_PAIRS];
    std::uint8_t differs[MAX_PAIRS], has_none[MAX_PAIRS];
};

class Prediction {
  public:
    Prediction(const Problem& problem, const ScenarioArguments& arguments, const BranchMemory& memory, Branches& lanes)
        : problem_(problem), arguments_(arguments), memory_(memory), lanes_(lanes) {}

    void run() {
        begin();
        const IdmParameters& p = problem_.idm;
        const float inverse_root = 0.5F / __builtin_sqrtf(p.acceleration * p.deceleration);
        while (fill_lanes()) {
            observe_lanes();
            finish_branches();
            ask_pairs();
            part_branches();
            decide_vehicles(problem_, lanes_);
            drive_lanes(inverse_root);
        }
    }

  private:
    // One branch, of all scenarios, on the pile.
    void begin() {
        for (int s = 0; s < arguments_.scenarios; ++s) {
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
        lay_down({0, arguments_.scenarios, 0}, 0);
        lanes_.branch[0] = memory_.pile[0];
        find_assignments(0);
        find_heeded();
        for (int l = 0; l < WIDTH; ++l) {
            clear(l);
        }
    }

    const std::int8_t* assignments(int index) const {
        return arguments_.assignments + static_cast<long>(memory_.scenarios[index]) * problem_.pair_count;
    }

    // Where nobody is left unassigned only the decision to enter counts; elsewhere some holds are asked for too, and
    // those of who is ahead of them in a queue.
    void find_heeded() {
        lanes_.heeded = 0;
        for (int p = 0; p < problem_.pair_count; ++p) {
            const ProblemPair& pair = problem_.pairs[p];
            const int assignment = lanes_.assignments[p][0];
            if (assignment == 0 || assignment == DIFFERENT_OR_NONE) {
                lanes_.heeded |= bit(pair.prioritized) | (pair.by_arrival ? bit(pair.yielder) : 0);
            }
        }
        for (std::uint64_t before = ~lanes_.heeded; before != lanes_.heeded;) {
            before = lanes_.heeded;
            for (int i = 0; i < problem_.vehicle_count; ++i) {
                const ProblemVehicle& vehicle = problem_.vehicles[i];
                for (int c = vehicle.first_candidate; (before & bit(i)) != 0 && c < vehicle.last_candidate; ++c) {
                    const LeadCandidate& ahead = problem_.candidates[c];
                    lanes_.heeded |= ahead.same_stop_lane ? bit(ahead.other) : 0;
                }
            }
        }
    }

    // Calls with every row of words that a branch is remembered by, and the place of its word.
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

    std::uint32_t* state(int place) const { return memory_.states + static_cast<long>(place) * memory_.words; }

    // A branch on the pile, in the state that this lane had at the begin of the step.
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

    // False where all is done.
    bool fill_lanes() {
        for (int l = 0; l < WIDTH && piled_ > 0; ++l) {
            if (lanes_.busy[l] == 0) {
                take_up(l);
            }
        }
        return any(lanes_.busy);
    }

    void clear(int lane) {
        lanes_.busy[lane] = 0;
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            lanes_.vehicles[i].present[lane] = 0;
        }
    }

    // Which the scenarios of the lane's branch have in common.
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

    void observe_lanes() {
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            lanes_.waited_before[i] = lanes_.vehicles[i].waited;
        }
        observe_vehicles(problem_, problem_.driver == Driver::network, lanes_);
        if (arguments_.minimum_distance != nullptr) {
            lanes_.distance = smallest_distance(problem_, lanes_, lanes_.distance);
        }
        if (arguments_.followed != nullptr) {
            find_broken();
        }
    }

    // Who has an assignment that is disobeyed now, or would, of the scenarios of each branch.
    void find_broken() {
        for (int p = 0; p < problem_.pair_count; ++p) {
            const ProblemPair& pair = problem_.pairs[p];
            const Floats beyond = lanes_.vehicles[pair.yielder].front - pair.yielder_entry;
            const Floats foe_beyond = lanes_.vehicles[pair.prioritized].front - pair.prioritized_entry;
            const Ints second = all_ints(-1), first = all_ints(1);
            lanes_.broken[p] |=
                disobeys(active(pair, second, lanes_), second, beyond, foe_beyond) & FIRST_IS_PRIORITIZED;
            lanes_.broken[p] |= disobeys(active(pair, first, lanes_), first, beyond, foe_beyond) & FIRST_IS_YIELDER;
        }
    }

    // Those at the end of the horizon; their lanes are free.
    void finish_branches() {
        for (int l = 0; l < WIDTH; ++l) {
            if (lanes_.busy[l] != 0 && lanes_.branch[l].step == STEPS) {
                for (int s = lanes_.branch[l].first; s < lanes_.branch[l].last; ++s) {
                    store(l, s);
                }
                clear(l);
            }
        }
    }

    void store(int lane, int index) const {
        const long scenario = memory_.scenarios[index];
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            arguments_.time_loss[scenario * problem_.vehicle_count + i] = lanes_.vehicles[i].time_loss[lane];
        }
        if (arguments_.minimum_distance != nullptr) {
            arguments_.minimum_distance[scenario] = lanes_.distance[lane];
        }
        if (arguments_.followed != nullptr) {
            const std::int8_t* assigned = assignments(index);
            bool wrong = false;
            for (int p = 0; p < problem_.pair_count; ++p) {
                const int broken = lanes_.broken[p][lane];
                wrong |= (assigned[p] < 0 && (broken & FIRST_IS_PRIORITIZED) != 0) ||
                         (assigned[p] > 0 && (broken & FIRST_IS_YIELDER) != 0);
            }
            arguments_.followed[scenario] = !wrong;
        }
    }

    void ask_pairs() {
        lanes_.question_count = 0;
        for (int p = 0; p < problem_.pair_count; ++p) {
            const Ints assignment = lanes_.assignments[p], different = lanes_.busy & (assignment > 1);
            decide_pair(problem_, problem_.pairs[p], assignment, ~different, lanes_);
            if (any(different)) {
                ask(p, different);
            }
        }
    }

    void ask(int p, Ints different) {
        Question& question = lanes_.questions[lanes_.question_count];
        question.pair = p;
        question.lanes = 0;
        for (int way = -1; way <= 1; ++way) {
            const Ints where = way == 0 ? different & (lanes_.assignments[p] == DIFFERENT_OR_NONE) : different;
            const Answer found = answer(problem_, problem_.pairs[p], all_ints(way), where, lanes_);
            question.refuses_yielder[way + 1] = bits(found.refuses_yielder);
            question.refuses_prioritized[way + 1] = bits(found.refuses_prioritized);
            question.tells_yielder[way + 1] = bits(found.tells_yielder);
            question.tells_prioritized[way + 1] = bits(found.tells_prioritized);
            question.keeps_prioritized[way + 1] = bits(found.keeps_prioritized);
            question.lanes |= bits(found.refuses_yielder | found.refuses_prioritized | found.keeps_prioritized);
        }
        lanes_.question_count += question.lanes != 0 ? 1 : 0;
    }

    void part_branches() {
        unsigned asked = 0;
        for (int q = 0; q < lanes_.question_count; ++q) {
            asked |= lanes_.questions[q].lanes;
        }
        for (; asked != 0; asked &= asked - 1) {
            const int lane = __builtin_ctz(asked), choices = find_choices(lane);
            if (choices > 0) {
                part(lane, choices);
            }
        }
    }

    // What the scenarios of the lane's branch choose between; what changes nothing for a vehicle is left out.
    int find_choices(int lane) {
        Decision matters{0, 0, 0}; // what would change something
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            const PredictedVehicle& vehicle = lanes_.vehicles[i];
            const bool refused = vehicle.refused[lane] != 0, waits = refused || vehicle.kept[lane] != 0;
            if (vehicle.refused_by_assignment[lane] == 0 && !is_settled(vehicle, lane)) {
                matters.waits |= waits ? 0 : bit(i);
                matters.refused |= refused ? 0 : bit(i) & lanes_.heeded;
                matters.told |= bit(i) & lanes_.heeded;
            }
        }
        int count = 0;
        for (int q = 0; q < lanes_.question_count; ++q) {
            const Question& question = lanes_.questions[q];
            if ((question.lanes >> lane & 1) != 0) {
                Choice& choice = lanes_.choices[count];
                choice.pair = question.pair;
                bool counts = false;
                for (int way = 0; way < 3; ++way) {
                    choice.of[way] = decision(question, way, lane, matters);
                    counts |= (choice.of[way].waits | choice.of[way].refused | choice.of[way].told) != 0;
                }
                count += counts ? 1 : 0;
            }
        }
        return count;
    }

    static bool is_settled(const PredictedVehicle& vehicle, int lane) {
        return vehicle.delta[lane] != 0 && vehicle.distance_to_stop_line[lane] < vehicle.braking_distance[lane] &&
               vehicle.goes_on[lane] != 0;
    }

    Decision decision(const Question& question, int way, int lane, const Decision& matters) const {
        const ProblemPair& pair = problem_.pairs[question.pair];
        const auto vehicles = [lane, i = bit(pair.yielder), j = bit(pair.prioritized)](unsigned of_i, unsigned of_j) {
            return ((of_i >> lane & 1) != 0 ? i : 0) | ((of_j >> lane & 1) != 0 ? j : 0);
        };
        const std::uint64_t refused = vehicles(question.refuses_yielder[way], question.refuses_prioritized[way]);
        const std::uint64_t told = vehicles(question.tells_yielder[way], question.tells_prioritized[way]);
        return {(refused | vehicles(0, question.keeps_prioritized[way])) & matters.waits, refused & matters.refused,
                told & matters.told};
    }

    // Those who decide as the first of them stay; all others are laid on the pile.
    void part(int lane, int choices) {
        const int first = lanes_.branch[lane].first, last = lanes_.branch[lane].last;
        for (int s = first; s < last; ++s) {
            const std::int8_t* assigned = assignments(s);
            Decision sum{0, 0, 0};
            for (int c = 0; c < choices; ++c) {
                sum |= lanes_.choices[c].of[assigned[lanes_.choices[c].pair] + 1];
            }
            memory_.decisions[s] = sum;
        }
        const Decision stays = memory_.decisions[first];
        const int end = gather(first, last);
        for (int begin = end; begin < last;) {
            const int next = gather(begin, last);
            lay_down({begin, next, lanes_.branch[lane].step}, lane);
            begin = next;
        }
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            PredictedVehicle& vehicle = lanes_.vehicles[i];
            const bool refused = (stays.refused & bit(i)) != 0, told = (stays.told & bit(i)) != 0;
            const bool kept = (stays.waits & bit(i)) != 0;
            vehicle.refused[lane] |= refused || told ? -1 : 0;
            vehicle.refused_by_assignment[lane] |= told ? -1 : 0;
            vehicle.kept[lane] |= kept ? -1 : 0;
        }
        if (end < last) {
            lanes_.branch[lane].last = end;
            find_assignments(lane);
        }
    }

    // Brings those that decide as the first one together at the begin; returns where they end.
    int gather(int first, int last) {
        const Decision wanted = memory_.decisions[first];
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

    template <class Value>
    static void exchange(Value& a, Value& b) {
        const Value kept = a;
        a = b;
        b = kept;
    }

    void drive_lanes(float inverse_root) {
        for (int i = 0; i < problem_.vehicle_count; ++i) {
            PredictedVehicle& vehicle = lanes_.vehicles[i];
            const Floats top_speed = all(problem_.vehicles[i].max_speed);
            const Floats wanted = any(vehicle.present) ? drive(problem_, inverse_root, top_speed, vehicle) : all(0.0F);
            advance(problem_.vehicles[i], wanted, vehicle);
        }
        for (Branch& branch : lanes_.branch) {
            ++branch.step;
        }
    }

    const Problem& problem_;
    const ScenarioArguments& arguments_;
    const BranchMemory& memory_;
    Branches& lanes_;
    int piled_ = 0;
};

} // namespace

void predict_branching(const Problem& problem, const ScenarioArguments& arguments, const BranchMemory& memory,
                       Workspace& workspace) {
    Prediction(problem, arguments, memory, reinterpret_cast<Branches&>(workspace)).run();
}

Workspace* create_branches() { return reinterpret_cast<Workspace*>(new Branches); }
void destroy_branches(Workspace* workspace) { delete reinterpret_cast<Branches*>(workspace); }

} // namespace intersection_env::INTERSECTION_ENV_ISA
