// JSON text to a tree, strictly: a key that is there twice in one object, or deep nesting, is an error too.
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace fs {

// path is the name for sentences. Throws PARSE with line and column.
nlohmann::json parse_json(std::string_view text, const std::string& path);

}  // namespace fs
