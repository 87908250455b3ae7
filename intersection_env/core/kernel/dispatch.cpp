#include "kernel/dispatch.hpp"

#include <cstdlib>
#include <stdexcept>

namespace intersection_env {

namespace isa_baseline {
extern const Kernel KERNEL;
}
#ifdef INTERSECTION_ENV_X86
namespace isa_v3 {
extern const Kernel KERNEL;
}
namespace isa_v4 {
extern const Kernel KERNEL;
}
#endif

namespace {

// Best last. Single features, since clang 16 does not know the names of whole levels.
std::vector<const Kernel*> kernels() {
    std::vector<const Kernel*> list{&isa_baseline::KERNEL};
#ifdef INTERSECTION_ENV_X86
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")) {
        list.push_back(&isa_v3::KERNEL);
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
            __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
            __builtin_cpu_supports("avx512vl")) {
            list.push_back(&isa_v4::KERNEL);
        }
    }
#endif
    return list;
}

} // namespace

std::vector<std::string> available_kernels() {
    std::vector<std::string> names;
    for (const Kernel* one : kernels()) {
        names.emplace_back(one->name);
    }
    return names;
}

const Kernel& kernel_named(const std::string& name) {
    std::string known;
    for (const Kernel* one : kernels()) {
        if (one->name == name) {
            return *one;
        }
        known += std::string(known.empty() ? "" : ", ") + one->name;
    }
    throw std::invalid_argument("instruction set \"" + name + "\" is not one this machine has: " + known);
}

namespace {

// By the environment variable, or null.
const Kernel* demanded() {
    const char* name = std::getenv("INTERSECTION_ENV_ISA");
    return name != nullptr && *name != '\0' ? &kernel_named(name) : nullptr;
}

} // namespace

const Kernel& kernel() {
    static const Kernel& chosen = demanded() != nullptr ? *demanded() : *kernels().back();
    return chosen;
}

const Kernel& kernel_for_worlds(int worlds) {
    const std::vector<const Kernel*> known = kernels();
    const bool wide = known.size() == 3 && worlds > known[1]->lanes;
    return demanded() != nullptr || known.size() < 3 || wide ? kernel() : *known[1];
}

} // namespace intersection_env
