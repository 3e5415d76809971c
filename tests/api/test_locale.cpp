// Numbers in files, expressions and URIs have a decimal point wherever the program is run: in a locale with a decimal comma,
// too, they are read and written alike. The test makes such a locale, because a machine may have none.
#include <clocale>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>

#include "api/support.h"
#include "scenes/folder.h"

using namespace scenes;

// A locale with a decimal comma, for as long as this lives.
class Comma {
 public:
  Comma() {
    std::ofstream(folder_ / "comma") << "LC_NUMERIC\ndecimal_point \",\"\nthousands_sep \".\"\ngrouping 3;3\nEND LC_NUMERIC\n";
    // Other categories are missing in it, so localedef warns; -c makes it go on.
    const std::string command = "localedef -c -i '" + (folder_ / "comma") + "' '" + (folder_ / "xx_XX") + "' > /dev/null 2>&1";
    (void)!std::system(command.c_str());
    setenv("LOCPATH", folder_.path.c_str(), 1);
    ck_assert_msg(std::setlocale(LC_ALL, "xx_XX"), "localedef (Debian: libc-bin) has not made the locale");
    char text[8];
    std::snprintf(text, sizeof text, "%g", 0.5);
    ck_assert_str_eq(text, "0,5");
  }
  ~Comma() {
    std::setlocale(LC_ALL, "C");
    unsetenv("LOCPATH");
  }

 private:
  Folder folder_;
};

static std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

START_TEST(files_are_the_same) {
  const Folder folder;
  const Scene scene = make_scene();
  fs_object wall = fs_wall_init("wall", fs_vec3{0.5, -1.25, 3e-7}, fs_vec3{0, 0, 1}, 1234567.5, 2.75);
  OK(fs_object_set(scene.get(), &wall));
  OK(fs_scene_save(scene.get(), (folder / "point.json").c_str()));
  const Comma comma;
  OK(fs_scene_save(scene.get(), (folder / "comma.json").c_str()));
  const std::string expected = text_of(folder / "point.json"), saved = text_of(folder / "comma.json");
  ck_assert_str_eq(saved.c_str(), expected.c_str());
  const Scene loaded = make_scene();
  OK(fs_scene_load(loaded.get(), (folder / "point.json").c_str()));
  fs_object found = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
  OK(fs_object_get(loaded.get(), "wall", &found));
  ck_assert(found.pose.position.x == 0.5 && found.pose.position.y == -1.25 && found.pose.position.z == 3e-7);
  fs_object_release(&found);
}
END_TEST

START_TEST(expressions_have_points) {
  const Comma comma;
  fs_curve* curve = nullptr;
  OK(fs_curve_create_expression("0.5 + 1.5e-1*d", &curve));
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 10);
  profile.curve = curve;
  const double distance = 2;
  double force = 0;
  OK(fs_profile_evaluate(&profile, 0, 0, &distance, 1, &force));
  ck_assert(force > 0.8 - 1e-12 && force < 0.8 + 1e-12);
  fs_curve_destroy(curve);
  ck_assert_int_eq(fs_curve_create_expression("0,5", &curve), FS_ERROR_PARSE);
}
END_TEST

START_TEST(uris_have_points) {
  const Comma comma;
  fs_device* device = nullptr;
  OK(fs_device_open("sim:?mass=0.375&delay_ms=2.5", &device));
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device, &info));
  ck_assert(info.mass == 0.375 && info.delay == 0.0025);
  fs_device_close(device);
}
END_TEST

// A sentence shows a number as it has to be written.
START_TEST(sentences_have_points) {
  const Comma comma;
  fs_device* device = nullptr;
  EXPECT(FS_ERROR_INVALID, fs_device_open("sim:?mass=0.001", &device));
  ck_assert_msg(std::strstr(fs_last_error(), "within 0.01..10"), "%s", fs_last_error());
  fs_object wall = fs_wall_init("wall", fs_vec3{}, fs_vec3{0, 0, 1}, 1000, 10);
  wall.back.limit = -0.5;
  EXPECT(FS_ERROR_INVALID, fs_object_set(make_scene().get(), &wall));
  ck_assert_msg(std::strstr(fs_last_error(), " is -0.5,"), "%s", fs_last_error());
  char text[8];
  std::snprintf(text, sizeof text, "%g", 0.5);
  ck_assert_str_eq(text, "0,5");  // the locale of the program is as it was
}
END_TEST

int main() {
  Suite* suite = suite_create("locale");
  add_case(suite, "a decimal comma", {files_are_the_same, expressions_have_points, uris_have_points, sentences_have_points});
  return run_suite(suite);
}
