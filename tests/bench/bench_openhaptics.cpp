// From a pose of a Touch to the force that answers it: by a servo with the driver openhaptics, and by the callback of the maker's
// examples, which reads the position, computes a spring and sets the force within one frame. bench_openhaptics [ROUNDS]
//
// The maker's library is a stand-in, whose frames take 250 us at their begin and at their end. So this measures the software on the
// way, not the device.
#include <dlfcn.h>

#include <cstdlib>

#include "device/makers/hd_stand_in.h"
#include "turnarounds.h"

using namespace scenes;

namespace {

unsigned (*init)(const char*);
void (*disable)(unsigned), (*begin)(unsigned), (*end)(unsigned), (*enable)(unsigned), (*start)(), (*stop)(), (*unschedule)(unsigned long);
void (*get)(unsigned, double*), (*set)(unsigned, const double*);
unsigned long (*schedule)(unsigned (*)(void*), void*, unsigned short);

unsigned spring(void* data) {
  const unsigned device = *static_cast<unsigned*>(data);
  double transform[16];
  begin(device);
  get(0x2052, transform);
  const double force[3] = {-0.1 * transform[12], -0.1 * transform[13], -0.1 * transform[14]};  // 100 N/m
  set(0x2700, force);
  end(device);
  return 1;
}

}  // namespace

int main(int count, char** arguments) {
  const int rounds = count > 1 ? std::atoi(arguments[1]) : 5;
  void* const library = dlopen(STAND_IN, RTLD_NOW | RTLD_LOCAL);
  const auto function = [&](auto*& out, const char* name) { out = reinterpret_cast<std::remove_reference_t<decltype(out)>>(dlsym(library, name)); };
  makers::HdStandIn* (*stand_in)();
  function(stand_in, "hd_stand_in_here");
  function(init, "hdInitDevice"), function(disable, "hdDisableDevice"), function(begin, "hdBeginFrame"), function(end, "hdEndFrame");
  function(enable, "hdEnable"), function(start, "hdStartScheduler"), function(stop, "hdStopScheduler"), function(unschedule, "hdUnschedule");
  function(get, "hdGetDoublev"), function(set, "hdSetDoublev"), function(schedule, "hdScheduleAsynchronous");

  makers::Handle& handle = stand_in()->devices.front()->handle;
  const auto note = [&](std::vector<double>* times) { handle.note_turnarounds(times); };
  bench::Turnarounds servo("servo and driver"), plain("the callback of the maker");
  for (int i = 0; i < rounds; ++i) {
    bench::run_servo(open_device("openhaptics:?library=" STAND_IN).get(), servo, note);
    unsigned device = init(nullptr);
    enable(0x4000);
    start();
    const unsigned long callback = schedule(spring, &device, 0x7fff);
    std::this_thread::sleep_for(bench::warm_up);
    plain.measure(note, [] { std::this_thread::sleep_for(bench::round_time); });
    stop();
    unschedule(callback);
    disable(device);
  }
  servo.print();
  plain.print();
}
