// Watches the clients. At the end it prints how long, how hard and in which direction each pushed, in the rover's axes.
#include <cmath>
#include <cstdio>
#include <map>

#include "client.h"

struct Account : Felt {
  fs_client last;
};

static double length(const fs_vec3& v) { return std::hypot(v.x, v.y, v.z); }

static void print_line(Client& client, double time, const std::vector<fs_client>& clients) {
  fs_wrench sent;
  check(fs_scene_get_hand(client.scene(), nullptr, nullptr, &sent));
  std::string parts;
  for (const fs_client& other : clients) {
    const double force = length(other.wrench.force);
    char text[100 + FS_NAME_SIZE];
    std::snprintf(text, sizeof text, "  %s %.2f", other.name, force);
    if (force >= 0.01) parts += text;
  }
  client.say("%4.1f s  the hand feels %.2f N:%s", time, length(sent.force), parts.c_str());
}

static void print_table(const std::map<std::string, Account>& accounts, const fs_servo_stats& servo) {
  std::printf("\n%-12s %8s %8s %8s %9s %8s %8s %8s %8s %8s\n", "who pushed", "felt, s", "mean, N", "most, N", "sideways",
              "forward", "up", "moves", "changes", "refused");
  for (const auto& [name, a] : accounts) {
    using Count = unsigned long long;
    std::printf("%-12s %8.1f %8.2f %8.2f %9.2f %8.2f %8.2f %8llu %8llu %8llu\n", name.c_str(), a.seconds, a.mean(a.sum), a.most,
                a.mean(a.sideways), a.mean(a.forward), a.mean(a.up), Count(a.last.moves), Count(a.last.changes),
                Count(a.last.refused));
  }
  std::printf(
      "sideways, forward, up: the mean size of the force along the rover's axles, ahead of it and up from the ground, N\n");
  std::printf("\nthe servo: %.0f Hz, %llu ticks, %llu missed; late p99 %.0f us, compute p99 %.0f us; faults: %s\n", servo.rate,
              (unsigned long long)servo.ticks, (unsigned long long)servo.misses, servo.late_p99 * 1e6, servo.compute_p99 * 1e6,
              servo.faults ? std::to_string(servo.faults).c_str() : "none");
}

static void account(Client& client, const Arguments&) {
  const double period = 0.02;
  std::map<std::string, Account> accounts;
  std::vector<fs_client> clients;
  fs_servo_stats servo = fs_servo_stats_init();
  for (int i = 1; client.wait(period); ++i) {
    std::size_t count = 0;
    clients.resize(64);
    check(fs_scene_get_clients(client.scene(), clients.data(), clients.size(), &count));
    clients.resize(std::min(count, clients.size()));
    fs_pose rover = {};  // all zeros until there is a rover: then the parts of the force are 0
    find_rover(client.scene(), "rover/wheels", &rover);
    for (const fs_client& other : clients) {
      if (other.objects == 0) continue;  // a client that only watches, such as this one
      Account& account = accounts[other.name];
      account.add(other.wrench.force, rover, period);  // the device has the axes of the landscape
      account.last = other;
    }
    check(fs_scene_get_servo_stats(client.scene(), &servo));
    if (i % 50 == 0) print_line(client, i * period, clients);
  }
  print_table(accounts, servo);
}

int main(int argc, char** argv) { return run_client(argc, argv, "account", "", 0, account); }
