// Plays the recorded telemetry of a rover, the scout. The two dust devils that it saw move as recorded and keep the
// hand away. The scout itself draws the hand with a pulsing force that fades with its battery.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "client.h"
#include "telemetry.h"

static std::vector<Telemetry> read_telemetry(const std::string& path) {
  std::vector<Telemetry> rows;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    Telemetry row;
    fs_vec3 &s = row.scout, &a = row.devils[0], &b = row.devils[1];
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &row.time, &s.x, &s.y, &s.z, &row.battery, &a.x,
                    &a.y, &a.z, &b.x, &b.y, &b.z) == 11) {
      rows.push_back(row);
    }
  }
  if (rows.size() < 2) throw std::runtime_error("no telemetry in " + path);
  return rows;
}

static fs_vec3 between(const fs_vec3& a, const fs_vec3& b, double part) {
  return {std::lerp(a.x, b.x, part), std::lerp(a.y, b.y, part), std::lerp(a.z, b.z, part)};
}

// The state at `time` s of the recording; before its beginning the first state, after its end the last.
static Telemetry at(const std::vector<Telemetry>& rows, double time) {
  auto next = std::upper_bound(rows.begin(), rows.end(), time, [](double t, const Telemetry& row) { return t < row.time; });
  next = std::clamp(next, rows.begin() + 1, rows.end() - 1);
  const Telemetry &a = next[-1], &b = *next;
  const double part = std::clamp((time - a.time) / (b.time - a.time), 0.0, 1.0);
  return {time,
          between(a.scout, b.scout, part),
          std::lerp(a.battery, b.battery, part),
          {between(a.devils[0], b.devils[0], part), between(a.devils[1], b.devils[1], part)}};
}

static const char* const devils[] = {"dust devil 1", "dust devil 2"};

static void add_objects(fs_scene* scene, const Telemetry& begin, fs_object& scout) {
  scout.pose.position = begin.scout;
  // The force is 0 at the scout itself and largest at 2000 m, with a slow pulse. The gain, N, falls with the battery.
  scout.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 3 * begin.battery, 0, 3);
  check(fs_curve_create_expression("(0.75 + 0.25*sin(9*t)) * d/2000 * exp(0.5 - (d/2000)^2/2)", &scout.front.curve));
  check(fs_object_set(scene, &scout));
  for (int i = 0; i < 2; ++i) {
    fs_object devil = fs_object_init(devils[i], FS_PRIMITIVE_POINT);
    devil.pose.position = begin.devils[i];
    devil.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 2.5, 1200, 2.5);
    check(fs_object_set(scene, &devil));
  }
}

static void play(Client& client, const Arguments& arguments) {
  const std::vector<Telemetry> rows = read_telemetry(arguments[0]);
  const double seconds = std::atof(arguments[1].c_str());
  const double lead = arguments.size() > 2 ? std::atof(arguments[2].c_str()) : 0;
  if (!(seconds > 0 && lead >= 0)) throw std::runtime_error("SECONDS must be above 0, LEAD not below");

  fs_object scout = fs_object_init("scout", FS_PRIMITIVE_POINT);
  add_objects(client.scene(), rows.front(), scout);
  client.say("plays %.0f s in %.0f s, from a battery of %.0f %% on", rows.back().time, seconds, 100 * rows.front().battery);
  double begin, now, told = rows.front().battery;
  check(fs_scene_get_time(client.scene(), &begin));
  while (client.wait(0.04)) {
    check(fs_scene_get_time(client.scene(), &now));
    const Telemetry row = at(rows, (now - begin - lead) * rows.back().time / seconds);
    const auto move = [&](const char* name, const fs_vec3& position) {  // the library derives the twist
      const fs_pose pose = {position, {1, 0, 0, 0}};
      check(fs_object_move(client.scene(), name, &pose, nullptr, now));
    };
    move("scout", row.scout);
    for (int i = 0; i < 2; ++i) move(devils[i], row.devils[i]);
    if (std::abs(row.battery - told) < 0.01) continue;
    told = row.battery;  // the charge has changed by one percent
    scout.front.gain = 3 * told;
    check(fs_object_change(client.scene(), &scout, FS_PART_PROFILES));
  }
  client.say("the battery of the scout is at %.0f %%: it draws with %.2f N at most", 100 * told, scout.front.gain);
  fs_curve_destroy(scout.front.curve);
}

int main(int argc, char** argv) { return run_client(argc, argv, "telemetry", " FILE SECONDS [LEAD]", 2, play); }
