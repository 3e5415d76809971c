// Packets from USB devices: the identity, reports and status of a FIDEL, and the stream of a Falcon. What comes of them is a place
// within the workspace and torques within the limits of the motors, or nothing.
#include "device/falcon/kinematics.h"
#include "device/falcon/packet.h"
#include "device/fidel/usb/arm.h"
#include "device/fidel/usb/device_clock.h"
#include "device/fidel/usb/protocol.h"
#include "device/support/encoder_watch.h"
#include "device/support/refusal.h"
#include "fuzz/fuzz.h"

using fuzz::Input;
using fuzz::require;
using fs::operator*;

namespace {

namespace usb = fs::fidel_usb;

void seal(std::span<uint8_t> packet) {  // gives it the checksum that it must have
  const uint16_t sum = usb::crc16(packet.first(packet.size() - 2));
  packet[packet.size() - 2] = static_cast<uint8_t>(sum);
  packet[packet.size() - 1] = static_cast<uint8_t>(sum >> 8);
}

template <size_t size>
std::array<uint8_t, size> sealed(Input& input, char kind) {
  std::array<uint8_t, size> out{};
  out[0] = static_cast<uint8_t>(kind);
  out[1] = usb::protocol_version;
  input.fill(out.data() + 2, size - 6);
  if (input.byte() == 1) out[size - 4] = 1;
  seal(out);
  return out;
}

usb::Identity usual_identity() {
  usb::Identity out{};
  out.base_radius = 120'000;
  out.platform_radius = 40'000;
  out.upper_arm = 200'000;
  out.forearm = 330'000;
  out.centre_depth = 330'000;
  out.joint_counts = 80'000;
  out.joint_torque = 6'000'000;
  out.joint_speed = 20'000;
  return out;
}

void follow(Input& input, const usb::Arm& arm) {
  fs::EncoderWatch watch({2e4, 16, 1000});
  usb::DeviceClock clock;
  usb::Calibration calibration;
  double now = 100;
  for (int i = 0; i < 50 && !input.is_empty(); ++i) {
    const auto packet = sealed<usb::report_size>(input, 'R');
    const auto report = usb::parse_report(packet);
    if (!report) continue;
    require(usb::packed(*report) == packet, "a report that is packed otherwise");
    now += 1e-3;
    require(clock.time_of(report->time, now) <= now, "a time in the future");
    static_cast<void>(watch.judge(report->joints, clock.last_step()));
    const usb::Arm::Measured measured = arm.measured(report->joints, report->wrist, calibration);
    const fs::Wrench push{{input.number(), 3, -5}, {0.1, 0, 0.2}};
    if (!std::isfinite(push.force.x)) continue;
    const usb::Command command = arm.command(measured, push);
    for (const int32_t torque : command.joints) require(std::abs(torque) <= 6'000'001, "a torque beyond the limit");
    if (measured.place != usb::Arm::good) continue;
    require(fs::is_finite(measured.pose.position) && fs::norm(measured.pose.position) < 0.4, "a place far away");
  }
}

void fidel(Input& input) {
  try {
    const auto packet = sealed<usb::identity_size>(input, 'I');
    const auto identity = usb::parse_identity(packet);
    if (identity) {
      require(identity->serial.back() == 0, "a serial number without an end");
      const usb::Arm arm(*identity);
      require(arm.force_max() > 0 && arm.force_max() <= 25 && std::isfinite(arm.resolution()), "an arm");
    }
  } catch (const fs::Refusal& refusal) {
    require(refusal.status == FS_ERROR_IO, "a refusal:", refusal.text.c_str());
  }
  static_cast<void>(usb::parse_status(sealed<usb::status_size>(input, 'S')));
  static_cast<void>(usb::parse_command(sealed<usb::command_size>(input, 'C')));
  static const usb::Arm usual(usual_identity());
  follow(input, usual);
}

void falcon(std::span<const uint8_t> stream) {
  namespace falcon = fs::falcon;
  falcon::Reports reports;
  size_t count = 0;
  reports.put(stream.data(), stream.size(), [&](const falcon::Report& report) {
    if (++count > 100) return;
    const fs::Vec3 angles = falcon::angles_of(report.encoders);
    const auto pose = falcon::pose_at(angles);
    if (!pose) return;
    require(fs::is_finite(pose->position) && std::isfinite(pose->error), "a place that is not finite");
    const auto commands = falcon::commands_of(fs::transposed(pose->jacobian) * fs::Vec3{3, -1, 9}, falcon::motor_constant);
    for (const int16_t command : commands) require(std::abs(command) <= falcon::largest_command, "a command beyond the limit");
    const auto next = falcon::pose_from(angles, pose->position);
    if (next) require(fs::is_finite(next->position), "a next place that is not finite");
  });
  require(count * falcon::packet_size + reports.stray() <= stream.size(), "more bytes than came");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // As it is, and with checksums that are right.
  const std::span<const uint8_t> bytes(data, size);
  static_cast<void>(usb::parse_report(bytes));
  static_cast<void>(usb::parse_command(bytes));
  static_cast<void>(usb::parse_identity(bytes));
  static_cast<void>(usb::parse_status(bytes));
  static_cast<void>(usb::version_of_identity(bytes));
  Input input(data, size);
  if (input.coin()) falcon(input.rest());
  else fidel(input);
  return 0;
}
