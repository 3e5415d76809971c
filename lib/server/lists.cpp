// What viewers, editors and bridges ask for: where the tools are, and how all objects move.
#include <deque>
#include <memory>

#include "base/error.h"
#include "scene/moment.h"
#include "server/list.h"
#include "server/session.h"

namespace fs {

Session* Session::find_client(const std::string& name) const {
  Session* const found = server_.find(name);
  if (!found && name != "server") {
    fail(FS_ERROR_NOT_FOUND, "client is '%.80s': no client of that name is connected", name.c_str());
  }
  return found;
}

void Session::tell_view(const Message& message) {
  const Session* const owner = find_client(text_of(message.as<wire::Target>().name));
  fs_view out = (owner ? *owner->scene_ : *server_.servo().scene()).view(false);
  if (owner == this) {  // as it was said, where that waits for a shape still
    for (const Unit& unit : parked_) {
      for (const Message& waiting : unit.messages) {
        foresee(out, static_cast<wire::Type>(waiting.header.type), waiting.body);
      }
    }
  }
  reply(message.header.serial, bytes_of(&out, 1));
}

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
  }
  release();
}

void Session::tell_list(uint64_t serial, const std::shared_ptr<List>& list) {
  constexpr size_t short_list = 64;
  if (list->most() <= short_list) {
    list->make();
    return tell_made(serial, *list);
  }
  server_.worker(0).add(id_, {[list](Wanted&) { list->make(); }, [server = &server_, session = id_, serial, list] {
    const std::shared_ptr<Session> found = server->find(session);
    if (!found) return;
    found->tell_made(serial, *list);
    found->finish_job();
  }});
  ++jobs_;
  regulate();
}

void Session::tell_made(uint64_t serial, const List& list) {
  if (list.status == FS_OK) return reply(serial, bytes_of(&list.count, 1), list.data.get());
  reply_failure(serial, list.status, list.text.empty() ? "the server has not enough memory for the list" : list.text);
}

namespace {

// How the objects of some scenes move, all at one instant.
class MotionList final : public List {
 public:
  struct Part {
    Part(std::string the_prefix, const Ref<LocalScene>& scene) : prefix(std::move(the_prefix)), moment(scene, false) {}
    const std::string prefix;
    const LocalScene::Moment moment;
  };
  std::deque<Part> parts;

  size_t most() const override {
    size_t sum = 0;
    for (const Part& part : parts) sum += part.moment.most();
    return sum;
  }

 private:
  void write() override {
    for (const Part& part : parts) {
      part.moment.for_each_motion(part.prefix, [&](const fs_motion& motion) { add_record(motion); });
    }
  }
  void release() override { parts.clear(); }
};

}  // namespace

// At one instant: no other message is looked at meanwhile, so no group is there half.
void Session::tell_motions(const Message& message) {
  const std::string client = text_of(message.as<wire::Target>().name);
  const Session* const only = client.empty() ? nullptr : find_client(client);
  const auto list = std::make_shared<MotionList>();
  if (!only) list->parts.emplace_back("server/", server_.servo().scene());
  for (const std::shared_ptr<Session>& session : server_.sessions()) {
    const bool is_wanted = client.empty() ? session.get() != this : session.get() == only;
    if (!is_wanted || session->is_gone_ || !session->scene_) continue;
    session->take_moves();  // what it has moved before
    list->parts.emplace_back(session->name_ + "/", session->scene_);
  }
  tell_list(message.header.serial, list);
}

}  // namespace fs
