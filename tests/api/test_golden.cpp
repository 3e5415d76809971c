// A recording that is kept for good: 20 s of the simulator's hand on its path through the testbed scene. The same build
// gives the same bits, in whatever portions it is stepped; any build gives the same numbers to 1e-9.
//   test_golden --record    writes the recording anew
#include <fstream>
#include <iomanip>
#include <sstream>

#include "api/support.h"

using namespace scenes;

static const char* const golden_path = GOLDEN_FOLDER "/figure8_testbed.txt";
static constexpr int rate = 1000, seconds = 20, every = 50;

struct Run {
  uint64_t hash = 0xcbf29ce484222325u;       // FNV-1a over state, response and sent of all ticks
  uint32_t faults = 0;
  std::vector<std::vector<double>> rows;     // every 50th tick, with the columns that the recording's second line names

  void add(const void* data, size_t size) {
    for (size_t i = 0; i < size; ++i) hash = (hash ^ static_cast<const unsigned char*>(data)[i]) * 0x100000001b3u;
  }
  void add(const fs_tick& tick, uint64_t number) {
    add(&tick.state, sizeof tick.state);
    add(&tick.response, sizeof tick.response);
    add(&tick.sent, sizeof tick.sent);
    if (number % every) return;
    const fs_pose& p = tick.state.pose;
    const fs_wrench& w = tick.response.wrench;
    const fs_vec3 &s = tick.sent.force, &u = tick.sent.torque;
    const fs_mat3& k = tick.response.stiffness;
    rows.push_back({tick.state.time, p.position.x, p.position.y, p.position.z, p.orientation.w, p.orientation.x,
                    p.orientation.y, p.orientation.z, w.force.x, w.force.y, w.force.z, w.torque.x, w.torque.y,
                    w.torque.z, k.xx, k.yy, k.zz, s.x, s.y, s.z, u.x, u.y, u.z});
  }
};

// The encoders are ideal: a quantum of a real one would turn a last bit into 20 um.
static Run run(const char* uri, uint64_t portion) {
  const Scene scene = make_scene();
  const Device device = open_device(uri);
  const Content content = testbed();
  fill(scene.get(), content);
  fs_servo_options options = fs_servo_options_init();
  options.damping = options.max_stiffness = options.slew_limit = -1;  // recorded before they existed: not a bit differs
  options.mode = FS_SERVO_VIRTUAL;
  options.rate = rate;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  Run result;
  std::vector<fs_tick> ticks(rate);
  for (int second = 0; second < seconds; ++second) {
    for (uint64_t done = 0; done < rate; done += portion) require(fs_servo_step(servo.get(), portion), "fs_servo_step");
    size_t count = 0;
    // The newest second.
    require(fs_servo_get_record(servo.get(), ticks.data(), ticks.size(), &count), "fs_servo_get_record");
    for (int k = 0; k < rate; ++k) result.add(ticks[k], static_cast<uint64_t>(second) * rate + k);
  }
  result.faults = stats_of(scene.get()).faults;
  return result;
}

static const char* const golden_uri = "sim:?path=figure8&encoder=ideal";

START_TEST(same_bits_in_one_build) {
  const Run one = run(golden_uri, 1), many = run(golden_uri, 250);
  ck_assert_uint_eq(one.hash, many.hash);
  const Run quantised = run("sim:?path=figure8&seed=5", 100), again = run("sim:?path=figure8&seed=5", 500);
  ck_assert_uint_eq(quantised.hash, again.hash);
  ck_assert_uint_ne(quantised.hash, one.hash);
  std::printf("  hash of this build: %016lx\n", static_cast<unsigned long>(one.hash));
}
END_TEST

START_TEST(same_numbers_in_any_build) {
  const Run now = run(golden_uri, 100);
  std::ifstream file(golden_path);
  ck_assert_msg(file.good(), "no %s; make it with --record", golden_path);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    rows.emplace_back();
    for (double x; words >> x;) rows.back().push_back(x);
  }
  ck_assert_uint_eq(rows.size(), now.rows.size());
  std::vector<double> scale(now.rows[0].size(), 1e-12);
  for (const auto& row : rows) {
    ck_assert_uint_eq(row.size(), scale.size());
    for (size_t i = 0; i < row.size(); ++i) scale[i] = std::fmax(scale[i], std::fabs(row[i]));
  }
  double worst = 0;
  for (size_t k = 0; k < rows.size(); ++k) {
    for (size_t i = 0; i < scale.size(); ++i) {
      const double error = std::fabs(rows[k][i] - now.rows[k][i]) / scale[i];
      worst = std::fmax(worst, error);
      ck_assert_msg(error <= 1e-9, "row %zu, column %zu: %.17g, recorded %.17g", k, i, now.rows[k][i], rows[k][i]);
    }
  }
  std::printf("  within %.1e of the recording\n", worst);
}
END_TEST

START_TEST(the_recording_is_worth_something) {  // the hand moves, and feels something only part of the time
  const Run now = run(golden_uri, 100);
  ck_assert_uint_eq(now.faults, 0);
  size_t felt = 0, free = 0;
  double low = 1, high = -1;
  for (const auto& row : now.rows) {
    const double force = norm(fs_vec3{row[17], row[18], row[19]});
    felt += force > 0.1;
    free += force < 0.01;
    low = std::fmin(low, row[1]);
    high = std::fmax(high, row[1]);
  }
  ck_assert_uint_gt(felt, now.rows.size() / 10);
  ck_assert_double_gt(high - low, 0.02);
  std::printf("  %zu rows, %zu with a force, %zu without; x from %.3f to %.3f m\n", now.rows.size(), felt, free, low,
              high);
}
END_TEST

static int record() {
  const Run now = run(golden_uri, 100);
  std::ofstream file(golden_path);
  file << "# " << golden_uri << " in scenes::testbed(), virtual servo of " << rate << " Hz, every " << every
       << "th tick.\n"
       << "# time; position, orientation (w x y z); force, torque, stiffness xx yy zz; force, torque as sent\n"
       << std::setprecision(17);
  for (const auto& row : now.rows) {
    for (size_t i = 0; i < row.size(); ++i) file << (i ? " " : "") << row[i];
    file << '\n';
  }
  return file.good() ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--record") == 0) return record();
  Suite* suite = suite_create("golden");
  add_case(suite, "golden", {same_bits_in_one_build, same_numbers_in_any_build, the_recording_is_worth_something});
  return run_suite(suite);
}
