// What the commands of the program share.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <forceserver/driver.h>
#include <forceserver/forceserver.hpp>

using forceserver::Device;
using forceserver::Error;
using forceserver::Scene;
using forceserver::Server;
using forceserver::Servo;
using forceserver::Shape;

// Exit codes: all is well; the scene or the run has something odd; it could not be done.
enum { exit_fine = 0, exit_odd = 1, exit_failed = 2 };

inline double length(const fs_vec3& v) { return std::hypot(v.x, v.y, v.z); }
inline fs_vec3 minus(const fs_vec3& a, const fs_vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline fs_vec3 rotate(const fs_quat& q, const fs_vec3& v) {
  const fs_vec3 t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
  return {v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z,
          v.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

void load_driver(const std::string& file);  // the library of a device driver of one's own; empty: none

struct RunOptions {
  std::string scene, device = "sim:", driver, record, listen;
  double duration = 0, rate = 0, force_limit = 0;  // s, Hz, N; 0: without end, the device's rate, the device's limit
  double client_force = 0;                         // N; 0: the servo's limit
  std::uint32_t max_clients = 0, max_objects = 0;  // 0: those of fs_server_options
  bool locked = false, all_users = false, no_stop = false;
};
int run(const RunOptions& options);

struct DevicesOptions {
  std::string driver;
  bool json = false, why = false;
};
int devices(const DevicesOptions& options);

struct DoctorOptions {
  double seconds = 10;  // of the measurement
  bool json = false;
};
int doctor(const DoctorOptions& options);

struct TestDeviceOptions {
  std::string uri, driver;
  double push = 0;     // N; 0: no force
  double seconds = 5;  // of each measurement
  std::vector<std::string> requests;  // sent first, such as "home"
  double wait = 60;                   // s, until the device is ready after them
};
int test_device(const TestDeviceOptions& options);

struct HelloDeviceOptions {
  std::string uri, driver, report;    // report: the file; empty: hello-SCHEME-SERIAL.md
  double force = 0;                   // N; 0: 1, or what the device gives at most
  std::vector<std::string> requests;  // sent first, such as "home"
  double wait = 60;                   // s, until the device is ready after them
};
int hello_device(const HelloDeviceOptions& options);

struct CalibrateOptions {
  std::string device, driver;
};
int calibrate(const CalibrateOptions& options);

struct RequestOptions {
  std::string device, request, driver;
};
int request(const RequestOptions& options);

struct CheckOptions {
  std::string file, device = "sim:", driver;
  double scale = 1;  // m per unit of a mesh file
};
int check(const CheckOptions& options);

struct EvaluateOptions {
  std::string scene, input = "-", object;
  double time = 0;  // s since the scene was loaded
};
int evaluate(const EvaluateOptions& options);

// server: NAME, or an endpoint in full.
struct ClientsOptions {
  std::string server;
  bool json = false;
};
int clients(const ClientsOptions& options);

struct WatchOptions {
  std::string server;
  double interval = 0.5;  // s
  unsigned count = 0;     // looks; 0: without end
  bool json = false;
};
int watch(const WatchOptions& options);

int resume(const std::string& server);
int stop(const std::string& server);
