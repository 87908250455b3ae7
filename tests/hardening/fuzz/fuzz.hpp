// What the fuzzers share.
#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

#include "model/text_reader.hpp"

// The text with its checksum made right, or else the reader would refuse nearly all of them by that alone.
inline std::string with_checksum(const unsigned char* data, std::size_t size) {
    std::string text(reinterpret_cast<const char*>(data), size);
    const std::size_t line = text.rfind("checksum ");
    if (line != std::string::npos && (line == 0 || text[line - 1] == '\n')) {
        text.resize(line);
    }
    if (text.empty() || text.back() != '\n') {
        text += '\n';
    }
    char written[32];
    std::snprintf(written, sizeof written, "checksum %08x\n", intersection_env::crc32(text));
    return text + written;
}
