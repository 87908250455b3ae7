// When a world that is done starts anew.
#pragma once

#include <cstdint>
#include <string_view>

namespace intersection_env {

enum class Autoreset : std::uint8_t { off, same_step, next_step };

// Throws std::invalid_argument for a name that is none.
Autoreset autoreset_named(std::string_view name);

} // namespace intersection_env
