// What decides and what drives: rules with their parameters, or the two networks from a policy file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace intersection_env {

constexpr float DT = 0.2F;                                      // [s], paper, Section IV-B
constexpr int STEPS = 50;                                       // 10 s
constexpr int GAP_INPUTS = 4, DRIVING_INPUTS = 12, HIDDEN = 16; // paper, Table III
constexpr int ORDER_INPUTS = 21, ORDER_HIDDEN = 32;             // ours

// The inputs of the networks by name and unit, in order; paper, Table I.
inline constexpr std::array<std::string_view, 4> GAP_FEATURES = {"yielder_distance_to_pga_m", "yielder_speed_mps",
                                                                 "foe_distance_to_stop_line_m", "foe_speed_mps"};
inline constexpr std::array<std::string_view, 12> DRIVING_FEATURES = {"distance_to_stop_line_m",
                                                                      "speed_mps",
                                                                      "speed_limit_mps",
                                                                      "relative_heading_-10m_rad",
                                                                      "relative_heading_-3m_rad",
                                                                      "relative_heading_3m_rad",
                                                                      "relative_heading_10m_rad",
                                                                      "relative_heading_30m_rad",
                                                                      "relative_heading_100m_rad",
                                                                      "lead_distance_m",
                                                                      "lead_speed_mps",
                                                                      "enters"};

// What an order network sees of a pair; ours. Conflict, clear: the begin and the end of the conflict's interval on the
// vehicle's route, from its front and from its rear. The nearest other foe: of all to whom this one yields.
inline constexpr std::array<std::string_view, ORDER_INPUTS> ORDER_FEATURES = {"yielder_distance_to_conflict_m",
                                                                              "yielder_distance_to_clear_m",
                                                                              "yielder_distance_to_stop_line_m",
                                                                              "yielder_speed_mps",
                                                                              "yielder_speed_limit_mps",
                                                                              "yielder_lead_distance_m",
                                                                              "yielder_lead_speed_mps",
                                                                              "yielder_length_m",
                                                                              "foe_distance_to_conflict_m",
                                                                              "foe_distance_to_clear_m",
                                                                              "foe_distance_to_stop_line_m",
                                                                              "foe_speed_mps",
                                                                              "foe_speed_limit_mps",
                                                                              "foe_lead_distance_m",
                                                                              "foe_lead_speed_mps",
                                                                              "foe_length_m",
                                                                              "merging",
                                                                              "yielder_nearest_other_foe_s",
                                                                              "yielder_other_foes",
                                                                              "foe_nearest_foe_s",
                                                                              "foe_foes"};

// IN/UNITS/UNITS/1; weights row by row (output, input). The input scaling is folded into the first layer.
template <int INPUTS, int UNITS = HIDDEN>
struct Network {
    float weight0[UNITS * INPUTS], bias0[UNITS];
    float weight1[UNITS * UNITS], bias1[UNITS];
    float weight2[UNITS], bias2[1];
};

using GapNetwork = Network<GAP_INPUTS>;
using DrivingNetwork = Network<DRIVING_INPUTS>;
using OrderNetwork = Network<ORDER_INPUTS, ORDER_HIDDEN>;

// How far drivers are from where they are predicted to be under the order that came true, ours: for each second ahead
// quantiles of the distance at levels 0.05, 0.1, ..., 0.95, in units of a scale [m] that depends on the way predicted
// until then. Linear between ways and seconds, and 0 now.
struct Spread {
    static constexpr std::array<float, 5> WAYS = {0.0F, 5.0F, 15.0F, 40.0F, 80.0F}; // [m]
    static constexpr int SECONDS = 10, LEVELS = 19;

    struct Second {
        std::array<float, WAYS.size()> scale;
        std::array<float, LEVELS> shape;
    };
    std::array<Second, SECONDS> seconds;
};

// What a forecast needs beside who decides and drives.
struct ForecastModel {
    OrderNetwork order_network; // tanh; its output is the logit of the yielder going first
    Spread spread;
};

enum class Gap : std::uint8_t { critical_gap, sumo, network };
enum class Driver : std::uint8_t { idm, constant_velocity, network };
// Whether a driver keeps the quantile by which it accepts gaps through a prediction, or is the median driver anew at
// each step (the paper's).
enum class Patience : std::uint8_t { none, kept };
constexpr Patience DEFAULT_PATIENCE = Patience::none; // where a network decides about gaps

constexpr float NO_CURVES = 1000.0F; // [m/s²], a lateral acceleration at which no curve slows anybody

// Intelligent Driver Model; defaults: paper, Section IV-C.2. Ours: hardest braking, and how fast it goes where nobody
// is ahead: at `speed_share` of v_max, and into curves so slowly that the lateral acceleration is what it says, braking
// for them with `deceleration`.
struct IdmParameters {
    float standing_gap = 1.5F;              // s0 [m]
    float time_gap = 1.0F;                  // T [s]
    float acceleration = 2.5F;              // a [m/s²]
    float deceleration = 4.0F;              // b [m/s²]
    float deceleration_limit = 8.0F;        // [m/s²]
    float speed_share = 1.0F;               // v_0 / v_max
    float lateral_acceleration = NO_CURVES; // [m/s²]
};

struct Policy {
    std::string about = "{}"; // provenance and scores, JSON
    Gap gap = Gap::critical_gap;
    Driver driver = Driver::idm;
    IdmParameters idm;
    float acceleration_scale = 6.0F; // [m/s²] at a driving network's output of 1
    std::optional<GapNetwork> gap_network;
    std::optional<DrivingNetwork> driving_network;
    std::optional<ForecastModel> forecast; // null: made before there were forecasts, or a rule

    // Reads a policy file. Throws FormatError.
    static Policy read(const std::string& path);
    static Policy parse(std::string text, std::string where);
};

// Throws std::invalid_argument for a name that is none.
Gap gap_named(std::string_view name);
Driver driver_named(std::string_view name);
Patience patience_named(std::string_view name);

} // namespace intersection_env
