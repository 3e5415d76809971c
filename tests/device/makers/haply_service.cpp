#include "device/makers/haply_service.h"

#include <arpa/inet.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

#include <nlohmann/json.hpp>

namespace makers {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;
using Json = nlohmann::json;

namespace {

stability::DeviceModel model_of(double force_max) {
  stability::DeviceModel model;
  model.force_max = force_max;
  return model;
}

void wait_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

Json json_of(fs_vec3 v) { return {{"x", v.x}, {"y", v.y}, {"z", v.z}}; }
Json json_of(fs_quat q) { return {{"w", q.w}, {"x", q.x}, {"y", q.y}, {"z", q.z}}; }

}  // namespace

HaplyDevice::HaplyDevice(std::string its_id, double force_max, double watchdog)
    : id(std::move(its_id)), handle(model_of(force_max), stability::light, watchdog) {}

HaplyService::HaplyService(std::string version) : version_(std::move(version)) { start(); }
HaplyService::~HaplyService() { stop(); }

void HaplyService::start() {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int yes = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  place.sin_port = htons(port_);
  socklen_t size = sizeof place;
  if (bind(listener_, reinterpret_cast<sockaddr*>(&place), size) != 0 || ::listen(listener_, 8) != 0) std::abort();
  getsockname(listener_, reinterpret_cast<sockaddr*>(&place), &size);
  port_ = ntohs(place.sin_port);
  const std::lock_guard lock(mutex_);
  is_ending_ = false;
  threads_.emplace_back([this, listener = listener_] { listen(listener); });
}

void HaplyService::stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
    shutdown(listener_, SHUT_RDWR);
    for (const int socket : sockets_) shutdown(socket, SHUT_RDWR);
  }
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      threads.swap(threads_);
    }
    if (threads.empty()) break;
    for (std::thread& thread : threads) thread.join();
    threads.clear();
  }
  close(std::exchange(listener_, -1));
}

void HaplyService::listen(int listener) {
  for (int socket; (socket = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC)) >= 0;) {
    const std::lock_guard lock(mutex_);
    if (is_ending_) {
      close(socket);
      return;
    }
    sockets_.insert(socket);
    threads_.emplace_back([this, socket] {
      serve(dup(socket));
      const std::lock_guard ended(mutex_);
      sockets_.erase(socket);
      shutdown(socket, SHUT_RDWR);
      close(socket);
    });
  }
}

void HaplyService::serve(int socket) {
  asio::io_context context;
  beast::websocket::stream<tcp::socket> stream(context);
  stream.next_layer().assign(tcp::v4(), socket);
  error_code error;
  stream.next_layer().set_option(tcp::no_delay(true), error);
  beast::flat_buffer buffer;
  http::request<http::string_body> request;
  http::read(stream.next_layer(), buffer, request, error);
  if (error) return;
  if (!beast::websocket::is_upgrade(request)) {
    http::response<http::string_body> response(http::status::ok, 11);
    response.body() = Json{{"git_tag", version_}}.dump();
    response.prepare_payload();
    http::write(stream.next_layer(), response, error);
    return;
  }
  stream.accept(request, error);
  std::string text = with([](HaplyService& service) { return service.state(true); });
  stream.write(asio::buffer(text), error);
  while (!error) {
    while (with([](HaplyService& service) { return service.is_deaf && !service.is_ending_; })) wait_a_little();
    beast::flat_buffer message;
    stream.read(message, error);
    if (error) break;
    double lag_now = 0;
    with([&](HaplyService&) {
      int waiting = 0;
      ioctl(socket, FIONREAD, &waiting);
      most_waiting = std::max(most_waiting, waiting);
      ++messages;
      lag_now = lag;
    });
    std::this_thread::sleep_for(std::chrono::duration<double>(lag_now));
    std::string raw;
    bool is_quiet = false;
    with([&](HaplyService&) {
      take(beast::buffers_to_string(message.data()));
      text = answer.empty() ? state(std::exchange(wants_all_, false)) : answer;
      raw = bytes;
      is_quiet = is_silent;
      if (closes) error = asio::error::eof;
    });
    if (error) break;
    if (!raw.empty()) send(socket, raw.data(), raw.size(), MSG_NOSIGNAL);
    else if (!is_quiet) stream.write(asio::buffer(text), error);
  }
}

void HaplyService::take(const std::string& text) {
  const Json message = Json::parse(text, nullptr, false);
  if (!message.is_object()) return void(++refused);
  wants_all_ = wants_all_ || message.value("/session"_json_pointer, Json::object()).contains("force_render_full_state");
  for (const Json& one : message.value("inverse3", Json::array())) {
    for (const auto& device : devices) {
      if (one.value("device_id", "") != device->id) continue;
      if (one.value("/configure/preset/preset"_json_pointer, "") == "arm_front_centered") device->offset = {};
      const Json command = one.value("/commands/set_cursor_force"_json_pointer, Json::object());
      const bool is_old = command.contains("values");
      if (!is_old && (version_ < "3.5" || !command.contains("vector"))) return void(++refused);
      const Json& force = command[is_old ? "values" : "vector"];
      device->commanded = {force.at("x"), force.at("y"), force.at("z")};
      const double given = device->has_power ? device->weight : 0;
      device->handle.command({given * device->commanded.x, given * device->commanded.y, given * device->commanded.z});
    }
  }
}

std::string HaplyService::state(bool is_full) {
  Json message{{"inverse3", Json::array()}, {"verse_grip", Json::array()}, {"wireless_verse_grip", Json::array()}};
  if (is_full) message["session_id"] = 7;
  for (const auto& device : devices) {
    const fs_vec3 x = device->handle.measure().position, by = device->shift, from = device->offset;
    const double told = device->force_told;
    const fs_vec3 force = device->commanded;
    Json it{{"device_id", device->id}};
    it["state"] = {{"cursor_position", json_of(fs_vec3{x.x + by.x + from.x, x.y + by.y + from.y, x.z + by.z + from.z})},
                   {"cursor_velocity", json_of(fs_vec3{})},
                   {"current_cursor_force", json_of(fs_vec3{told * force.x, told * force.y, told * force.z})},
                   {"transform",
                    {{"position", json_of(fs_vec3{})},
                     {"rotation", json_of(fs_quat{1, 0, 0, 0})},
                     {"scale", json_of(fs_vec3{device->scale, device->scale, device->scale})}}}};
    it["status"] = {{"calibrated", device->is_calibrated},
                    {"ready", device->is_ready},
                    {"power_supply", device->has_power},
                    {"in_use", device->is_in_use},
                    {"started", true}};
    if (is_full) {
      it["config"] = {{"type", device->kind},
                      {"basis", {{"permutation", device->basis}}},
                      {"filters", {{"force_gate", {{"gain", 0.3}}}, {"damping", {{"scalar", device->damping}}}}}};
    }
    message["inverse3"].push_back(it);
  }
  for (const HaplyGrip& grip : grips) {
    Json it{{"device_id", grip.id}, {"state", {{"orientation", json_of(grip.orientation)}}}};
    if (grip.is_wireless) it["state"]["buttons"] = {{"a", grip.a}, {"b", grip.b}, {"c", grip.c}};
    else it["state"]["button"] = grip.a;
    message[grip.is_wireless ? "wireless_verse_grip" : "verse_grip"].push_back(it);
  }
  return message.dump();
}

}  // namespace makers
