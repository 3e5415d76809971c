#include "look.h"

#include <unistd.h>

#include <algorithm>

#include "words.h"

namespace {

// The sentence for an endpoint at which no server listens: it says what to do.
std::string nobody_at(const std::string& endpoint) {
  const std::size_t question = endpoint.find('?');
  const std::string address = endpoint.substr(0, question), key = "user=";
  std::string options = question == endpoint.npos ? "" : endpoint.substr(question + 1);
  for (std::size_t end = 0; end != options.npos; options.erase(0, end + 1)) {
    end = options.find('&');
    if (!options.starts_with(key)) continue;
    return "no server of user " + options.substr(key.size(), end - key.size()) + " listens at " + address;
  }
  const std::string name = address.substr(address.find(':') + 1);
  return "no server of user " + user_name(geteuid()) + " listens at " + address +
         "; one is started by: forceserver run --listen " + name + "; another user's is '" + name + "?user=NAME'";
}

std::string client_name(const char* kind) { return kind + std::string("-") + std::to_string(getpid()); }

}  // namespace

std::string full_endpoint(const std::string& server) {
  return server.starts_with("shm:") || server.starts_with("dds:") ? server : "shm:" + server;
}

Scene connect(const std::string& server, const char* kind) {
  const std::string endpoint = full_endpoint(server);
  fs_scene* scene = nullptr;
  const fs_status status = fs_scene_connect(endpoint.c_str(), client_name(kind).c_str(), &scene);
  if (status == FS_ERROR_NOT_FOUND) throw std::runtime_error(nobody_at(endpoint));
  require(status);
  return Scene(scene);
}

std::vector<fs_client> other_clients(fs_scene* scene) {
  std::vector<fs_client> list = get_list(fs_scene_get_clients, scene);
  std::erase_if(list, [](const fs_client& client) {
    return client.process == std::uint32_t(getpid()) &&
           (client.name == client_name("watch") || client.name == client_name("clients"));
  });
  return list;
}

Look take_look(fs_scene* scene, const std::string& endpoint) {
  Look look{};
  look.endpoint = endpoint;
  look.device = fs_device_info_init();
  look.servo = fs_servo_stats_init();
  require(fs_scene_get_device_info(scene, &look.device));
  require(fs_scene_get_time(scene, &look.time));
  require(fs_scene_get_hand(scene, &look.hand, &look.response, &look.sent));
  require(fs_scene_get_servo_stats(scene, &look.servo));
  look.clients = other_clients(scene);
  look.objects = get_list(fs_scene_get_reports, scene);
  return look;
}

Rates rates_of(const fs_client& client, const Look& now, const Look& before) {
  const auto same = std::find_if(before.clients.begin(), before.clients.end(), [&](const fs_client& earlier) {
    return std::string_view(earlier.name) == client.name && earlier.connected == client.connected;
  });
  const bool is_new = same == before.clients.end();
  const double period = now.time - before.time;
  if (!(period > 0)) return {};
  return {double(client.moves - (is_new ? 0 : same->moves)) / period,
          double(client.changes - (is_new ? 0 : same->changes)) / period};
}

Ticks ticks_of(const Look& now, const Look& before) {
  return {now.servo.ticks - before.servo.ticks, now.servo.misses - before.servo.misses,
          now.servo.guarded - before.servo.guarded};
}
