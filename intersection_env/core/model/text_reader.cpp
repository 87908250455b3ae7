#include "model/text_reader.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

namespace intersection_env {
namespace {

constexpr std::string_view CHECKSUM_KEY = "checksum ";

std::array<std::uint32_t, 256> crc_table() {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t byte = 0; byte < 256; ++byte) {
        std::uint32_t value = byte;
        for (int bit = 0; bit < 8; ++bit) {
            value = (value & 1U) != 0U ? 0xEDB88320U ^ (value >> 1U) : value >> 1U;
        }
        table[byte] = value;
    }
    return table;
}

std::string quoted(std::string_view token) {
    std::string text = "\"";
    for (const char c : token.substr(0, 40)) {
        text += c >= ' ' && c < 127 ? c : '?';
    }
    return text + "\"";
}

} // namespace

std::uint32_t crc32(std::string_view bytes) {
    static const std::array<std::uint32_t, 256> table = crc_table();
    std::uint32_t value = 0xFFFFFFFFU;
    for (const char c : bytes) {
        value = table[(value ^ static_cast<unsigned char>(c)) & 0xFFU] ^ (value >> 8U);
    }
    return value ^ 0xFFFFFFFFU;
}

std::string read_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream content;
    if (!file || !(content << file.rdbuf())) {
        throw FormatError(path + ": cannot be read, or is empty");
    }
    return std::move(content).str();
}

TextReader::TextReader(std::string text, std::string where, std::string_view magic, int oldest, int newest,
                       std::string_view remedy)
    : where_(std::move(where)), text_(std::move(text)) {
    rest_ = text_;
    const std::string_view first = rest_.substr(0, rest_.find('\n'));
    if (first.substr(0, magic.size()) != magic || first.size() <= magic.size() || first[magic.size()] != ' ') {
        fail("is not a file of the kind \"" + std::string(magic) + "\"; it begins with " + quoted(first));
    }
    for (int one = oldest; one <= newest; ++one) {
        version_ = first.substr(magic.size() + 1) == std::to_string(one) ? one : version_;
    }
    if (version_ == 0) {
        fail("is of version " + quoted(first.substr(magic.size() + 1)) + ", this package reads version " +
             (oldest == newest ? std::to_string(newest) : std::to_string(oldest) + " to " + std::to_string(newest)) +
             std::string(remedy));
    }
    const std::size_t begin = text_.rfind("\nchecksum ") + 1;
    if (begin == 0 || text_.back() != '\n' || text_.find('\n', begin) != text_.size() - 1) {
        fail("is cut short: its last line is not a checksum");
    }
    const std::string_view written =
        std::string_view(text_).substr(begin + CHECKSUM_KEY.size(), text_.size() - begin - CHECKSUM_KEY.size() - 1);
    std::uint32_t expected = 0;
    const auto parsed = std::from_chars(written.data(), written.data() + written.size(), expected, 16);
    checksum_ = crc32(std::string_view(text_).substr(0, begin));
    if (parsed.ec != std::errc{} || parsed.ptr != written.data() + written.size() || expected != checksum_) {
        fail("is damaged: its content does not match its checksum");
    }
    rest_ = std::string_view(text_).substr(first.size() + 1, begin - first.size() - 1);
    line_number_ = 1;
}

void TextReader::fail(const std::string& problem) const {
    throw FormatError(where_ + (line_number_ > 0 ? ":" + std::to_string(line_number_) + ": " : ": ") + problem);
}

std::string_view TextReader::whole_line(std::string_view key) {
    ++line_number_;
    if (rest_.empty()) {
        fail("the file ends where \"" + std::string(key) + "\" was expected");
    }
    const std::string_view text = rest_.substr(0, rest_.find('\n'));
    rest_.remove_prefix(text.size() + 1);
    return text;
}

std::string TextReader::rest_of_line(std::string_view key) {
    const std::string_view text = whole_line(key);
    if (text.substr(0, key.size()) != key || text.size() <= key.size() || text[key.size()] != ' ') {
        fail("\"" + std::string(key) + "\" was expected, not " + quoted(text));
    }
    return std::string(text.substr(key.size() + 1));
}

std::vector<std::string_view> TextReader::line(std::string_view key) {
    std::string_view text = whole_line(key);
    std::vector<std::string_view> tokens;
    while (!text.empty()) {
        const std::size_t end = text.find(' ');
        tokens.push_back(text.substr(0, end));
        text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    }
    if (!key.empty()) {
        if (tokens.empty() || tokens.front() != key) {
            fail("\"" + std::string(key) + "\" was expected, not " + quoted(tokens.empty() ? "" : tokens.front()));
        }
        tokens.erase(tokens.begin());
    }
    return tokens;
}

std::string TextReader::word(std::string_view key) {
    const auto tokens = line(key);
    if (tokens.size() != 1 || tokens.front().empty()) {
        fail("\"" + std::string(key) + "\" takes one word");
    }
    return std::string(tokens.front());
}

std::int64_t TextReader::count(std::string_view key, std::int64_t least, std::int64_t most) {
    const std::string token = word(key);
    std::int64_t value = 0;
    const auto parsed = std::from_chars(token.data(), token.data() + token.size(), value);
    if (parsed.ec != std::errc{} || parsed.ptr != token.data() + token.size() || value < least || value > most) {
        fail("\"" + std::string(key) + "\" must be a whole number from " + std::to_string(least) + " to " +
             std::to_string(most) + ", not " + quoted(token));
    }
    return value;
}

std::vector<float> TextReader::floats(std::string_view key, std::size_t count) {
    const auto tokens = line(key);
    if (tokens.size() != count) {
        fail(std::to_string(count) + " numbers were expected, not " + std::to_string(tokens.size()));
    }
    std::vector<float> values;
    values.reserve(count);
    for (const std::string_view token : tokens) {
        float value = 0.0F;
        const auto parsed = std::from_chars(token.data(), token.data() + token.size(), value);
        if (parsed.ec != std::errc{} || parsed.ptr != token.data() + token.size() || !std::isfinite(value)) {
            fail("a finite number was expected, not " + quoted(token));
        }
        values.push_back(value);
    }
    return values;
}

std::vector<float> TextReader::counted_floats(std::string_view key, std::size_t most) {
    const std::string_view before = rest_;
    const std::int64_t number = line_number_;
    const auto tokens = line(key);
    rest_ = before;
    line_number_ = number;
    std::vector<float> values = floats(key, tokens.size());
    if (values.empty() || values.front() != static_cast<float>(values.size() - 1) || values.size() - 1 > most) {
        ++line_number_;
        fail("\"" + std::string(key) + "\" must begin with how many values follow, at most " + std::to_string(most));
    }
    values.erase(values.begin());
    return values;
}

int TextReader::whole(float value, int least, int most) const {
    const int number = value >= -1e9F && value <= 1e9F ? static_cast<int>(value) : least - 1;
    if (static_cast<float>(number) != value || number < least || number > most) {
        fail("a whole number from " + std::to_string(least) + " to " + std::to_string(most) + " was expected, not " +
             std::to_string(value));
    }
    return number;
}

void TextReader::finish() {
    if (!rest_.empty()) {
        ++line_number_;
        fail("nothing was expected here but the checksum");
    }
}

} // namespace intersection_env
