/* A peg in a hole: a tool of six points, and a plate with a hole that is 0.4 mm wider all around and 3 degrees askew. The
 * tip presses against one wall of the hole, and the upper points come to rest on the rim on the other side: the peg
 * jams. Each point has a proxy and a force of its own. The forces act beside the handle's origin, so they make a torque,
 * which turns the peg towards the direction of the hole. On a device that gives torques the peg then slips in. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <forceserver/forceserver.h>

enum { SIDES = 48 };  /* of the hole */
static const double pi = 3.14159265358979, degree = 0.0174532925199433, askew = 3,  /* degrees, about y */
                    top = -0.02, tip = -0.05;  /* m: the height of the hole's mouth; where the tip is below the handle */

static void check(fs_status status)
{
  if (status >= 0) return;
  fprintf(stderr, "peg_in_hole: %s\n", fs_last_error());
  exit(1);
}

static double rounded(double value, double unit) { return fabs(value) < unit / 2 ? 0 : value; }  /* no "-0.0" */

/* A round plate with a round hole, as a closed mesh: a rectangle that goes round the z axis. */
static fs_shape *make_plate(void)
{
  const double radius[4] = {0.0084, 0.05, 0.05, 0.0084}, height[4] = {-0.06, -0.06, 0, 0};  /* m: the rectangle */
  fs_vec3 corners[4 * SIDES];
  uint32_t faces[8 * SIDES][3];
  fs_shape *shape;
  uint32_t i, j;

  for (i = 0; i < SIDES; ++i) {
    for (j = 0; j < 4; ++j) {
      const uint32_t a = 4 * i + j, b = 4 * i + (j + 1) % 4, c = (a + 4) % (4 * SIDES), d = (b + 4) % (4 * SIDES);
      const uint32_t two[2][3] = {{a, c, b}, {b, c, d}};  /* counter-clockwise as seen from outside: that is the front */
      corners[a].x = radius[j] * cos(2 * pi * i / SIDES);
      corners[a].y = radius[j] * sin(2 * pi * i / SIDES);
      corners[a].z = height[j];
      memcpy(faces[2 * a], two, sizeof two);
    }
  }
  check(fs_shape_create_mesh(corners, 4 * SIDES, &faces[0][0], 8 * SIDES, &shape));
  return shape;
}

/* What happened to the peg. */
struct outcome {
  double depth, tilt;                   /* at the end: mm of the peg in the hole, degrees between peg and hole */
  double force, least_torque, torque;   /* the largest force upwards, N; the least and the largest torque about y, N m */
};

/* Pushes the peg down for a second, and prints what the hand feels. */
static struct outcome push(const char *device_uri)
{
  struct outcome out = {0, 0, 0, 0, 0};
  fs_object plate = fs_object_init("plate", FS_PRIMITIVE_MESH);
  fs_servo_options options = fs_servo_options_init();
  fs_vec3 points[6];
  fs_scene *scene;
  fs_device *device;
  fs_servo *servo;
  int i;

  for (i = 0; i < 6; ++i) {  /* three around the tip; three 30 mm higher, between them */
    points[i].x = 0.008 * cos(i * pi / 3);
    points[i].y = 0.008 * sin(i * pi / 3);
    points[i].z = i % 2 ? tip + 0.03 : tip;
  }
  plate.shape = make_plate();
  plate.pose.position.z = top;
  plate.pose.orientation.w = cos(askew / 2 * degree);
  plate.pose.orientation.y = sin(askew / 2 * degree);
  plate.contact.keep = FS_KEEP_FRONT;
  plate.contact.stiffness = 2000;  /* for each point; their forces add */
  plate.contact.damping = 10;
  plate.contact.limit = 20;        /* for all points together */
  check(fs_scene_create(&scene));
  check(fs_scene_set_tool(scene, points, 6));
  check(fs_object_set(scene, &plate));
  fs_shape_destroy(plate.shape);  /* the scene keeps what it needs */
  options.mode = FS_SERVO_VIRTUAL;   /* time advances only when we step the servo */
  options.fade = options.ramp = -1;  /* felt in full from the first tick on: no person holds this handle */
  options.max_stiffness = -1;        /* nor is what the plate pushes back with bounded, to show the jam */
  check(fs_device_open(device_uri, &device));
  check(fs_servo_start(scene, device, &options, &servo));
  printf("   time      depth      tilt   force: sideways, up     torque\n");
  for (i = 1; i <= 1000; ++i) {
    fs_state hand;
    fs_response felt;
    fs_quat q;
    double peg_x, peg_z, torque;
    check(fs_servo_step(servo, 1));
    check(fs_scene_get_hand(scene, &hand, &felt, NULL));
    q = hand.pose.orientation;
    peg_x = 2 * (q.x * q.z + q.w * q.y);  /* the direction of the peg */
    peg_z = 1 - 2 * (q.x * q.x + q.y * q.y);
    torque = felt.wrench.torque.y;
    out.tilt = askew - atan2(peg_x, peg_z) / degree;
    out.depth = 1e3 * (top - hand.pose.position.z - tip * peg_z);
    out.force = fmax(out.force, felt.wrench.force.z);
    out.torque = fmax(out.torque, torque);
    out.least_torque = fmin(out.least_torque, torque);
    if (i >= 400 && i % 50 == 0)
      printf("%5.2f s  %6.1f mm  %4.1f deg     %4.1f N   %4.1f N   %6.3f N m\n", i * 1e-3, out.depth, out.tilt,
             rounded(felt.wrench.force.x, 0.1), rounded(felt.wrench.force.z, 0.1), rounded(torque, 0.001));
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
  return out;
}

static int failures = 0;

static void expect(int holds, const char *sentence)
{
  printf("%s: %s\n", holds ? "yes" : "NO", sentence);
  if (!holds) ++failures;
}

int main(void)
{
  struct outcome fixed, turning;
  printf("a handle that does not turn\n");  /* a passive wrist: no torque comes from the device */
  fixed = push("sim:?hand=firm&path=touch&wrist=passive");
  printf("\na handle that turns\n");
  turning = push("sim:?hand=firm&path=touch&wrist=active");
  printf("\n");
  expect(fixed.depth > 30 && fixed.depth < 36 && fixed.force > 5, "the peg that does not turn jams, 30 mm deep");
  expect(fixed.torque > 0.05 && fixed.least_torque > -0.005, "its torque always points to where the hole does");
  expect(turning.tilt < 2.2 && turning.least_torque > -0.01, "this torque turns the other peg, until it fits");
  expect(turning.depth > 50, "so it slips in");
  return failures > 0;
}
