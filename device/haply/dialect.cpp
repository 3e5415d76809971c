#include "device/haply/dialect.h"

#include <charconv>
#include <cmath>

#include <nlohmann/json.hpp>

namespace fs::haply {
namespace {

using Json = nlohmann::json;

constexpr int deepest = 64;  // levels: the messages of the service have about six

// A parser would take memory and time for each level.
bool is_too_deep(std::string_view text) noexcept {
  int depth = 0;
  bool is_quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (is_quoted) {
      if (c == '\\') ++i;
      else is_quoted = c != '"';
    } else if (c == '"') {
      is_quoted = true;
    } else if (c == '[' || c == '{') {
      if (++depth > deepest) return true;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

// The member of an object; null where there is none.
const Json* member(const Json* object, const char* key) {
  if (!object || !object->is_object()) return nullptr;
  const auto found = object->find(key);
  return found == object->end() ? nullptr : &*found;
}

template <class... Keys>
const Json* member(const Json* object, const char* key, Keys... keys) {
  return member(member(object, key), keys...);
}

std::string text_of(const Json* value) { return value && value->is_string() ? value->get<std::string>() : std::string(); }

std::optional<bool> truth_of(const Json* value) {
  if (!value || !value->is_boolean()) return std::nullopt;
  return value->get<bool>();
}

std::optional<double> number_of(const Json* value) {
  if (!value || !value->is_number()) return std::nullopt;
  const double number = value->get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

std::optional<fs_vec3> vector_of(const Json* value) {
  const auto x = number_of(member(value, "x")), y = number_of(member(value, "y")), z = number_of(member(value, "z"));
  if (!x || !y || !z) return std::nullopt;
  return fs_vec3{*x, *y, *z};
}

// Of length 1, as near as a sensor tells it.
std::optional<fs_quat> quaternion_of(const Json* value) {
  const auto w = number_of(member(value, "w"));
  const auto v = vector_of(value);
  if (!w || !v) return std::nullopt;
  const double length = std::sqrt(*w * *w + v->x * v->x + v->y * v->y + v->z * v->z);
  if (!(std::fabs(length - 1) < 0.1)) return std::nullopt;
  fs_quat q{};
  q.w = *w / length, q.x = v->x / length, q.y = v->y / length, q.z = v->z / length;
  return q;
}

// A filter's number: a plain one, or the first in an object, whose key is not the same for all filters.
std::optional<double> filter_number(const Json* filter) {
  if (filter && filter->is_object()) {
    for (const Json& value : *filter) {
      if (const auto number = number_of(&value)) return number;
    }
  }
  return number_of(filter);
}

Arm arm_of(const Json& json) {
  Arm arm;
  arm.id = text_of(member(&json, "device_id"));
  const Json* const config = member(&json, "config");
  const Json* const state = member(&json, "state");
  const Json* const status = member(&json, "status");
  arm.kind = text_of(member(config, "type"));
  arm.position = vector_of(member(state, "cursor_position"));
  arm.velocity = vector_of(member(state, "cursor_velocity"));
  arm.force = vector_of(member(state, "current_cursor_force"));
  arm.is_calibrated = truth_of(member(status, "calibrated"));
  arm.is_ready = truth_of(member(status, "ready"));
  arm.has_power = truth_of(member(status, "power_supply"));
  arm.is_in_use = truth_of(member(status, "in_use"));
  arm.transform_scale = vector_of(member(state, "transform", "scale"));
  arm.transform_rotation = quaternion_of(member(state, "transform", "rotation"));
  if (!config) return arm;
  arm.mount_scale = vector_of(member(config, "mount", "scale"));
  arm.basis = text_of(member(config, "basis", "permutation"));
  arm.preset = text_of(member(config, "preset"));
  const Json* const filters = member(config, "filters");
  arm.damping = filter_number(member(filters, "damping"));
  arm.force_scale = filter_number(member(filters, "force_scale"));
  arm.force_gate = filter_number(member(filters, "force_gate"));
  return arm;
}

Grip grip_of(const Json& json) {
  Grip grip;
  grip.id = text_of(member(&json, "device_id"));
  const Json* const state = member(&json, "state");
  grip.orientation = quaternion_of(member(state, "orientation"));
  const auto is_down = [](const Json* button) { return truth_of(button).value_or(false); };
  const Json* const buttons = member(state, "buttons");
  grip.buttons = is_down(member(state, "button")) || is_down(member(buttons, "a")) ? 1 : 0;
  if (is_down(member(buttons, "b"))) grip.buttons |= 2;
  if (is_down(member(buttons, "c"))) grip.buttons |= 4;
  return grip;
}

template <class Made, class Make>
void read_list(const Json& message, const char* key, std::vector<Made>& out, Make make) {
  const Json* const list = member(&message, key);
  if (!list || !list->is_array()) return;
  for (const Json& json : *list) {
    Made made = make(json);
    if (!made.id.empty()) out.push_back(std::move(made));
  }
}

void append(std::string& out, double number) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, number);
  out.append(text, end.ptr);
}

}  // namespace

Dialect dialect_of_version(std::string_view version) noexcept {
  int major = 0, minor = 0;
  if (!version.empty() && version.front() == 'v') version.remove_prefix(1);  // as a tag has it
  const char* const end = version.data() + version.size();
  const auto dot = std::from_chars(version.data(), end, major);
  if (dot.ec != std::errc() || dot.ptr == end || *dot.ptr != '.') return Dialect::vector;
  if (std::from_chars(dot.ptr + 1, end, minor).ec != std::errc()) return Dialect::vector;
  return major < 3 || (major == 3 && minor < 5) ? Dialect::values : Dialect::vector;
}

const char* read_message(std::string_view text, Message& out) {
  out.arms.clear();
  out.grips.clear();
  if (is_too_deep(text)) return "a message is nested deeper than 64 levels";
  const Json message = Json::parse(text, nullptr, false);
  if (message.is_discarded() || !message.is_object()) return "a message is no JSON object";
  read_list(message, "inverse3", out.arms, arm_of);
  read_list(message, "verse_grip", out.grips, grip_of);
  read_list(message, "wireless_verse_grip", out.grips, grip_of);
  return nullptr;
}

std::string version_in(const std::string& text) {
  if (is_too_deep(text)) return "";
  const Json answer = Json::parse(text, nullptr, false);
  const Json* const data = member(&answer, "data");
  const std::string tag = text_of(member(data ? data : &answer, "git_tag"));
  return tag.empty() ? text_of(member(data ? data : &answer, "git_describe")) : tag;
}

void write_force(std::string& out, Dialect dialect, const std::string& id, fs_vec3 force) {
  out = R"({"inverse3":[{"device_id":)";
  out += Json(id).dump(-1, ' ', true, Json::error_handler_t::replace);
  out += R"(,"commands":{"set_cursor_force":{")";
  out += dialect == Dialect::values ? "values" : "vector";
  out += R"(":{"x":)";
  append(out, force.x);
  out += R"(,"y":)";
  append(out, force.y);
  out += R"(,"z":)";
  append(out, force.z);
  out += "}}}}]}";
}

std::string set_up_message(Dialect dialect, const std::string& id) {
  std::string text;
  write_force(text, dialect, id, {});
  Json message = Json::parse(text);
  message["inverse3"][0]["configure"]["preset"]["preset"] = "arm_front_centered";
  message["session"]["force_render_full_state"] = Json::object();
  message["session"]["configure"]["profile"]["name"] = "forceserver";
  return message.dump(-1, ' ', true, Json::error_handler_t::replace);
}

}  // namespace fs::haply
