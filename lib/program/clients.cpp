// forceserver clients: lists once who is connected to a server.
#include <cstdio>

#include "json.h"
#include "look.h"
#include "words.h"

namespace {

std::vector<std::string> table(const std::vector<fs_client>& list, double now) {
  Table table({"client", "process", "user", "objects", "wants N", "moves", "changes", "refused", "limited", "shapes MB",
               "since s"});
  for (const fs_client& c : list) {
    table.add({c.name, std::to_string(c.process), user_name(c.user), std::to_string(c.objects),
               format("%.2f", length(c.wrench.force)), std::to_string(c.moves), std::to_string(c.changes),
               std::to_string(c.refused), std::to_string(c.limited), format("%.1f", double(c.shape_bytes) / 1e6),
               c.name == std::string_view("server") ? "-" : format("%.1f", now - c.connected)});
  }
  return table.lines();
}

int list_clients(const ClientsOptions& options) {
  const Scene scene = connect(options.server, "clients");
  const std::vector<fs_client> list = other_clients(scene);
  const double now = scene.get_time();
  if (options.json) {
    Json entries = Json::array();
    for (const fs_client& client : list) entries.push_back(to_json(client, now));
    std::puts(dump({{"endpoint", full_endpoint(options.server)}, {"time", now}, {"clients", entries}}, 2).c_str());
  } else {
    for (const std::string& line : table(list, now)) std::puts(line.c_str());
  }
  write_out();
  return exit_fine;
}

}  // namespace

int clients(const ClientsOptions& options) {
  return at_server(options.server, [&] { return list_clients(options); });
}
