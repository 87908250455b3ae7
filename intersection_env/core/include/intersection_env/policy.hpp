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

// IN/16/16/1; weights row by row (output, input). The input scaling is folded into the first layer.
template <int INPUTS>
struct Network {
    float weight0[HIDDEN * INPUTS], bias0[HIDDEN];
    float weight1[HIDDEN * HIDDEN], bias1[HIDDEN];
    float weight2[HIDDEN], bias2[1];
};

using GapNetwork = Network<GAP_INPUTS>;
using DrivingNetwork = Network<DRIVING_INPUTS>;

enum class Gap : std::uint8_t { critical_gap, sumo, network };
enum class Driver : std::uint8_t { idm, constant_velocity, network };

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

    // Reads a policy file. Throws FormatError.
    static Policy read(const std::string& path);
    static Policy parse(std::string text, std::string where);
};

// Throws std::invalid_argument for a name that is none.
Gap gap_named(std::string_view name);
Driver driver_named(std::string_view name);

} // namespace intersection_env
