// A scene at a server. Changes of own objects, frame and tool are first checked on the replica in this process, as a group that
// is committed there when they were sent. Moves of own objects go through shared memory; every other change, or group of changes, is one message,
// so the server has all of it or nothing. What others change, and what the server refuses, comes to the replica by Pulls.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/event_queue.h"
#include "client/foreign_objects.h"
#include "client/open_syncs.h"
#include "client/pulls.h"
#include "client/reports.h"
#include "client/sender.h"

namespace fs {

struct RemoteScene final : Scene {
  // client: a good name. NOT_FOUND, EXISTS, VERSION, DENIED, FULL, TIMEOUT, IO.
  RemoteScene(const Endpoint& endpoint, const std::string& client);

  void close() noexcept override { connection_.shut(); }
  LocalScene& local() override;
  bool is_remote() const noexcept override { return true; }

  // Objects. A name with '/' is of another client's object, unless this client's name comes first.
  void set(const fs_object& object) override;
  void change(const fs_object& object, uint32_t parts) override;
  void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) override;
  void remove(const char* name) override;
  void clear() override;
  Ref<const Object> get(const char* name, fs_object& out) override;
  Contents contents() override;
  void set_contents(const std::vector<fs_object>& objects, const fs_frame& frame, const std::vector<Vec3>& tool,
                    double tool_radius) override;

  void begin() override;
  void commit() override;
  void cancel() override;
  void sync(double timeout) override;

  void set_frame(const fs_frame& frame) override;
  fs_frame get_frame(const char* client) override { return view(client).frame; }
  void set_clutch(bool held) override;
  void set_tool(const Vec3* points, size_t count) override;
  std::vector<Vec3> get_tool() override;
  void set_tool_radius(double radius) override;
  double get_tool_radius() override;
  fs_view view(const char* client) override;
  void set_accuracy(double newtons) override;
  void set_max_stiffness(double stiffness) override;

  fs_status get_time(double& out) const noexcept override;
  fs_status set_time(double time) noexcept override;

  std::vector<fs_report> reports() override;
  fs_report report(const char* name) override;
  std::vector<fs_motion> motions(const char* client) override;
  std::vector<fs_motion> motions_since(const char* client, uint64_t since) override;
  fs_event next_event(double timeout) override { return events_.next(timeout); }

  fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept override;
  void get_servo_stats(fs_servo_stats& out) override;
  void get_device_info(fs_device_info& out) override;
  std::vector<fs_recorded_tick> record(uint64_t after) override;
  void stop_force() override;
  void resume_force() override;
  std::vector<fs_client> clients() override;
  std::vector<fs_client_view> views() override;

 private:
  double now() const noexcept { return replica_.scene->now(); }
  template <class Info>
  void ask(wire::Type type, Info& out);
  const char* own_name(const char* name) const noexcept;  // without this client's; null: of another client's object

  // All that follow are called with the lock, and may wait without it.
  template <class F>
  void mutate(Call& call, F&& f);
  template <class Record>
  void send_setting(Call& call, wire::Type type, const Record& setting);
  void change_own(Call& call, const fs_object& object, uint32_t parts);
  fs_view own_view(Call& call);
  void foresee_group(fs_view& own) const;

  const std::string client_;
  Line line_;
  Connection& connection_ = line_.connection;
  SentAssets sent_{connection_};
  FetchedAssets fetched_{line_, sent_};
  Replica replica_{sent_, connection_};
  ThreadGroups<Group> groups_;
  Questions questions_;
  Sender sender_{line_, replica_, sent_, questions_};
  Pulls pulls_{line_, replica_, sent_, fetched_, questions_, groups_};
  ForeignObjects foreign_{line_, sent_, fetched_, groups_};
  OpenSyncs syncs_{line_, pulls_};
  Reports reports_{line_, replica_, pulls_, groups_};
  EventQueue events_{line_, replica_, pulls_};
};

}  // namespace fs
