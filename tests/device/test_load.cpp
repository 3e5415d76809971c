// Drivers that come in a library of their own.
#include <forceserver/driver.h>

#include "api/support.h"
#include "scenes/folder.h"

using namespace scenes;

static std::string library(const char* name) { return std::string(DRIVER_FOLDER "/lib") + name + ".so"; }

START_TEST(a_driver_is_loaded) {
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("library:0", &raw), "library");
  OK(fs_driver_load(library("driver_good").c_str()));
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("library:1", &raw), "there is device 0 only");
  const Device device = open_device("library:0");
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_str_eq(info.name, "a device from a library");
  const fs_wrench wrench{{1, 2, 3}, {}};
  OK(fs_device_write(device.get(), &wrench));
  fs_state state;
  OK(fs_device_read(device.get(), &state));
  EXPECT_VECTOR(state.pose.position, wrench.force, 0);

  // Loading it again is refused, and the loaded driver goes on.
  EXPECT_SENTENCE(FS_ERROR_EXISTS, fs_driver_load(library("driver_good").c_str()), "library");
  OK(fs_device_write(device.get(), &wrench));
  OK(fs_device_read(device.get(), &state));
}
END_TEST

START_TEST(what_is_no_driver_is_refused) {
  EXPECT_SENTENCE(FS_ERROR_IO, fs_driver_load("/no/such/driver.so"), "/no/such/driver.so' cannot be loaded: cannot open");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_driver_load(""), "empty");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_driver_load(library("driver_without_entry").c_str()), "fs_driver_entry");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_driver_load(library("driver_null").c_str()), "gives no driver");
  EXPECT_SENTENCE(FS_ERROR_IO, fs_driver_load(library("driver_variable").c_str()), "fs_driver_entry is no function");
  const std::string added = "fs_driver has a field at byte " + std::to_string(sizeof(fs_driver));
  EXPECT_SENTENCE(FS_ERROR_VERSION, fs_driver_load(library("driver_newer").c_str()), added.c_str());
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_driver_load(library("driver_incomplete").c_str()), "driver.close");
  const Folder folder;
  const std::string text = folder / "text.so";
  std::FILE* file = std::fopen(text.c_str(), "w");
  std::fputs("this is no library\n", file);
  std::fclose(file);
  EXPECT_SENTENCE(FS_ERROR_IO, fs_driver_load(text.c_str()), "text.so");
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("library:0", &raw), "library");
}
END_TEST

int main() {
  Suite* suite = suite_create("load");
  add_case(suite, "load", {a_driver_is_loaded, what_is_no_driver_is_refused});  // each in a process of its own
  return run_suite(suite);
}
