// Reads the line-oriented text files of this package (compiled maps, policies), checksum first.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "intersection_env/format_error.hpp"

namespace intersection_env {

std::uint32_t crc32(std::string_view bytes);

// The whole content of a file. Throws FormatError.
std::string read_file(const std::string& path);

class TextReader {
  public:
    // Checks the first line ("<magic> <version>", from `oldest` to `newest`) and the checksum in the last line. `where`
    // names the text in errors; remedy: what helps against another version.
    TextReader(std::string text, std::string where, std::string_view magic, int oldest, int newest,
               std::string_view remedy = "");

    // Each reads one whole line "<key> <values...>"; an empty key means the line holds values only.
    std::string word(std::string_view key);
    std::string rest_of_line(std::string_view key); // all that follows the key, blanks included
    std::int64_t count(std::string_view key, std::int64_t least, std::int64_t most);
    std::vector<float> floats(std::string_view key, std::size_t count);
    std::vector<float> counted_floats(std::string_view key, std::size_t most);

    // A whole number among values read as floats, between least and most.
    int whole(float value, int least, int most) const;

    void finish(); // nothing may be left but the checksum

    int version() const { return version_; }
    std::uint32_t checksum() const { return checksum_; }
    [[noreturn]] void fail(const std::string& problem) const;

  private:
    std::string_view whole_line(std::string_view key);
    std::vector<std::string_view> line(std::string_view key); // the tokens after the key

    std::string where_;
    std::string text_;
    std::string_view rest_;
    std::int64_t line_number_ = 0;
    int version_ = 0;
    std::uint32_t checksum_ = 0;
};

} // namespace intersection_env
