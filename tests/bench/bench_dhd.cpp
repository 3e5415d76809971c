// From a pose of a device of Force Dimension to the force that answers it: by a servo with the driver dhd, and by the loop of the
// maker's examples, which reads the position, computes a spring and sets the force. bench_dhd [ROUNDS]
//
// The maker's library is a stand-in, each of whose calls takes 250 us. So this measures the software on the way, not the device.
#include <dlfcn.h>

#include <cstdlib>

#include "device/makers/drd_stand_in.h"
#include "turnarounds.h"

using namespace scenes;

int main(int count, char** arguments) {
  const int rounds = count > 1 ? std::atoi(arguments[1]) : 5;
  void* const library = dlopen(STAND_IN, RTLD_NOW | RTLD_LOCAL);
  const auto function = [&](auto*& out, const char* name) { out = reinterpret_cast<std::remove_reference_t<decltype(out)>>(dlsym(library, name)); };
  makers::DrdStandIn* (*stand_in)();
  int (*open)(char);
  int (*close)(char);
  int (*enable)(unsigned char, char);
  int (*get)(double*, double*, double*, double[3][3], char);
  int (*set)(double, double, double, double, double, double, double, char);
  function(stand_in, "drd_stand_in_here");
  function(open, "drdOpenID");
  function(close, "drdClose");
  function(enable, "dhdEnableForce");
  function(get, "dhdGetPositionAndOrientationFrame");
  function(set, "dhdSetForceAndTorqueAndGripperForce");

  makers::Handle& handle = stand_in()->devices.front()->handle;
  const auto note = [&](std::vector<double>* times) { handle.note_turnarounds(times); };
  bench::Turnarounds servo("servo and driver"), plain("the loop of the maker");
  for (int i = 0; i < rounds; ++i) {
    bench::run_servo(open_device("dhd:0?library=" STAND_IN).get(), servo, note);
    const auto id = static_cast<char>(open(0));
    enable(1, id);
    bench::run_plain(plain, note, [&] {
      double x = 0, y = 0, z = 0, frame[3][3];
      get(&x, &y, &z, frame, id);
      set(-100 * x, -100 * y, -100 * z, 0, 0, 0, 0, id);
    });
    close(id);
  }
  servo.print();
  plain.print();
}
