// Predicts 5 s of a traffic in 25 cycles, each from the state of the one before, and prints position, speed, delta,
// hold and patience of everybody still present: chained MAP POLICY TRAFFIC free|kept|patient|drawn. kept: the best
// order is kept to; patient: drivers keep their patience; drawn: all have that of the level 0.8.
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include <intersection_env/planner.hpp>

using namespace intersection_env;

int main(int, char** arguments) {
    const std::string how = arguments[4];
    const Planner planner(Map::read(arguments[1]), Policy::read(arguments[2]), 1,
                          how == "patient" ? std::optional(Patience::kept) : std::nullopt);
    std::vector<Vehicle> vehicles;
    std::ifstream file(arguments[3]);
    std::string id;
    for (Vehicle v{}; file >> id >> v.route >> v.position >> v.speed >> v.length >> v.width;) {
        vehicles.push_back(v);
    }
    Traffic now = traffic_of(planner.map(), vehicles);
    std::vector<std::int8_t> priorities;
    if (how == "drawn") {
        now.patience = planner.patience(now, std::vector<double>(vehicles.size(), 0.8));
    }
    if (how == "kept") {
        const Ranking ranking = planner.rank(now);
        priorities.assign(ranking.priorities_of(0).begin(), ranking.priorities_of(0).end());
    }
    for (int cycle = 0; cycle < 25; ++cycle) {
        const Prediction next = planner.predict(now, priorities);
        priorities = planner.priorities_at(next, 1);
        now = planner.traffic_at(next, 1);
    }
    for (std::size_t i = 0; i < now.route.size(); ++i) {
        std::printf("%.9g %.9g %d %d %.9g\n", now.position[i], now.speed[i], now.delta[i], now.hold[i],
                    now.has_patience() ? now.patience[i] : 0.0F);
    }
    return 0;
}
