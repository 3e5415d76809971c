// JSON that several commands share. A number that is not finite becomes null.
#pragma once

#include <nlohmann/json.hpp>

#include "program.h"

using Json = nlohmann::ordered_json;

Json to_json(const fs_vec3& v);
Json to_json(const fs_client& client, double now);  // now: s, scene's clock
std::string dump(const Json& json, int indent = -1);
