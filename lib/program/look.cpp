#include "look.h"

#include <unistd.h>

#include <algorithm>

#include "words.h"

namespace {

std::string without_options(const std::string& endpoint) { return endpoint.substr(0, endpoint.find('?')); }

// The user whose server the endpoint names; "": it names none.
std::string user_in(const std::string& endpoint) {
  const std::size_t question = endpoint.find('?');
  const std::string key = "user=";
  std::string options = question == endpoint.npos ? "" : endpoint.substr(question + 1);
  for (std::size_t end = 0; end != options.npos; options.erase(0, end + 1)) {
    end = options.find('&');
    if (options.starts_with(key)) return options.substr(key.size(), end - key.size());
  }
  return "";
}

// The sentence for an endpoint at which no server listens: it says what to do.
std::string nobody_at(const std::string& endpoint) {
  const std::string address = without_options(endpoint), user = user_in(endpoint);
  if (!user.empty()) return "no server of user " + user + " listens at " + address;
  const std::string name = address.substr(address.find(':') + 1);
  return "no server of user " + user_name(geteuid()) + " listens at " + address +
         "; one is started by: forceserver run --listen " + name + "; another user's is '" + name + "?user=NAME'";
}

std::string client_name(const char* kind) { return kind + std::string("-") + std::to_string(getpid()); }

}  // namespace

std::string full_endpoint(const std::string& server) {
  return server.starts_with("shm:") || server.starts_with("dds:") ? server : "shm:" + server;
}

std::string how_to_resume(const std::string& server) {
  const std::string user = user_in(server);
  const bool may_resume = user.empty() || geteuid() == 0 || user == user_name(geteuid()) || user == std::to_string(geteuid());
  if (may_resume) return "`forceserver resume " + in_shell(server) + "` lets it return";
  const bool is_root = user == "root" || user == "0";
  return "only the user " + user + ", whose server it is" + (is_root ? "," : ", and root") +
         " may let it return: forceserver resume " + in_shell(without_options(server));
}

Scene connect(const std::string& server, const char* kind) {
  const std::string endpoint = full_endpoint(server);
  try {
    return Scene::connect(endpoint, client_name(kind));
  } catch (const Error& failure) {
    if (failure.status() == FS_ERROR_NOT_FOUND) throw std::runtime_error(nobody_at(endpoint));
    throw;
  }
}

std::vector<fs_client> other_clients(const Scene& scene) {
  std::vector<fs_client> list = scene.get_clients();
  std::erase_if(list, [](const fs_client& client) {
    return client.process == std::uint32_t(getpid()) &&
           (client.name == client_name("watch") || client.name == client_name("clients"));
  });
  return list;
}

Look take_look(const Scene& scene, const std::string& endpoint) {
  Look look{};
  look.endpoint = endpoint;
  look.device = scene.get_device_info();
  look.time = scene.get_time();
  scene.get_hand(&look.hand, &look.response, &look.sent);
  look.servo = scene.get_servo_stats();
  look.clients = other_clients(scene);
  look.objects = scene.get_reports();
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
  return {now.servo.ticks - before.servo.ticks, now.servo.misses - before.servo.misses, now.servo.guarded - before.servo.guarded};
}
