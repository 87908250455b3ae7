// Writes a forecast as it lies in memory: forecasts MAP POLICY TRAFFIC [PRIORITY...].
//
// A line of the traffic file is one vehicle, as in the example planner. A priority for each pair is what is given.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include <intersection_env/planner.hpp>

using namespace intersection_env;

namespace {

template <class T>
void write(const std::vector<T>& values) {
    std::fwrite(values.data(), sizeof(T), values.size(), stdout);
}

} // namespace

int main(int count, char** arguments) {
    const Planner planner(Map::read(arguments[1]), Policy::read(arguments[2]));
    std::ifstream file(arguments[3]);
    std::vector<Vehicle> vehicles;
    std::string id;
    Vehicle v{};
    while (file >> id >> v.route >> v.position >> v.speed >> v.length >> v.width) {
        vehicles.push_back(v);
    }
    std::vector<std::int8_t> given;
    for (int k = 4; k < count; ++k) {
        given.push_back(static_cast<std::int8_t>(std::atoi(arguments[k])));
    }
    const Forecast forecast = planner.forecast(traffic_of(planner.map(), vehicles), given);
    const std::vector<double> levels{0.1, 0.5, 0.9};
    write(forecast.likely.orders);
    write(forecast.likely.probability);
    write(forecast.likely.yielder_first);
    write(forecast.prediction.position);
    write(forecast.prediction.time_loss);
    write(planner.position_quantiles(forecast, levels));
    return 0;
}
