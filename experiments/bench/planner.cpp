// Times Planner::forecast and Planner::rank in turns, then many forecasts, and prints all times as JSON [ms]:
// planner MAP POLICY TRAFFIC ROUNDS CALLS. TRAFFIC: a vehicle a line, route position speed length width.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include <intersection_env/planner.hpp>

using namespace intersection_env;

namespace {

constexpr ForecastLimits ALL_PROBABILITY{1.0, 64, MOST_MANEUVERS};

template <class Work>
double milliseconds(Work work) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

void print(const char* name, const std::vector<double>& times, const char* end) {
    std::printf("\"%s\": [", name);
    for (std::size_t k = 0; k < times.size(); ++k) {
        std::printf("%s%.6f", k == 0 ? "" : ", ", times[k]);
    }
    std::printf("]%s", end);
}

} // namespace

int main(int, char** arguments) {
    const Planner planner(Map::read(arguments[1]), Policy::read(arguments[2]));
    std::vector<Vehicle> vehicles;
    std::ifstream file(arguments[3]);
    for (Vehicle v{}; file >> v.route >> v.position >> v.speed >> v.length >> v.width;) {
        vehicles.push_back(v);
    }
    const Traffic traffic = traffic_of(planner.map(), vehicles);
    std::size_t seen = 0;
    const auto forecasts = [&] { seen += planner.forecast(traffic, {}, ALL_PROBABILITY).likely.probability.size(); };
    const auto ranks = [&] { seen += planner.rank(traffic).maneuvers.size(); };
    std::vector<double> forecast, ranking, calls;
    forecasts();
    ranks();
    for (int round = 0; round < std::atoi(arguments[4]); ++round) {
        forecast.push_back(milliseconds(forecasts));
        ranking.push_back(milliseconds(ranks));
    }
    for (int call = 0; call < std::atoi(arguments[5]); ++call) {
        calls.push_back(milliseconds(forecasts));
    }
    std::printf("{");
    print("forecast_ms", forecast, ", ");
    print("ranking_ms", ranking, ", ");
    print("calls_ms", calls, ", ");
    std::printf("\"seen\": %zu}\n", seen);
    return 0;
}
