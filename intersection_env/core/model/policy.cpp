#include "intersection_env/policy.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "model/text_reader.hpp"

namespace intersection_env {
namespace {

constexpr double LARGEST_WEIGHT = 1.0e6; // ours: beyond it sums of the kernel may leave the finite numbers

// x -> (x - shift) * scale becomes part of the first layer, computed in float64.
template <int INPUTS, int UNITS>
void fold_scaling(const TextReader& reader, Network<INPUTS, UNITS>& network, const std::vector<float>& shift,
                  const std::vector<float>& scale) {
    bool finite = true;
    for (std::size_t o = 0; o < UNITS; ++o) {
        double bias = network.bias0[o];
        for (std::size_t i = 0; i < INPUTS; ++i) {
            const double weight = static_cast<double>(network.weight0[o * INPUTS + i]) * scale[i];
            bias -= weight * shift[i];
            network.weight0[o * INPUTS + i] = static_cast<float>(weight);
            finite = finite && std::abs(weight) < LARGEST_WEIGHT;
        }
        network.bias0[o] = static_cast<float>(bias);
        finite = finite && std::abs(bias) < LARGEST_WEIGHT;
    }
    if (!finite) {
        reader.fail("a weight of the first layer times its input's scale exceeds " + std::to_string(LARGEST_WEIGHT));
    }
}

std::vector<float> weights(TextReader& reader, std::string_view key, std::size_t count) {
    std::vector<float> values = reader.floats(key, count);
    for (const float value : values) {
        if (!(std::abs(value) < LARGEST_WEIGHT)) {
            reader.fail("a weight must be below " + std::to_string(LARGEST_WEIGHT) + " in size");
        }
    }
    return values;
}

template <int INPUTS, int UNITS = HIDDEN>
Network<INPUTS, UNITS> read_network(TextReader& reader, const std::array<std::string_view, INPUTS>& features) {
    if (reader.count("inputs", 1, 1000) != INPUTS) {
        reader.fail("the network must have " + std::to_string(INPUTS) + " inputs");
    }
    std::vector<float> shift, scale;
    for (const std::string_view feature : features) {
        const std::vector<float> row = reader.floats(feature, 2);
        shift.push_back(row[0]);
        scale.push_back(row[1]);
    }
    Network<INPUTS, UNITS> network{};
    const auto layer = [&reader](std::size_t outputs, std::size_t inputs, float* weight, float* bias) {
        const std::vector<float> shape = reader.floats("layer", 2);
        if (shape[0] != static_cast<float>(outputs) || shape[1] != static_cast<float>(inputs)) {
            reader.fail("a layer of " + std::to_string(outputs) + " outputs and " + std::to_string(inputs) +
                        " inputs was expected");
        }
        std::ranges::copy(weights(reader, "bias", outputs), bias);
        for (std::size_t o = 0; o < outputs; ++o) {
            std::ranges::copy(weights(reader, "", inputs), weight + o * inputs);
        }
    };
    layer(UNITS, INPUTS, network.weight0, network.bias0);
    layer(UNITS, UNITS, network.weight1, network.bias1);
    layer(1, UNITS, network.weight2, network.bias2);
    fold_scaling(reader, network, shift, scale);
    return network;
}

Spread read_spread(TextReader& reader) {
    const auto is_large = [](float value) { return !(std::abs(value) < LARGEST_WEIGHT); };
    Spread spread{};
    for (Spread::Second& second : spread.seconds) {
        std::ranges::copy(reader.floats("spread_scale", second.scale.size()), second.scale.begin());
        if (!std::ranges::all_of(second.scale, [](float scale) { return scale >= 0.0F; })) {
            reader.fail("the scale of a spread must not be negative");
        }
        std::ranges::copy(reader.floats("spread_shape", second.shape.size()), second.shape.begin());
        if (!std::ranges::is_sorted(second.shape)) {
            reader.fail("the quantiles of a spread must not fall");
        }
        if (std::ranges::any_of(second.scale, is_large) || std::ranges::any_of(second.shape, is_large)) {
            reader.fail("the scale and the quantiles of a spread must be below " + std::to_string(LARGEST_WEIGHT) +
                        " in size");
        }
    }
    return spread;
}

IdmParameters read_idm(TextReader& reader) {
    const std::vector<float> row = reader.floats("idm", 7);
    if (!std::ranges::all_of(row, [](float value) { return value > 0.0F && value <= NO_CURVES; })) {
        reader.fail("the parameters of the IDM must be above 0 and at most " + std::to_string(NO_CURVES));
    }
    return {row[0], row[1], row[2], row[3], row[4], row[5], row[6]};
}

} // namespace

Gap gap_named(std::string_view name) {
    if (name == "critical_gap")
        return Gap::critical_gap;
    if (name == "sumo")
        return Gap::sumo;
    if (name == "network")
        return Gap::network;
    throw std::invalid_argument("gap must be \"critical_gap\", \"sumo\" or \"network\", not \"" + std::string(name) +
                                "\"");
}

Driver driver_named(std::string_view name) {
    if (name == "idm")
        return Driver::idm;
    if (name == "constant_velocity")
        return Driver::constant_velocity;
    if (name == "network")
        return Driver::network;
    throw std::invalid_argument("driver must be \"idm\", \"constant_velocity\" or \"network\", not \"" +
                                std::string(name) + "\"");
}

Patience patience_named(std::string_view name) {
    if (name == "none")
        return Patience::none;
    if (name == "kept")
        return Patience::kept;
    throw std::invalid_argument("patience must be \"none\" or \"kept\", not \"" + std::string(name) + "\"");
}

Policy Policy::read(const std::string& path) { return parse(read_file(path), path); }

Policy Policy::parse(std::string text, std::string where) {
    TextReader reader(std::move(text), std::move(where), "intersection_env policy", 1, 2);
    Policy policy;
    policy.about = reader.rest_of_line("about");
    const float dt = reader.floats("dt", 1)[0];
    if (dt != DT) {
        reader.fail("dt is " + std::to_string(dt) + " s, the core steps by " + std::to_string(DT) + " s");
    }
    policy.acceleration_scale = reader.floats("acceleration_scale", 1)[0];
    if (!(policy.acceleration_scale > 0.0F)) {
        reader.fail("acceleration_scale must be positive");
    }
    try {
        policy.gap = gap_named(reader.word("gap"));
        policy.driver = driver_named(reader.word("driver"));
    } catch (const std::invalid_argument& error) {
        reader.fail(error.what());
    }
    if (policy.driver == Driver::idm) {
        policy.idm = read_idm(reader);
    }
    if (policy.gap == Gap::network) {
        policy.gap_network = read_network<GAP_INPUTS>(reader, GAP_FEATURES);
    }
    if (policy.driver == Driver::network) {
        policy.driving_network = read_network<DRIVING_INPUTS>(reader, DRIVING_FEATURES);
    }
    if (reader.version() == 2) {
        policy.forecast =
            ForecastModel{read_network<ORDER_INPUTS, ORDER_HIDDEN>(reader, ORDER_FEATURES), read_spread(reader)};
    }
    reader.finish();
    return policy;
}

} // namespace intersection_env
