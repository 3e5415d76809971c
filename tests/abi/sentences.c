/* Makes the failures that include/forceserver/errors.md tells of, and prints the sentence of each as "FS_ERROR_...: sentence";
 * errors_page.py compares them with the page. */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include <forceserver/driver.h>
#include <forceserver/forceserver.h>

static void check(fs_status status)
{
  if (status >= 0) return;
  fprintf(stderr, "%s: %s\n", fs_status_name(status), fs_last_error());
  exit(1);
}

/* A call that must fail with this status. */
static void fails(fs_status status, fs_status wanted)
{
  printf("%s: %s\n", fs_status_name(status), status < 0 ? fs_last_error() : "it did not fail");
  if (status == wanted) return;
  printf("%s was expected\n", fs_status_name(wanted));
  exit(1);
}

static fs_object spring_of(const char *name)
{
  fs_object spring = fs_object_init(name, FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
  return spring;
}

static void until_felt(fs_scene *client, const char *name, fs_servo *servo)
{
  fs_report report;
  do {
    usleep(1000);
    check(fs_servo_step(servo, 1));
  } while (fs_scene_get_report(client, name, &report) < 0 || !(report.weight > 0));
}

static void write_file(const char *name, const char *text)
{
  FILE *file = fopen(name, "w");
  if (!file || fputs(text, file) < 0 || fclose(file)) exit(1);
}

int main(void)
{
  const uint32_t faces[3] = {0, 1, 7};
  const fs_vec3 corners[3] = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
  char address[64];
  fs_scene *scene, *idle, *client, *other, *third;
  fs_device *device, *another;
  fs_servo *servo, *second;
  fs_server *server, *refused;
  fs_shape *shape;
  fs_curve *curve;
  fs_object object;
  fs_answer answer;
  fs_vec3 *many;
  size_t i;
  struct rlimit before, less;
  fs_servo_options options = fs_servo_options_init();
  fs_server_options offered = fs_server_options_init();

  snprintf(address, sizeof address, "shm:errors-%ld", (long)getpid());
  check(fs_scene_create(&scene));
  check(fs_scene_create(&idle));

  object = spring_of("spring");
  object.front.limit = 0;
  fails(fs_object_set(scene, &object), FS_ERROR_INVALID);
  object = spring_of("spring");
  object.front.gain = -200;
  fails(fs_object_set(scene, &object), FS_ERROR_INVALID);
  object = spring_of("my spring");
  object.pose.position.x = NAN;
  fails(fs_object_set(scene, &object), FS_ERROR_INVALID);
  object = spring_of("");
  fails(fs_object_set(scene, &object), FS_ERROR_INVALID);
  object = spring_of("spring");
  object.struct_size = 0;
  fails(fs_object_set(scene, &object), FS_ERROR_INVALID);
  fails(fs_shape_create_mesh(corners, 3, faces, 1, &shape), FS_ERROR_INVALID);

  object = fs_object_init("", FS_PRIMITIVE_POINT);
  fails(fs_object_get(scene, "sprung", &object), FS_ERROR_NOT_FOUND);
  fails(fs_scene_load(scene, "hall.json"), FS_ERROR_NOT_FOUND);
  fails(fs_device_open("omega:0", &device), FS_ERROR_NOT_FOUND);
  fails(fs_scene_connect("shm:lab-2", "editor", &client), FS_ERROR_NOT_FOUND);

  check(fs_device_open("sim:", &device));
  check(fs_device_open("sim:", &another));
  options.mode = FS_SERVO_VIRTUAL;
  check(fs_servo_start(scene, device, &options, &servo));
  fails(fs_servo_start(idle, device, &options, &second), FS_ERROR_STATE);
  fails(fs_servo_start(scene, another, &options, &second), FS_ERROR_STATE);
  fails(fs_scene_get_hand(idle, NULL, NULL, NULL), FS_ERROR_STATE);
  fails(fs_scene_commit(scene), FS_ERROR_STATE);
  fails(fs_device_control(device, "lights=green", &answer), FS_ERROR_UNSUPPORTED);
  fails(fs_scene_connect("dds:lab", "editor", &client), FS_ERROR_UNSUPPORTED);

  object = spring_of("spring");
  object.struct_size += 8;
  {
    struct { fs_object object; double newer; } grown = {object, 1};
    fails(fs_object_set(scene, &grown.object), FS_ERROR_VERSION);
  }
  write_file("newer.json", "{\"forceserver\": \"scene\", \"version\": 2, \"objects\": []}");
  fails(fs_scene_load(scene, "newer.json"), FS_ERROR_VERSION);
  write_file("room.json", "{\"forceserver\": \"scene\", \"version\": 1,\n \"objects\": [{\"name\": \"a\" \"primitive\": \"point\"}]}");
  fails(fs_scene_load(scene, "room.json"), FS_ERROR_PARSE);
  write_file("room.json", "{\"forceserver\": \"scene\", \"version\": 1,\n \"objects\": [{\"name\": \"a\", \"primitive\": \"point\", \"color\": 1}]}");
  fails(fs_scene_load(scene, "room.json"), FS_ERROR_PARSE);
  fails(fs_curve_create_expression("3*exp(-d/0.03", &curve), FS_ERROR_PARSE);
  fails(fs_curve_create_expression("3*sine(d)", &curve), FS_ERROR_PARSE);
  fails(fs_scene_save(scene, "no/such/folder.json"), FS_ERROR_IO);
  write_file("falcon.so", "");
  fails(fs_driver_load("./falcon.so"), FS_ERROR_IO);

  object = spring_of("spring");
  check(fs_object_set(scene, &object));
  fails(fs_scene_sync(scene, 0.1), FS_ERROR_TIMEOUT);  /* nobody steps the servo */

  offered.max_objects = 2;
  offered.locked = true;
  check(fs_server_start(servo, address, &offered, &server));
  check(fs_scene_connect(address, "rover", &client));
  fails(fs_scene_connect(address, "rover", &other), FS_ERROR_EXISTS);
  check(fs_servo_start(idle, another, &options, &second));
  fails(fs_server_start(second, address, NULL, &refused), FS_ERROR_EXISTS);
  fails(fs_server_start(servo, "shm:another", NULL, &refused), FS_ERROR_STATE);
  fails(fs_object_remove(client, "server/spring"), FS_ERROR_DENIED);
  for (i = 0; i < 2; ++i) {
    object = spring_of(i ? "b" : "a");
    check(fs_object_set(client, &object));
  }
  object = spring_of("c");
  fails(fs_object_set(client, &object), FS_ERROR_FULL);
  check(fs_scene_begin(client));
  for (i = 0; i < 72; ++i) check(fs_object_move(client, "a", &object.pose, NULL, 0));
  fails(fs_object_move(client, "a", &object.pose, NULL, 0), FS_ERROR_FULL);
  check(fs_scene_cancel(client));
  for (i = 0; i < 2; ++i) {  /* objects that are felt, and are replaced by others while they fade out */
    const char *const names[6] = {"a", "b", "c", "d", "e", "f"};
    until_felt(client, names[2 * i + 1], servo);
    check(fs_object_remove(client, names[2 * i]));
    check(fs_object_remove(client, names[2 * i + 1]));
    object = spring_of(names[2 * i + 2]);
    check(fs_object_set(client, &object));
    object = spring_of(names[2 * i + 3]);
    check(fs_object_set(client, &object));
  }
  fails(fs_scene_sync(client, 1), FS_ERROR_FULL);
  offered.max_clients = 1;
  snprintf(address, sizeof address, "shm:errors-%ld-2", (long)getpid());
  check(fs_server_start(second, address, &offered, &refused));
  check(fs_scene_connect(address, "rover", &other));
  fails(fs_scene_connect(address, "editor", &third), FS_ERROR_FULL);
  fs_scene_destroy(other);
  fs_server_stop(refused);
  getrlimit(RLIMIT_NOFILE, &before);
  less = before;
  less.rlim_cur = 0;
  setrlimit(RLIMIT_NOFILE, &less);
  fails(fs_server_start(second, address, NULL, &refused), FS_ERROR_FULL);
  setrlimit(RLIMIT_NOFILE, &before);
  fs_server_stop(server);
  usleep(200000);
  fails(fs_object_set(client, &object), FS_ERROR_DISCONNECTED);

  many = calloc(1 << 20, sizeof *many);
  getrlimit(RLIMIT_AS, &before);
  less = before;
  less.rlim_cur = 0;
  setrlimit(RLIMIT_AS, &less);
  fails(fs_shape_create_polyline(many, 1 << 20, false, &shape), FS_ERROR_MEMORY);
  setrlimit(RLIMIT_AS, &before);

  fs_scene_destroy(client);
  fs_servo_stop(second);
  fs_servo_stop(servo);
  fs_device_close(another);
  fs_device_close(device);
  fs_scene_destroy(idle);
  fs_scene_destroy(scene);
  return 0;
}
