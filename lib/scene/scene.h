// The fs_scene of the C contract: the calls of a scene, wherever its objects are evaluated. LocalScene evaluates them in
// this process, RemoteScene (client/) at a server. Any thread may call; calls that are not noexcept throw Error.
#pragma once

#include <vector>

#include <forceserver/server.h>

#include "base/counted.h"
#include "field/object.h"

namespace fs {
struct LocalScene;
}

struct fs_scene : fs::Counted<fs_scene> {
  virtual ~fs_scene() = default;

  // The caller has given its handle back. A servo, a tool or a call of another thread may still hold the scene.
  virtual void close() noexcept {}

  // The scene's own objects as this process has them.
  virtual fs::LocalScene& local() = 0;
  virtual bool is_remote() const noexcept = 0;

  // Objects.
  virtual void set(const fs_object& object) = 0;
  virtual void change(const fs_object& object, uint32_t parts) = 0;
  virtual void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) = 0;
  virtual void remove(const char* name) = 0;
  virtual void clear() = 0;
  // Fills out; its handles live as long as what is returned.
  virtual fs::Ref<const fs::Object> get(const char* name, fs_object& out) = 0;

  // The whole of it, and all of it set at once.
  struct Contents {
    std::vector<fs_object> objects;
    fs_frame frame;
    std::vector<fs::Vec3> tool;
    double tool_radius;
    std::vector<fs::Ref<const fs::Object>> owners;  // of the handles in objects
  };
  virtual Contents contents() = 0;
  virtual void set_contents(const std::vector<fs_object>& objects, const fs_frame& frame, const std::vector<fs::Vec3>& tool,
                            double tool_radius) = 0;

  // Groups.
  virtual void begin() = 0;
  virtual void commit() = 0;
  virtual void cancel() = 0;
  virtual void sync(double timeout) = 0;

  // Frame, clutch, tool, accuracy, slope.
  virtual void set_frame(const fs_frame& frame) = 0;
  virtual fs_frame get_frame(const char* client) = 0;  // null: its own
  virtual void set_clutch(bool held) = 0;
  virtual void set_tool(const fs::Vec3* points, size_t count) = 0;
  virtual std::vector<fs::Vec3> get_tool() = 0;
  virtual void set_tool_radius(double radius) = 0;
  virtual double get_tool_radius() = 0;
  virtual fs_view view(const char* client) = 0;  // null: its own
  virtual void set_accuracy(double newtons) = 0;
  virtual void set_max_stiffness(double stiffness) = 0;

  // Clock, s.
  virtual fs_status get_time(double& out) const noexcept = 0;  // [rt]
  virtual fs_status set_time(double time) noexcept = 0;        // [rt]

  // Reports and events.
  virtual std::vector<fs_report> reports() = 0;
  virtual fs_report report(const char* name) = 0;
  virtual std::vector<fs_motion> motions(const char* client) = 0;  // null: of all that it can see
  // By motion_revision, those above `since`. null: connected, of all others; else its own.
  virtual std::vector<fs_motion> motions_since(const char* client, uint64_t since) = 0;
  virtual fs_event next_event(double timeout) = 0;

  // The servo that runs this scene, and the others it runs. Null: not asked. Structs that grow: all but struct_size.
  virtual fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept = 0;  // [rt]
  virtual void get_servo_stats(fs_servo_stats& out) = 0;
  virtual void get_device_info(fs_device_info& out) = 0;
  virtual std::vector<fs_recorded_tick> record(uint64_t after) = 0;
  virtual void stop_force() = 0;
  virtual void resume_force() = 0;
  virtual std::vector<fs_client> clients() = 0;
  virtual std::vector<fs_client_view> views() = 0;  // of the same clients
};

namespace fs {
using Scene = fs_scene;
struct ServoOutput;

// Arguments that every kind of scene checks in the same way. INVALID, unless they say otherwise.
fs_frame parse_frame(const fs_frame& frame);
void check_tool(const Vec3* points, size_t count);  // 1..32 points
void check_tool_radius(double radius);
void check_timeout(double timeout);
void check_accuracy(double newtons);
void check_max_stiffness(double stiffness);
void require_no_client(const char* client);  // NOT_FOUND: it is not null

// [rt] What fs_scene_get_hand gives. Null: not asked.
fs_status read_hand(const ServoOutput& output, fs_state* state, fs_response* response, fs_wrench* sent) noexcept;
}  // namespace fs
