// What may go wrong with a Falcon while it is opened, and while a servo pushes the hand that holds it: the hand feels 0 soon, and when
// the trouble has gone, the force comes back through READY.
#include <cmath>
#include <functional>
#include <vector>

#include "device/usb/falcon_rig.h"

using namespace scenes;

namespace {

// How long the hand felt a force after the trouble began, as the Falcon saw it (s). Waits until there is none.
double felt_after(const FalconRig& rig, double begin) {
  ck_assert(until([&] { return rig.push() == 0; }));
  return rig.see([](FalconModel& model) { return model.last_force_time; }) - begin;
}

double time_of(const FalconRig& rig) { return rig.see([](FalconModel& model) { return model.time(); }); }

// A busy machine may need longer than 20 ms; the Falcon's own watchdog is 20 ms.
constexpr double soon = 0.5;  // s

struct Trouble {
  const char* name;
  std::function<void(FalconRig&)> begin, end;
  bool may_last = false;  // is tried for longer than the driver keeps a silent device open
};

void endure(const Trouble& trouble, double lasting) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushes(rig); }));
  const double begin = time_of(rig);
  trouble.begin(rig);
  const double felt = felt_after(rig, begin);
  std::this_thread::sleep_for(std::chrono::duration<double>(lasting));
  ck_assert_msg(rig.push() == 0, "%s: a force of %g N", trouble.name, rig.push());
  if (trouble.may_last && lasting > 1) ck_assert_uint_gt(rig.bus.counts(1).opens, 1);  // it was opened anew
  trouble.end(rig);
  const bool is_back = until([&] { return pushes(rig); });
  ck_assert_msg(is_back, "%s: no force came back", trouble.name);
  std::printf("  %-30s %3g s: felt for %5.1f ms\n", trouble.name, lasting, 1e3 * felt);
  ck_assert_msg(felt < soon, "%s: felt for %g s", trouble.name, felt);
}

const std::vector<Trouble>& troubles() {
  const auto none = [](FalconRig& rig) { rig.fault(UsbFault::none); };
  static const std::vector<Trouble> all{
      {"reports stall", [](FalconRig& rig) { rig.fault(UsbFault::stall); }, none},
      {"errors on the bus", [](FalconRig& rig) { rig.fault(UsbFault::error); }, none},
      {"reports that are too long", [](FalconRig& rig) { rig.fault(UsbFault::overlong); }, none},
      {"reports that are cut", [](FalconRig& rig) { rig.fault(UsbFault::shortened); }, none},
      {"garbage", [](FalconRig& rig) { rig.fault(UsbFault::garbage); }, none, true},
      {"no transfer comes", [](FalconRig& rig) { rig.fault(UsbFault::silence); }, none, true},
      {"the Falcon is silent", [](FalconRig& rig) { rig.change([](FalconModel& m) { m.answers = false; }); },
       [](FalconRig& rig) { rig.change([](FalconModel& m) { m.answers = true; }); }, true},
      {"commands stall", [](FalconRig& rig) { rig.fault(UsbFault::none, UsbFault::stall); }, none},
      {"commands fail", [](FalconRig& rig) { rig.fault(UsbFault::none, UsbFault::error); }, none},
      {"commands are not taken", [](FalconRig& rig) { rig.fault(UsbFault::none, UsbFault::silence); }, none, true},
      {"all stalls", [](FalconRig& rig) { rig.fault(UsbFault::stall, UsbFault::stall, UsbFault::stall); }, none, true},
      {"nothing works", [](FalconRig& rig) { rig.fault(UsbFault::silence, UsbFault::silence, UsbFault::silence); }, none, true},
      {"it is no longer homed",
       [](FalconRig& rig) { rig.change([](FalconModel& m) { m.is_homed = m.homes_when_asked = false; }); },
       [](FalconRig& rig) { rig.change([](FalconModel& m) { m.homes_when_asked = true; }); }},
  };
  return all;
}

}  // namespace

// For a moment, and so long that the driver opens the device again.
START_TEST(troubles_of_a_moment) { endure(troubles()[static_cast<size_t>(_i)], 0.05); }
END_TEST
START_TEST(troubles_that_last) {
  const Trouble& trouble = troubles()[static_cast<size_t>(_i)];
  if (trouble.may_last) endure(trouble, 1.5);
}
END_TEST

START_TEST(an_encoder_that_jumps) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  Pushing pushing(device.get(), {0.01, 0, 0});
  ck_assert(until([&] { return pushes(rig); }));
  double begin = time_of(rig);
  rig.change([](FalconModel& model) { model.encoder_offset = {0, 1500, 0}; });  // more than even a late report excuses
  std::printf("  a jump: felt for %.1f ms\n", 1e3 * felt_after(rig, begin));
  ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.lights; }) == 8; }));  // blue
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ck_assert_double_eq(rig.push(), 0);
  fs_answer answer;
  OK(fs_device_control(device.get(), "status", &answer));
  ck_assert_msg(std::strstr(answer.text, "an encoder has jumped") == answer.text, "%s", answer.text);
  OK(fs_device_control(device.get(), "home", &answer));
  rig.change([](FalconModel& model) { model.encoder_offset = {}; });  // homing finds the origin
  ck_assert(until([&] { return pushes(rig); }));
}
END_TEST

// A command is sent again when its report is late. When both have come, there is one on its way again, not two for ever.
START_TEST(a_late_report_makes_no_queue) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  ck_assert(until([&] { return is_ready(device.get()); }));
  // A busy machine may be late itself, and then sends more; so this is tried until it is as it should be.
  ck_assert(until([&] {
    rig.change([](FalconModel& model) {
      model.late = 0.007;
      model.queued = 0;
    });
    ck_assert(until([&] { return rig.see([](FalconModel& model) { return model.queued; }) > 0; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    return rig.see([](FalconModel& model) { return model.queued; }) == 1;
  }));
}
END_TEST

// The driver itself gives no force where the position cannot be believed: what is written without a servo would stay.
START_TEST(without_a_servo_there_is_no_force_either) {
  FalconRig rig;
  const Device device = open_device("falcon:0");
  fs_wrench wrench{};
  wrench.force = {0, 0, 1};
  OK(fs_device_write(device.get(), &wrench));
  ck_assert(until([&] { return pushes(rig); }));
  rig.change([](FalconModel& model) { model.is_homed = model.homes_when_asked = false; });
  ck_assert(until([&] { return rig.push() == 0; }));
  rig.change([](FalconModel& model) { model.homes_when_asked = true; });
  ck_assert(until([&] { return pushes(rig); }));
  rig.change([](FalconModel& model) { model.encoder_offset = {0, 0, 1500}; });
  ck_assert(until([&] { return rig.push() == 0; }));
}
END_TEST

// It stands still while the hand goes on.
START_TEST(an_encoder_that_is_stuck) {
  FalconRig rig;
  rig.change([](FalconModel& model) {
    model.hand_stiffness = 2000;
    model.hand_damping = 30;
  });
  const Device device = open_device("falcon:0");
  ck_assert(until([&] { return is_ready(device.get()); }));
  rig.change([](FalconModel& model) { model.is_encoder_stuck = {false, true, false}; });
  ck_assert(until([&] {
    rig.change([](FalconModel& model) { model.target.z = model.target.z > 0.125 ? 0.100 : 0.150; });
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    return !is_ready(device.get());
  }));
  // It moves again, from where it was: it has lost counts.
  rig.change([](FalconModel& model) {
    model.is_encoder_stuck = {};
    model.target = {0, 0, 0.125};
  });
  fs_answer answer;
  OK(fs_device_control(device.get(), "home", &answer));
  ck_assert(until([&] { return is_ready(device.get()); }));
}
END_TEST

int main() {
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  Suite* suite = suite_create("usb_falcon_faults");
  TCase* looped = tcase_create("troubles");
  tcase_set_timeout(looped, 200);
  tcase_add_loop_test(looped, troubles_of_a_moment, 0, static_cast<int>(troubles().size()));
  tcase_add_loop_test(looped, troubles_that_last, 0, static_cast<int>(troubles().size()));
  suite_add_tcase(suite, looped);
  add_case(suite, "encoders", {an_encoder_that_jumps, an_encoder_that_is_stuck, a_late_report_makes_no_queue,
                               without_a_servo_there_is_no_force_either});
  return run_suite(suite);
}
