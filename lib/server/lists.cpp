#include "server/lists.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "base/error.h"
#include "base/text.h"
#include "field/frame.h"
#include "scene/moment.h"
#include "server/clients.h"
#include "transfer/records.h"

namespace fs {

void List::flush() {
  blob_->write(piece_);
  piece_.clear();
}

void List::make() noexcept {
  try {
    BlobWriter blob;
    blob_ = &blob;
    write();
    flush();
    data = blob.seal();
  } catch (Error& error) {
    status = error.status;
    text = std::move(error.text);
  } catch (...) {
    status = FS_ERROR_MEMORY;
    text = "the server has not enough memory for the list";
  }
  release();
}

std::shared_ptr<Client> find_client(const Client& asking, const std::string& name) {
  std::shared_ptr<Client> found = asking.host.clients().find(name);
  if (!found && name != "server") {
    fail(FS_ERROR_NOT_FOUND, "client is '%s': no client of that name is connected", shortened(name).c_str());
  }
  return found;
}

fs_report seen_from(const fs_report& report, const fs_frame& owner, const fs_frame& viewer) {
  fs_report out = report;
  if (!std::isfinite(report.distance)) return out;
  out.point = to_scene(viewer, to_device(owner, report.point));
  const Wrench at_device = to_device(owner, report.wrench);
  const Quat back = conjugate(viewer.pose.orientation);
  out.wrench = {rotate(back, at_device.force), rotate(back, at_device.torque)};  // N at the device, along the viewer's axes
  out.distance = report.distance * viewer.scale / owner.scale;
  return out;
}

namespace {

void answer_made(const Client& client, uint64_t serial, const List& list) {
  if (list.status == FS_OK) {
    client.answers.send_record(serial, list.count, list.data.get());
  } else {
    client.answers.refuse(serial, list.status, list.text);
  }
}

void answer(Client& client, uint64_t serial, const std::shared_ptr<List>& list) {
  constexpr size_t short_list = 64;
  if (list->most() <= short_list) {
    list->make();
    return answer_made(client, serial, *list);
  }
  client.host.start_job(
      client, 0, [list](StopToken&) { list->make(); }, [&client, serial, list] { answer_made(client, serial, *list); });
}

template <class Record>
void answer_list(const Client& client, uint64_t serial, const std::vector<Record>& list) {
  const Descriptor blob = make_blob({bytes_of(list.data(), list.size())});
  client.answers.send_record(serial, wire::Count{list.size(), sizeof(Record)}, blob.get());
}

// A list about the objects of some scenes.
class SceneList : public List {
 public:
  struct Part {
    Part(std::string the_prefix, const Ref<LocalScene>& scene) : prefix(std::move(the_prefix)), moment(scene, false) {}
    const std::string prefix;  // empty: the client's own
    const Moment moment;
    std::vector<fs_report> absent;  // by bare names
  };
  std::deque<Part> parts;

  size_t most() const override {
    size_t sum = 0;
    for (const Part& part : parts) sum += part.moment.most() + part.absent.size();
    return sum;
  }

 private:
  void release() override { parts.clear(); }
};

// A list of how the objects move: of a client; "": of all but the asking one.
class MotionList : public SceneList {
 public:
  void add_scenes(const Client& client, const std::string& whose);  // NOT_FOUND

 private:
  void write() override {
    for (const Part& part : parts) {
      part.moment.for_each_motion(part.prefix, [&](const fs_motion& motion) { add_record(motion); });
    }
  }
};

// The moves that were made before the request are taken first, and the server's own scene is looked at first: it alone is changed
// by other threads meanwhile.
void MotionList::add_scenes(const Client& client, const std::string& whose) {
  const std::shared_ptr<Client> only = whose.empty() ? nullptr : find_client(client, whose);
  const Clients& clients = client.host.clients();
  const auto is_wanted = [&](const Client& other) { return whose.empty() ? &other != &client : &other == only.get(); };
  clients.for_each([&](const std::shared_ptr<Client>& other) {
    if (is_wanted(*other)) other->take_moves();
  });
  if (!only) parts.emplace_back("server/", client.host.servo().scene());
  clients.for_each([&](const std::shared_ptr<Client>& other) {
    if (is_wanted(*other)) parts.emplace_back(other->name + "/", other->scene);
  });
}

// Of the same objects those that have a motion_revision above `since`. The scenes are looked at one after the other. What has
// changed after the first was is left out, and comes the next time: else its number, which is asked with then, could be above
// that of a change that this list does not have.
class RecentMotionList final : public MotionList {
 public:
  explicit RecentMotionList(uint64_t since) : since_(since) {}

  // They are counted, so that the few that most looks find need no worker, who may be building a mesh.
  size_t most() const override {
    constexpr size_t counted = 65536;  // in 50 us
    const size_t all = SceneList::most();
    if (all > counted) return all;
    size_t sum = 0;
    for (const Part& part : parts) sum += part.moment.count_since(since_, last());
    return sum;
  }

 private:
  uint64_t last() const noexcept {
    uint64_t out = UINT64_MAX;
    for (const Part& part : parts) out = std::min(out, part.moment.last_revision());
    return out;
  }
  void write() override {
    for (const Part& part : parts) {
      part.moment.for_each_motion_since(part.prefix, since_, last(), [&](const fs_motion& motion) { add_record(motion); });
    }
  }
  const uint64_t since_;
};

// A list of what became of all objects.
class ReportList final : public SceneList {
 public:
  fs_frame frame;  // of the client

 private:
  void write() override {
    for (const Part& part : parts) {
      const auto add = [&](const fs_report& report) {
        if (part.prefix.empty()) return add_record(report);
        fs_report seen = seen_from(report, part.moment.frame(), frame);
        put_text(seen.name, part.prefix + report.name);
        add_record(seen);
      };
      part.moment.for_each_report(add);
      for (const fs_report& report : part.absent) add(report);
    }
  }
};

// A list of what the servo has recorded.
class RecordList final : public List {
 public:
  RecordList(Servo& servo, uint64_t after) : servo_(Ref<Servo>::retain(&servo)), after_(after) {}
  size_t most() const override { return std::min<size_t>(servo_->record().count(after_), wire::most_ticks); }

 private:
  void write() override {
    servo_->record().for_each(after_, wire::most_ticks, [&](const fs_recorded_tick& each) { add_record(each); });
  }
  const Ref<Servo> servo_;
  const uint64_t after_;
};

}  // namespace

void answer_motions(Client& client, uint64_t serial, const std::string& whose) {
  const auto list = std::make_shared<MotionList>();
  list->add_scenes(client, whose);
  answer(client, serial, list);
}

void answer_motions_since(Client& client, uint64_t serial, const wire::Since& since) {
  const auto list = std::make_shared<RecentMotionList>(since.revision);
  list->add_scenes(client, text_of(since.client.name));
  answer(client, serial, list);
}

void answer_reports(Client& client, uint64_t serial) {
  const auto list = std::make_shared<ReportList>();
  const auto add = [&](const std::string& prefix, const Client& owner) {
    SceneList::Part& part = list->parts.emplace_back(prefix, owner.scene);
    owner.names.for_each_absent([&](const std::string& name, const Absence& absent) {
      part.absent.push_back(report_of(name, absent));
    });
  };
  list->frame = client.scene->view(false).frame;
  add("", client);
  list->parts.emplace_back("server/", client.host.servo().scene());
  client.host.clients().for_each([&](const std::shared_ptr<Client>& other) {
    if (other.get() != &client) add(other->name + "/", *other);
  });
  answer(client, serial, list);
}

// Lists the server's own scene first, then the clients.
void answer_clients(Client& client, uint64_t serial) {
  Servo& servo = client.host.servo();
  fs_client own{};
  put_text(own.name, "server");
  own.process = static_cast<uint32_t>(getpid());
  own.user = geteuid();
  own.objects = static_cast<uint32_t>(servo.scene()->object_count());
  own.force_limit = servo.settings().limits.force;
  own.wrench = servo.channels().own_wrench();
  std::vector<fs_client> list = client.host.clients().describe();
  list.insert(list.begin(), own);
  answer_list(client, serial, list);
}

void answer_record(Client& client, uint64_t serial, uint64_t after) {
  answer(client, serial, std::make_shared<RecordList>(client.host.servo(), after));
}

fs_view view_seen_by(const Client& asking, const Client* owner) {
  fs_view out = (owner ? *owner->scene : *asking.host.servo().scene()).view(false);
  if (owner != &asking) return out;
  for (const ReceivedBatch& parked : asking.parked.batches()) {
    for (const Change& change : parked.changes) foresee(out, change);
  }
  return out;
}

void answer_views(Client& client, uint64_t serial) {
  std::vector<fs_client_view> list;
  const auto add = [&](const std::string& name, const Client* owner) {
    put_text(list.emplace_back().name, name);
    list.back().view = view_seen_by(client, owner);
  };
  add("server", nullptr);
  client.host.clients().for_each([&](const std::shared_ptr<Client>& other) { add(other->name, other.get()); });
  answer_list(client, serial, list);
}

}  // namespace fs
