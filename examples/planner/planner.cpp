// A planner's cycle: reads an intersection, who drives there and a traffic, and prints every crossing order by the time
// it saves, the best safe one first; and which orders are the most probable ones if nobody intervenes.
//
//     planner MAP POLICY TRAFFIC [LINES]
//
// A line of the traffic file is one vehicle: id, route, position of its centre along the route [m], speed [m/s],
// length [m], width [m].
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <intersection_env/planner.hpp>

namespace env = intersection_env;

namespace {

struct Vehicles {
    std::vector<std::string> ids;
    std::vector<env::Vehicle> states;
};

Vehicles read_vehicles(const std::string& path) {
    std::ifstream file(path);
    if (!file) {
        throw std::runtime_error(path + ": cannot be read");
    }
    Vehicles vehicles;
    for (std::string line; std::getline(file, line);) {
        std::istringstream row(line);
        std::string id;
        env::Vehicle v{};
        if (!(row >> id >> v.route >> v.position >> v.speed >> v.length >> v.width)) {
            throw std::runtime_error(path + ": a line must be: id route position speed length width; it is: " + line);
        }
        vehicles.ids.push_back(id);
        vehicles.states.push_back(v);
    }
    return vehicles;
}

void print(const env::Planner& planner, const env::Traffic& traffic, const std::vector<std::string>& ids,
           const env::Ranking& ranking, std::size_t lines) {
    const std::vector<std::string> orders =
        env::in_words(planner.map(), traffic, ranking.pairs, ids, ranking.priorities.data(), ranking.maneuvers.size());
    std::printf("%9s %9s %9s %9s  %-8s %-5s %-8s  %s\n", "total/s", "worst/s", "gain/s", "distance", "followed", "safe",
                "execute", "order");
    for (std::size_t k = 0; k < orders.size() && k < lines; ++k) {
        const env::Maneuver& m = ranking.maneuvers[k];
        std::printf("%9.4f %9.4f %9.4f %9.4f  %-8s %-5s %-8s  %s\n", m.total_time_loss, m.worst_time_loss, m.gain,
                    static_cast<double>(m.minimum_distance), m.followed ? "yes" : "no", m.safe ? "yes" : "no",
                    m.worth_executing ? "yes" : "no", m.intervention ? orders[k].c_str() : "no intervention");
    }
    std::printf("%zu maneuvers, %zu orders left out\n", ranking.maneuvers.size(), ranking.left_out);
}

void print(const env::Planner& planner, const env::Traffic& traffic, const std::vector<std::string>& ids,
           const env::OrderProbabilities& likely) {
    const std::size_t shown = std::min<std::size_t>(likely.probability.size(), 3);
    const std::vector<std::string> orders =
        env::in_words(planner.map(), traffic, likely.pairs, ids, likely.orders.data(), shown);
    std::printf("the most probable of %zu feasible orders:\n", likely.feasible);
    for (std::size_t k = 0; k < shown; ++k) {
        std::printf("%8.4f %%  %s\n", 100.0 * likely.probability[k], orders[k].c_str());
    }
}

} // namespace

int main(int count, char** arguments) try {
    if (count < 4) {
        std::fprintf(stderr, "usage: planner MAP POLICY TRAFFIC [LINES]\n");
        return 2;
    }
    // Once: an intersection, and who drives there.
    const env::Planner planner(env::Map::read(arguments[1]), env::Policy::read(arguments[2]));

    // In each cycle: the vehicles now, their crossing orders ranked, and the best one's trajectories.
    const Vehicles vehicles = read_vehicles(arguments[3]);
    const env::Traffic traffic = env::traffic_of(planner.map(), vehicles.states);
    const env::Ranking ranking = planner.rank(traffic);
    print(planner, traffic, vehicles.ids, ranking, count > 4 ? std::strtoul(arguments[4], nullptr, 10) : 10);

    const env::Prediction best = planner.predict(traffic, ranking.priorities_of(0));
    std::printf("after 10 s of the first:");
    for (std::size_t i = 0; i < vehicles.ids.size(); ++i) {
        const std::size_t last = env::STEPS * vehicles.ids.size() + i;
        std::printf(" %s at %.1f m with %.1f m/s;", vehicles.ids[i].c_str(), static_cast<double>(best.position[last]),
                    static_cast<double>(best.speed[last]));
    }
    std::printf("\n");

    // What the vehicles do by themselves, and how probable it is; not every policy file says it.
    if (planner.policy().forecast) {
        print(planner, traffic, vehicles.ids, planner.forecast(traffic).likely);
    }
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
}
